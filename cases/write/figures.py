"""Figures for papers: exitance against distance from the light, and where the power went; as SVG, PDF and PNG."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tetlux.cases.write.results import Results
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.triangles import triangle_areas

NAMES = ("figures.svg", "figures.pdf", "figures.png")
COLOURS = ("#30343f", "#d1495b", "#2e86ab", "#3a7d44", "#edae49", "#6d597a")
OF_CHANNELS = {"red": "#d1495b", "green": "#3a7d44", "blue": "#2e86ab"}
PARTS = ("exited", "absorbed", "specular", "ballistic")
# Rings around the light over which the exitance is averaged, and the share of the largest mean that is drawn.
RINGS, FLOOR = 40, 1e-8
SIZE = (7.0, 3.0)
# Of the PNG, pixels an inch.
SHARPNESS = 300
# Text stays text, so that it can be searched and set in other fonts; the same run gives the same file.
STYLE: Any = {"svg.fonttype": "none", "pdf.fonttype": 42, "svg.hashsalt": "tetlux", "font.size": 8}


def write_figures(results: Results, lit: FloatArray, folder: Path) -> None:
    """Draw the figures of a run.

    Parameters
    ----------
    results : Results
    lit : (p, 3) ndarray
        Where the lights meet the body, or shine from; without any, distance is that from the brightest place.
    folder : Path
        Where ``figures.svg``, ``figures.pdf`` and ``figures.png`` go.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=SIZE, layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, width_ratios=(3, 2))
        _draw_exitance(left, results, lit)
        _draw_power(right, results)
        for axes in (left, right):
            axes.spines[["top", "right"]].set_visible(False)
        figure.savefig(folder / NAMES[0], metadata={"Date": None})
        figure.savefig(folder / NAMES[1], metadata={"CreationDate": None})
        figure.savefig(folder / NAMES[2], dpi=SHARPNESS)


def exitance_by_distance(results: Results, lit: FloatArray) -> tuple[FloatArray, Mapping[str, FloatArray]]:
    """Mean exitance of each channel in rings around the light.

    Returns
    -------
    distances : (r,) ndarray
        Mean distance of the surface in each ring from the nearest place that is lit, unit.
    means : mapping of str to (r,) ndarray
        Mean exitance by area, W/unit².
    """
    points, faces = results.surface.points, results.surface.faces
    places = lit if len(lit) else points[[int(np.nanargmax(results.shown()))]]
    areas = triangle_areas(points, faces)[1]
    middles = points[faces].mean(axis=1)
    away = np.min([np.linalg.norm(middles - place, axis=1) for place in places], axis=0)
    ring = np.minimum((RINGS * away / (away.max() * (1 + 1e-12))).astype(int), RINGS - 1)
    whole = np.bincount(ring, areas, RINGS)
    some = whole > 0
    distances = (np.bincount(ring, areas * away, RINGS)[some]) / whole[some]
    means = {
        name: np.bincount(ring, areas * results.exitance(name)[faces].mean(axis=1), RINGS)[some] / whole[some]
        for name in results.case.channel_names
    }
    return distances, means


def _draw_exitance(axes: Axes, results: Results, lit: FloatArray) -> None:
    unit = results.case.surface.unit
    distances, means = exitance_by_distance(results, lit)
    for number, (name, values) in enumerate(means.items()):
        colour = OF_CHANNELS.get(name, COLOURS[number % len(COLOURS)])
        axes.plot(distances, np.where(values > 0, values, np.nan), ".-", color=colour, linewidth=1, label=name)
    most = max(float(np.nanmax(values)) for values in means.values())
    if most > 0:
        axes.set_yscale("log")
        bottom = max(FLOOR * most, 0.5 * min(float(v[v > 0].min(initial=most)) for v in means.values()))
        axes.set_ylim(bottom=bottom)
        # No empty space beyond the last ring that is drawn.
        axes.set_xlim(0, 1.05 * distances[np.max([values >= bottom for values in means.values()], axis=0)].max())
    axes.set_xlabel(f"distance from the {'light' if len(lit) else 'brightest place'}, {unit}")
    axes.set_ylabel(f"mean exitance, W/{unit}²")
    if len(means) > 1:
        axes.legend(frameon=False)


def _draw_power(axes: Axes, results: Results) -> None:
    """Bars of the shares of the incident power, a group for each channel."""
    names = results.case.channel_names
    height = 0.8 / len(names)
    for number, (name, solution) in enumerate(zip(names, results.solutions, strict=True)):
        power = solution.power
        shares = [100 * abs(getattr(power, part)) / (abs(power.incident) or 1.0) for part in PARTS]
        colour = OF_CHANNELS.get(name, COLOURS[number % len(COLOURS)])
        places = np.arange(len(PARTS)) + (number - 0.5 * (len(names) - 1)) * height
        axes.barh(places, shares, height, color=colour)
        if len(names) == 1:
            for place, share in zip(places, shares, strict=True):
                axes.text(share + 1, float(place), f"{share:.3g} %", va="center")
    axes.set_yticks(range(len(PARTS)), PARTS)
    axes.invert_yaxis()
    axes.set_xlim(0, 118 if len(names) == 1 else 100)
    axes.set_xlabel("share of the incident power, %")
