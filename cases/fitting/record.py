"""`FitRecord`: what was fitted, as figures for ``fit.json``, ``fit.csv``, the summary and the terminal."""

import csv
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tetlux.cases.file.case import Case
from tetlux.cases.plain import finite
from tetlux.fem.inverse.parameters import AXES
from tetlux.fem.inverse.request import FitRequest
from tetlux.fem.inverse.result import FitResult
from tetlux.fem.inverse.unknowns import HAEMOGLOBIN, TissueUnknowns
from tetlux.fem.models.modulation import lag
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.notes import Note

# Readings that are farther from the fit than so many times their noise are reported.
MOST_MISFIT = 2.0
FIT_FILES = ("fit.json", "fit.csv", "fit.png")


@dataclass(frozen=True, eq=False)
class FitRecord:
    """A fit of a case.

    Attributes
    ----------
    case : Case
        As it was before the fit.
    found : FitResult
    """

    case: Case
    found: FitResult

    @property
    def request(self) -> FitRequest:
        """What was asked for."""
        assert self.case.fit is not None
        return self.case.fit

    @cached_property
    def values(self) -> dict[str, dict[str, float]]:
        """Value, error and start of each unknown, and of what follows from several."""
        found, start = self.found, self.request.unknowns.start.tolist()
        values = {
            name: {"value": value, "error": error, "start": begin}
            for (name, value), error, begin in zip(found.values.items(), found.errors.values(), start, strict=True)
        }
        return values | _haemoglobin(self.request, found)

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """What each detector has read, and what it reads of the fit."""
        case, request, rows = self.case, self.request, []
        for place in np.argwhere(np.isfinite(request.readings)).tolist():
            channel, light, detector = place
            measured, fitted = request.readings[tuple(place)], self.found.readings[tuple(place)]
            noise = float(request.noise[tuple(place)]) if request.noise_is_known else None
            difference = np.log(np.abs(fitted / measured))
            row = {
                "name": case.detectors[detector].name,
                "channel": case.channels[channel].name,
                "light": case.light_names[light],
                "measured": float(abs(measured)),
                "fitted": float(abs(fitted)),
                "noise": noise,
                "relative_difference": float(np.expm1(difference)),
            }
            if np.iscomplexobj(request.readings):
                row |= {
                    "measured_phase": float(lag(np.asarray(measured))),
                    "fitted_phase": float(lag(np.asarray(fitted))),
                }
            rows.append(row)
        return rows

    @property
    def warnings(self) -> list[str]:
        """What the readings do not tell, and whether they are farther from the fit than their noise."""
        notes: list[str] = [Note("undetermined", sentence) for sentence in self.found.undetermined]
        misfit = self.found.misfit
        if self.request.noise_is_known and misfit > MOST_MISFIT:
            text = (
                f"readings are {misfit:.2g} times their noise away from the fit: noise is given too small, or the "
                "body, lights or detectors are others; see fit.csv."
            )
            notes.append(Note("misfit", text, value=misfit))
        return notes

    @property
    def lines(self) -> list[str]:
        """The values with their errors, for the terminal."""
        unit = self.case.surface.unit
        units = {"sigma_a": f" 1/{unit}", "sigma_s_prime": f" 1/{unit}", "a": " 1/mm"}
        units |= dict.fromkeys(("hbo2", "hhb", "total_haemoglobin"), " mol/l") | dict.fromkeys(AXES, f" {unit}")
        return [
            f"{name}: {row['value']:.5g} ± {row['error']:.2g}{units.get(name.rpartition('.')[2], '')}"
            for name, row in self.values.items()
        ]

    def summary(self) -> dict[str, Any]:
        """What the summary of the run has of it."""
        return {
            "values": self.values,
            "misfit": finite(self.found.misfit),
            "undetermined": list(self.found.undetermined),
            "evaluations": self.found.evaluations,
        }

    def write(self, folder: Path) -> None:
        """Write the figures, a row for each reading, and the picture."""
        from tetlux.cases.fitting.picture import draw_fit  # noqa: PLC0415 - pictures take long to import

        data_name, rows_name, picture_name = FIT_FILES
        draw_fit(self, folder / picture_name)
        data = {
            **self.summary(),
            "names": list(self.found.values),
            "covariance": _plain(self.found.covariance),
            "correlation": _plain(self.found.correlation),
            "noise_given": self.request.noise_is_known,
            "mesh": {"nodes": len(self.found.mesh.points), "tetrahedra": len(self.found.mesh.tetrahedra)},
        }
        (folder / data_name).write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        unit = self.case.surface.unit
        of_columns = {"measured": f" [W/{unit}²]", "fitted": f" [W/{unit}²]"}
        of_columns |= {f"{name}_phase": " [degrees]" for name in of_columns}
        with (folder / rows_name).open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow([f"{name}{of_columns.get(name, '')}" for name in self.rows[0]])
            writer.writerows(["" if value is None else value for value in row.values()] for row in self.rows)

    __repr__ = one_line


def _haemoglobin(request: FitRequest, found: FitResult) -> dict[str, dict[str, float]]:
    """Oxygen saturation and all haemoglobin, mol/l, of parts in which some of it is unknown."""
    unknowns, found_rows = request.unknowns.of_media, {}
    if not isinstance(unknowns, TissueUnknowns):
        return {}
    values, rows = list(found.values.values()), request.unknowns.media_rows.tolist()
    for number, part in enumerate(unknowns.parts):
        places = zip(rows, unknowns.places, strict=True)
        columns = {quantity: row for row, (owner, quantity) in places if owner == number}
        if isinstance(part, tuple) or columns.keys().isdisjoint(HAEMOGLOBIN):
            continue
        name = next(name for name, place in zip(unknowns.names, unknowns.places, strict=True) if place[0] == number)
        prefix = name.rpartition(".")[0]
        oxygenated, other = (
            values[columns[kind]] if kind in columns else float(part.get(kind, 0.0)) for kind in HAEMOGLOBIN
        )
        total = oxygenated + other
        slopes = {
            "saturation": {"hbo2": other / total**2, "hhb": -oxygenated / total**2},
            "total_haemoglobin": {"hbo2": 1.0, "hhb": 1.0},
        }
        for quantity, value in (("saturation", oxygenated / total), ("total_haemoglobin", total)):
            slope = np.zeros(len(values))
            for kind, column in columns.items():
                slope[column] = slopes[quantity].get(kind, 0.0)
            error = math.sqrt(max(float(slope @ found.covariance @ slope), 0.0))
            begin = _at_start(part, quantity)
            found_rows[f"{prefix}.{quantity}" if prefix else quantity] = {
                "value": value,
                "error": error,
                "start": begin,
            }
    return found_rows


def _at_start(part: Mapping[str, Any], quantity: str) -> float:
    oxygenated, other = float(part.get("hbo2", 0.0)), float(part.get("hhb", 0.0))
    total = oxygenated + other
    return total if quantity == "total_haemoglobin" else oxygenated / total


def _plain(matrix: FloatArray) -> list[list[float | None]]:
    return [[finite(value) for value in row] for row in matrix.tolist()]
