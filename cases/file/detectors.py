"""Detectors of a case: built from the case file, read, and written as ``detectors.csv``."""

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
class NamedDetector:
    """A detector with its name and kind."""

    name: str
    kind: str
    detector: Detector


def build_detector(spec: DetectorSpec, surface: Surface, medium: Medium) -> NamedDetector:
    """Build a detector and check that it lies on the surface.

    Raises
    ------
    InputError
        If it does not lie on the surface, or a number is out of range.
    """
    detector: Detector
    if spec.point is not None:
        detector = PointDetector(spec.point)
    elif spec.disc:
        detector = DiscDetector(spec.disc.center, spec.disc.radius)
    else:
        assert spec.fibre is not None
        detector = FibreDetector(spec.fibre.center, spec.fibre.radius, spec.fibre.numerical_aperture)
    # Reading a dark field checks the position before anything is solved.
    read(detector, Dark(surface, medium))
    return NamedDetector(spec.name, spec.kind, detector)


def read_detectors(
    detectors: Sequence[NamedDetector], solutions: Sequence[tuple[str, str, ExitanceField]]
) -> list[dict[str, Any]]:
    """Read all detectors in all solutions.

    Parameters
    ----------
    detectors : sequence of NamedDetector
    solutions : sequence of (str, str, Solution or another ExitanceField)
        Names of channel and light, and their solution.

    Returns
    -------
    list of dict
        A row for each detector and solution: ``name, kind, channel, light, position`` (unit), ``exitance`` (W/unit²)
        and ``power`` (W; None for a point).
    """
    rows = []
    for entry in detectors:
        for channel, light, solution in solutions:
            reading = read(entry.detector, solution)
            rows.append(
                {
                    "name": entry.name,
                    "kind": entry.kind,
                    "channel": channel,
                    "light": light,
                    "position": list(reading.position),
                    "exitance": reading.exitance,
                    "power": reading.power,
                }
            )
    return rows


def write_readings(rows: Sequence[dict[str, Any]], unit: str, path: Path) -> None:
    """Write readings as CSV, with units in the header."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        axes = [f"{axis} [{unit}]" for axis in "xyz"]
        writer.writerow(["name", "kind", "channel", "light", *axes, f"exitance [W/{unit}²]", "power [W]"])
        for row in rows:
            power = "" if row["power"] is None else repr(row["power"])
            names = [row[key] for key in ("name", "kind", "channel", "light")]
            places = [f"{value:.9g}" for value in row["position"]]
            writer.writerow([*names, *places, row["exitance"], power])
