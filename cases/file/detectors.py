"""Detectors of a case: built from the case file, read, and written as ``detectors.csv``."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tetlux.cases.file.channels import ALL
from tetlux.cases.file.schema.detectors import DetectorSpec
from tetlux.cases.plain import finite
from tetlux.fem.media.medium import Medium
from tetlux.fem.models.modulation import lag
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.detectors import read, read_all
from tetlux.fem.outcome.exitance_field import Dark, ExitanceField
from tetlux.meshing.describe import percent
from tetlux.meshing.surface.surface import Surface

# Columns of errors of a reading, relative.
ERRORS = ("relative_error", "model_error")
# Readings that are printed at the end of a run.
MOST_LINES = 20


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
    detector = spec.detector()
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
        A row for each detector and solution: ``name, kind, channel, light, position`` (unit), ``exitance`` (W/unit²),
        ``power`` (W; None for a point), ``relative_error`` and ``model_error`` (None where they are not known). Of
        modulated light these are amplitudes, and there is a ``phase``, how far they lag (degrees).
    """
    rows = []
    plain = [entry.detector for entry in detectors]
    by_solution = [read_all(plain, solution) for _, _, solution in solutions]
    for number, entry in enumerate(detectors):
        for (channel, light, _), readings in zip(solutions, by_solution, strict=True):
            reading = readings[number]
            modulated = isinstance(reading.exitance, complex)
            rows.append(
                {
                    "name": entry.name,
                    "kind": entry.kind,
                    "channel": channel,
                    "light": light,
                    "position": list(reading.position),
                    "exitance": abs(reading.exitance) if modulated else reading.exitance,
                    "power": abs(reading.power) if modulated and reading.power is not None else reading.power,
                    **({"phase": float(lag(np.asarray(reading.exitance)))} if modulated else {}),
                    "relative_error": finite(reading.relative_error),
                    "model_error": finite(reading.model_error),
                }
            )
    return rows


def describe_readings(rows: Sequence[dict[str, Any]], unit: str) -> list[str]:
    """Lines on what is read of all lights together, for the terminal."""
    whole = [row for row in rows if row["light"] == ALL]
    several = len({row["channel"] for row in whole}) > 1
    lines = []
    for row in whole[:MOST_LINES]:
        value, what = (row["exitance"], f"W/{unit}²") if row["power"] is None else (row["power"], "W")
        name = f"{row['name']}, {row['channel']}" if several else row["name"]
        error = "" if row["relative_error"] is None else f" ± {percent(row['relative_error'])}"
        model = "" if row["model_error"] is None else f" (diffusion itself: ± {percent(row['model_error'])})"
        phase = f", {row['phase']:.4g}° behind" if "phase" in row else ""
        lines.append(f"{name}: {value:.5g} {what}{error}{phase}{model}")
    if len(whole) > MOST_LINES:
        lines.append(f"and {len(whole) - MOST_LINES} more readings")
    return lines


def write_readings(rows: Sequence[dict[str, Any]], unit: str, path: Path) -> None:
    """Write readings as CSV, with units in the header."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        axes = [f"{axis} [{unit}]" for axis in "xyz"]
        of_phase = ["phase [degrees]"] if any("phase" in row for row in rows) else []
        quantities = [f"exitance [W/{unit}²]", "power [W]", *of_phase]
        writer.writerow(["name", "kind", "channel", "light", *axes, *quantities, *ERRORS])
        for row in rows:
            power = "" if row["power"] is None else repr(row["power"])
            names = [row[key] for key in ("name", "kind", "channel", "light")]
            places = [f"{value:.9g}" for value in row["position"]]
            errors = ["" if row[key] is None else f"{row[key]:.3g}" for key in ERRORS]
            phase = [f"{row['phase']:.9g}" if "phase" in row else ""] if of_phase else []
            writer.writerow([*names, *places, row["exitance"], power, *phase, *errors])
