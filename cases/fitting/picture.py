"""``fit.png``: what detectors have read and what they read of the fit, and the differences."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tetlux.cases.file.case import Case
from tetlux.cases.file.channels import ALL
from tetlux.cases.fitting.record import FitRecord
from tetlux.cases.picture.readings import COLORS
from tetlux.fem.lights.arrows import HasArrows
from tetlux.fem.outcome.detectors import read
from tetlux.fem.outcome.exitance_field import Dark
from tetlux.meshing.arrays import FloatArray

FIT_COLOR = "#30343f"
MARKS = "osD^v"
# Values that are named in the picture.
MOST_LINES = 12


def draw_fit(record: FitRecord, path: Path) -> None:
    """Draw readings against the distance from their light, 1400 x 1100 pixels: colours of channels, marks of lights."""
    case = record.case
    figure = Figure(figsize=(11.2, 8.8), dpi=125, facecolor="white")
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.2))
    _draw_readings(record, above, below)
    above.plot([], [], "x", color=FIT_COLOR, markersize=8, label="fit")
    above.set_yscale("log")
    above.set_ylabel(f"exitance, W/{case.surface.unit}²")
    above.set_title(f"{case.name}: readings and fit", loc="left", fontsize=14)
    above.legend(frameon=False, fontsize=11, loc="upper right")
    above.text(0.02, 0.03, "\n".join(record.lines[:MOST_LINES]), transform=above.transAxes, fontsize=11)
    below.axhline(0.0, color=FIT_COLOR, linewidth=0.8)
    below.set_ylabel("measured less fit, %")
    below.set_xlabel(f"distance from the light, {case.surface.unit}")
    for axes in (above, below):
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(path)


def _draw_readings(record: FitRecord, above: Any, below: Any) -> None:
    """Draw readings and the fit above, and their differences below."""
    case, along = record.case, _distances(record.case)
    names = [entry.name for entry in case.detectors]
    groups = itertools.product(enumerate(case.channel_names), enumerate(case.light_names))
    for (channel, of_channel), (light, of_light) in groups:
        own = [row for row in record.rows if (row["channel"], row["light"]) == (of_channel, of_light)]
        if not own:
            continue
        places = along[light, [names.index(row["name"]) for row in own]]
        measured, fitted = (np.array([row[name] for row in own]) for name in ("measured", "fitted"))
        noise = np.array([row["noise"] or 0.0 for row in own])
        label = ", ".join([name for name in (of_channel, of_light) if name != ALL])
        style = {
            "fmt": MARKS[light % len(MARKS)],
            "color": COLORS[channel % len(COLORS)],
            "markersize": 5,
            "capsize": 3,
        }
        above.errorbar(places, measured, yerr=noise * measured, label=label, **style)
        above.plot(places, fitted, "x", color=FIT_COLOR, markersize=8)
        below.errorbar(places, 100.0 * (measured / fitted - 1.0), yerr=100.0 * noise, **style)


def _distances(case: Case) -> FloatArray:
    """Distance of each detector from the nearest place of each light, (l, d); its number where a light has no place."""
    dark = Dark(case.surface, case.medium)
    detectors = np.array([read(entry.detector, dark).position for entry in case.detectors])
    rows = []
    for light in case.channels[0].lights.values():
        places = light.arrows(case.surface).places if isinstance(light, HasArrows) else np.zeros((0, 3))
        if len(places):
            rows.append(np.linalg.norm(detectors[:, None] - places, axis=2).min(axis=1))
        else:
            rows.append(np.arange(1.0, len(detectors) + 1.0))
    return np.array(rows)
