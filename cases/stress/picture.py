"""The picture of the stress map: for each panel a map of each variant, coloured by error, with broken rules marked."""

import math
import re
import textwrap
from collections.abc import Sequence
from pathlib import Path

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke

from tetlux.cases.stress.panels import Axis, Panel, Value
from tetlux.cases.stress.rules import broken_rules, is_warned, violations
from tetlux.cases.stress.scenes.scenarios import TOLERANCE
from tetlux.cases.stress.trials import Trial

# Inches: width of the picture, size of a map, gap between maps, margins of a panel (left, right, above, below); then,
# for axes whose values are words, extra margins and the width of a map; height of the legend.
WIDTH, MAP, GAP, LEFT, RIGHT, ABOVE, BELOW = 17.0, (2.2, 1.75), 0.12, 0.85, 0.25, 0.85, 0.75
WORDS_LEFT, WORDS_BELOW, WORDS_MAP, LEGEND = 0.75, 0.45, 3.8, 1.8
# The colour map is centred at the tolerance and spans this many decades on either side.
DECADES = 1.5
COLOURS = colormaps["BrBG_r"]
Colour = str | tuple[float, float, float, float]
INK, REFUSED, FAILED, VIOLATION = "#30343f", "#d5d7db", "#22252c", "#e6004c"
NOTE = (
    "Colour: relative L2 error of the exitance over the surface, against a closed form; dotted cells have none and "
    "show the solver's own estimate. Values of all axes are drawn evenly spaced. A cross: fluence below -1e-12 of its "
    "maximum where the source has no first moment or above the maximum principle, a ledger off by 1e-9, a residual "
    "above 1e-8, figures that change with the unit of length, an error above the tolerance without a warning, or above "
    "the bound of charges. Readings: the error of the worst, a cross above the tolerance and twice its error bar."
)


def draw_map(trials: Sequence[Trial], path: Path) -> None:
    """Draw all panels.

    Parameters
    ----------
    trials : sequence of Trial
    path : Path
        The PNG to write.
    """
    panels = list({trial.panel.name: trial.panel for trial in trials}.values())
    rows = _rows(panels)
    heights = [max(map(_height, row)) for row in rows]
    height = sum(heights) + LEGEND
    figure = Figure(figsize=(WIDTH, height), dpi=125, facecolor="white")
    FigureCanvasAgg(figure)
    top = height
    for row, tall in zip(rows, heights, strict=True):
        left = 0.0
        for panel in row:
            _draw_panel(figure, panel, [trial for trial in trials if trial.panel.name == panel.name], left, top)
            left += _width(panel)
        top -= tall
    _draw_legend(figure, height)
    figure.savefig(path)


def _has_words(axis: Axis) -> bool:
    return any(isinstance(value, str) for value in axis.values)


def _width(panel: Panel) -> float:
    left = LEFT + WORDS_LEFT * _has_words(panel.y)
    return left + len(panel.variants) * (_map_width(panel) + GAP) + RIGHT


def _map_width(panel: Panel) -> float:
    return WORDS_MAP if _has_words(panel.x) else MAP[0]


def _height(panel: Panel) -> float:
    return ABOVE + MAP[1] + BELOW + WORDS_BELOW * _has_words(panel.x)


def _rows(panels: Sequence[Panel]) -> list[list[Panel]]:
    """Arrange panels in rows: each goes into the first row that has room for it."""
    rows: list[list[Panel]] = []
    for panel in panels:
        for row in rows:
            if sum(map(_width, row)) + _width(panel) <= WIDTH:
                row.append(panel)
                break
        else:
            rows.append([panel])
    return rows


def _draw_panel(figure: Figure, panel: Panel, trials: list[Trial], left: float, top: float) -> None:
    height = figure.get_figheight()
    start = left + LEFT + WORDS_LEFT * _has_words(panel.y)
    figure.text(
        (left + 0.2) / WIDTH, (top - 0.32) / height, panel.name, fontsize=15, fontweight="bold", color=INK, va="bottom"
    )
    description = _symbols(textwrap.shorten(panel.description, int(14.5 * (_width(panel) - 0.3))))
    figure.text((left + 0.2) / WIDTH, (top - 0.35) / height, description, fontsize=10.5, color=INK, va="top")
    for number, variant in enumerate(panel.variants):
        wide = _map_width(panel)
        x = start + number * (wide + GAP)
        axes = figure.add_axes((x / WIDTH, (top - ABOVE - MAP[1]) / height, wide / WIDTH, MAP[1] / height))
        axes.set_title(variant.name, fontsize=11, color=INK, pad=4, fontweight="bold" if variant.counts else None)
        axes.set(xlim=(0, len(panel.x.values)), ylim=(0, len(panel.y.values)))
        for trial in trials:
            if trial.variant.name == variant.name:
                _draw_cell(axes, trial)
        _label(axes, panel, first=number == 0)


def _label(axes: Axes, panel: Panel, *, first: bool) -> None:
    x, y = panel.x, panel.y
    axes.set_xticks([i + 0.5 for i in range(len(x.values))], [_text(value) for value in x.values])
    axes.set_yticks([i + 0.5 for i in range(len(y.values))], [_text(value) for value in y.values] if first else [])
    axes.set_xlabel(_symbols(x.name), fontsize=11, color=INK)
    axes.set_ylabel(_symbols(y.name) if first else "", fontsize=11, color=INK)
    axes.tick_params(length=0, labelsize=9.5, colors=INK)
    axes.spines[:].set_color("#9aa0aa")
    if _has_words(x):
        for label in axes.get_xticklabels():
            label.set(rotation=40, horizontalalignment="right", rotation_mode="anchor")


