"""Detectors of a case: by name, and what they read."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tetlux.cases.file.schema.lights import DetectorSpec
from tetlux.fem.media.medium import Medium
from tetlux.fem.outcome.detectors import Detector, DiscDetector, FibreDetector, PointDetector, read
from tetlux.fem.outcome.exitance_field import Dark, ExitanceField
from tetlux.meshing.surface.surface import Surface


@dataclass(frozen=True)
class Sensor:
    """A detector with its name and kind."""

    name: str
    kind: str
    detector: Detector


def sensor_of(spec: DetectorSpec, surface: Surface, medium: Medium) -> Sensor:
    """A detector that is known to lie on the surface.

    Raises
    ------
    InputError
        If it does not, or a number is wrong.
    """
    detector: Detector
    if spec.point is not None:
        detector = PointDetector(spec.point)
    elif spec.disc:
        detector = DiscDetector(spec.disc.center, spec.disc.radius)
    else:
        assert spec.fibre is not None
        detector = FibreDetector(spec.fibre.center, spec.fibre.radius, spec.fibre.numerical_aperture)
    # It is read once in the dark, so that what is wrong with its place is said before anything is solved.
    read(detector, Dark(surface, medium))
    return Sensor(spec.name, spec.kind, detector)


def readings(sensors: Sequence[Sensor], solutions: Sequence[tuple[str, str, ExitanceField]]) -> list[dict[str, Any]]:
    """What detectors read, a row for each of them and each solution.

    Parameters
    ----------
    sensors : sequence of Sensor
    solutions : sequence of (str, str, Solution or another ExitanceField)
        With the names of channel and light.

    Returns
    -------
    list of dict
        ``name, kind, channel, light, position`` (unit), ``exitance`` (W/unit²) and ``power`` (W; None for a point).
    """
    rows = []
    for sensor in sensors:
        for channel, light, solution in solutions:
            found = read(sensor.detector, solution)
            rows.append(
                {
                    "name": sensor.name,
                    "kind": sensor.kind,
                    "channel": channel,
                    "light": light,
                    "position": list(found.position),
                    "exitance": found.exitance,
                    "power": found.power,
                }
            )
    return rows


def write_readings(rows: Sequence[dict[str, Any]], unit: str, path: Path) -> None:
    """Write readings as a table, units in its head."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        axes = [f"{axis} [{unit}]" for axis in "xyz"]
        writer.writerow(["name", "kind", "channel", "light", *axes, f"exitance [W/{unit}²]", "power [W]"])
        for row in rows:
            power = "" if row["power"] is None else repr(row["power"])
            names = [row[key] for key in ("name", "kind", "channel", "light")]
            places = [f"{value:.9g}" for value in row["position"]]
            writer.writerow([*names, *places, row["exitance"], power])
