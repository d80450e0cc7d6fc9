"""The picture of readings: exitance against distance from the light, with error bars."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tetlux.meshing.arrays import FloatArray

COLORS = ("#d1495b", "#2e86ab", "#3a7d44", "#edae49", "#6d597a", "#30343f")
RGB = {"red": "#d1495b", "green": "#3a7d44", "blue": "#2e86ab"}
# An error bar reaches down to this share of the reading at least, so that it can be drawn on a logarithmic scale.
LEAST = 0.01


def draw_readings(rows: Sequence[dict[str, Any]], lit: FloatArray, title: str, unit: str, path: Path) -> None:
    """Draw what detectors read, a colour for each channel.

    Parameters
    ----------
    rows : sequence of dict
        As `tetlux.cases.file.detectors.read_detectors` returns them, of all lights together.
    lit : (p, 3) ndarray
        Where the lights meet the body. If there are no such places, readings are drawn in the detectors' order.
    title, unit : str
    path : Path
        Where the PNG goes, 1400 x 900 pixels.
    """
    figure = Figure(figsize=(11.2, 7.2), dpi=125, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    names = list(dict.fromkeys(row["channel"] for row in rows))
    for number, channel in enumerate(names):
        own = [row for row in rows if row["channel"] == channel]
        values = np.array([row["exitance"] for row in own])
        errors = np.array([row["relative_error"] or 0.0 for row in own]) * np.abs(values)
        lower = np.minimum(errors, (1.0 - LEAST) * np.abs(values))
        bright = values > 0
        axes.errorbar(
            _along(own, lit)[bright],
            values[bright],
            yerr=(lower[bright], errors[bright]),
            fmt="o",
            color=RGB.get(channel, COLORS[number % len(COLORS)]),
            markersize=4,
            capsize=3,
            label=None if len(names) == 1 else channel,
        )
    if len(names) > 1:
        axes.legend(frameon=False, fontsize=11)
    axes.set_yscale("log")
    axes.set_xlabel(f"distance from the nearest light, {unit}" if len(lit) else "detector")
    axes.set_ylabel(f"exitance, W/{unit}²")
    axes.set_title(f"{title}: readings with their numerical errors", loc="left", fontsize=14)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(path)


def _along(rows: Sequence[dict[str, Any]], lit: FloatArray) -> FloatArray:
    """Distances of the detectors from the nearest light, or their numbers."""
    if len(lit) == 0:
        return np.arange(1.0, len(rows) + 1.0)
    places = np.array([row["position"] for row in rows])
    return np.asarray(np.linalg.norm(places[:, None] - lit, axis=2).min(axis=1))