def _symbols(name: str) -> str:
    return re.sub(r"σ_(\w+)('?)", r"$\\sigma_{\1}\2$", name)


def _text(value: Value) -> str:
    """Format a value for the labels of an axis."""
    if isinstance(value, str):
        return _symbols(value)
    power = round(math.log10(abs(value))) if value else 0
    if abs(power) >= 3 and math.isclose(abs(value), 10.0**power):
        return f"$10^{{{power}}}$"
    return f"{value:g}".replace("-", "\N{MINUS SIGN}").replace("0.", ".") if abs(value) < 1 else f"{value:g}"


def _draw_cell(axes: Axes, trial: Trial) -> None:
    x, y = trial.panel.x.values.index(trial.x), trial.panel.y.values.index(trial.y)
    found = trial.diagnostics
    if found is None:
        failed = trial.outcome == "failed"
        _fill(axes, x, y, FAILED if failed else REFUSED, "" if failed else "/////", "#a4a8b0")
    else:
        value = found.estimate if found.error is None else found.error
        _fill(
            axes,
            x,
            y,
            FAILED if math.isnan(value) else COLOURS(_norm()(value)),
            "...." if found.error is None else "",
            "#ffffff",
        )
        if is_warned(found):
            axes.plot(x + 0.84, y + 0.8, "o", markersize=3.2, color="white", markeredgecolor=INK, markeredgewidth=0.7)
    if violations(trial):
        axes.add_patch(Rectangle((x + 0.04, y + 0.04), 0.92, 0.92, fill=False, edgecolor=VIOLATION, linewidth=1.6))
        _cross(axes, x, y, VIOLATION, 2.4)
    elif broken_rules(trial):
        _cross(axes, x, y, INK, 1.2)


def _fill(axes: Axes, x: float, y: float, face: Colour, hatch: str, lines: str) -> None:
    axes.add_patch(Rectangle((x, y), 1, 1, facecolor=face, hatch=hatch, edgecolor=lines, linewidth=0))
    axes.add_patch(Rectangle((x, y), 1, 1, fill=False, edgecolor="white", linewidth=0.8))


def _cross(axes: Axes, x: float, y: float, colour: str, width: float) -> None:
    (mark,) = axes.plot(x + 0.5, y + 0.5, "x", markersize=8, color=colour, markeredgewidth=width)
    mark.set_path_effects([withStroke(linewidth=width + 1.8, foreground="white")])


def _norm() -> LogNorm:
    return LogNorm(TOLERANCE / 10.0**DECADES, TOLERANCE * 10.0**DECADES, clip=True)


def _draw_legend(figure: Figure, height: float) -> None:
    """Draw the colour bar, the key of the marks, and the note."""
    from matplotlib.cm import ScalarMappable  # noqa: PLC0415

    bar = figure.add_axes((0.8 / WIDTH, 1.28 / height, 4.2 / WIDTH, 0.22 / height))
    colours = figure.colorbar(ScalarMappable(_norm(), COLOURS), cax=bar, orientation="horizontal", extend="both")
    ticks = [0.002, 0.01, TOLERANCE, 0.2, 1.0]
    colours.set_ticks(ticks, labels=[f"{100.0 * tick:g} %" + "\n(tolerance)" * (tick == TOLERANCE) for tick in ticks])
    colours.ax.minorticks_off()
    bar.tick_params(labelsize=10.5, colors=INK)
    bar.set_title("relative error of the exitance", fontsize=11, color=INK, pad=4)
    _draw_marks(figure.add_axes((5.7 / WIDTH, 1.05 / height, 11.0 / WIDTH, 0.5 / height)))
    figure.text(0.8 / WIDTH, 0.12 / height, "\n".join(textwrap.wrap(NOTE, 205)), fontsize=10.5, color=INK, va="bottom")


def _draw_marks(marks: Axes) -> None:
    """Draw the key of the marks."""
    marks.set(xlim=(0, 22), ylim=(0, 1))
    marks.axis("off")
    cell = COLOURS(0.3)
    for x, face, hatch, text in (
        (0.0, cell, "", "violation"),
        (4.0, cell, "", "broken, not counted"),
        (9.2, cell, "", "warns of its error"),
        (14.0, REFUSED, "/////", "refused as bad input"),
        (19.3, FAILED, "", "failed"),
    ):
        _fill(marks, x, 0.0, face, hatch, "#a4a8b0")
        marks.text(x + 1.2, 0.5, text, fontsize=11.5, va="center", color=INK)
    marks.add_patch(Rectangle((0.04, 0.04), 0.92, 0.92, fill=False, edgecolor=VIOLATION, linewidth=1.6))
    _cross(marks, 0.0, 0.0, VIOLATION, 2.4)
    _cross(marks, 4.0, 0.0, INK, 1.2)
    marks.plot(9.2 + 0.84, 0.8, "o", markersize=3.2, color="white", markeredgecolor=INK, markeredgewidth=0.7)
