"""The picture of a comparison: exitance over distance or angle, and relative differences below it."""

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tetlux.cases.compare.differences import FLOOR, MEANINGS, ComparisonResult, bright_enough

COLORS = {"robin": "#d1495b", "series": "#d1495b", "images": "#2e86ab", "dipole": "#3a7d44"}
DOTS = "#30343f"


def draw_comparison(result: ComparisonResult, title: str, unit: str, path: Path) -> None:
    """Draw finite elements as points, closed forms as lines, and their differences in per cent.

    Parameters
    ----------
    result : ComparisonResult
    title, unit : str
    path : Path
        The PNG to write, 1400 x 1200 pixels.
    """
    figure = Figure(figsize=(11.2, 9.6), dpi=125, facecolor="white")
    FigureCanvasAgg(figure)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _draw_exitance(result, upper)
    _draw_differences(result, lower)
    upper.set_ylabel(f"exitance, W/{unit}²")
    upper.set_title(title, loc="left", fontsize=14)
    lower.set_xlabel(result.coordinate if "," in result.coordinate else f"{result.coordinate}, {unit}")
    for axes in (upper, lower):
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    lines = [f"{name}: {MEANINGS[name]}." for name in result.forms] + [result.note]
    note = "\n".join("\n".join(textwrap.wrap(line, 130)) for line in lines)
    figure.text(0.08, 0.02, note, fontsize=9.5, color="#444444", va="bottom", linespacing=1.35)
    figure.subplots_adjust(left=0.08, right=0.97, top=0.94, bottom=0.08 + 0.021 * (note.count("\n") + 1), hspace=0.08)
    figure.savefig(path)


def _draw_exitance(result: ComparisonResult, axes: Axes) -> None:
    axes.plot(result.along, result.exitance, ".", color=DOTS, markersize=3, label="finite elements", zorder=1)
    for name, truth in result.forms.items():
        axes.plot(
            result.along,
            truth,
            color=COLORS[name],
            linestyle="-" if result.single_valued else "",
            linewidth=1.6,
            marker="" if result.single_valued else ".",
            markersize=1.5,
            label=f"{name}: L2 difference {result.differences[name]['l2'] * 100:.2g} %",
        )
    axes.set_yscale("log")
    largest = max(float(truth.max()) for truth in result.forms.values())
    axes.set_ylim(bottom=max(FLOOR * largest, 0.3 * float(np.abs(result.exitance).min())))
    axes.legend(frameon=False, fontsize=11)


def _draw_differences(result: ComparisonResult, axes: Axes) -> None:
    for name, truth in result.forms.items():
        counted = bright_enough(truth)
        relative = 100.0 * (result.exitance[counted] / truth[counted] - 1.0)
        axes.plot(result.along[counted], relative, ".", color=COLORS[name], markersize=3)
    axes.axhline(0.0, color=DOTS, linewidth=0.8)
    axes.set_ylabel("finite elements minus closed form, %")
