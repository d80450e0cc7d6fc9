"""The picture of a chart: for each case a row of error over seconds, error over unknowns, seconds over unknowns."""

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from tetlux.cases.chart.benchmark import Benchmark
from tetlux.cases.chart.finite_elements import OURS
from tetlux.cases.chart.meshless import MONTE_CARLO
from tetlux.cases.chart.planned import PLANNED
from tetlux.cases.chart.runs import MeasuredBenchmark, Measurement, exponents

INK, FAINT, FRONT = "#30343f", "#8a8f99", "#ffd166"
# Inches: width of the picture, height of a row, margins above and below its panels; left edge and width of each panel,
# the last of which is the key.
WIDTH, ROW, ABOVE, BELOW = 16.0, 4.7, 0.6, 0.7
PANELS = ((1.1, 3.7), (5.9, 2.4), (9.05, 2.4), (11.7, 4.2))
WIDEST = 150  # most characters in a line of notes
# Columns of the key, by position: the quantity whose exponent is shown, and the heading.
KEY_COLUMNS = {0.89: ("error", "p"), 1.0: ("seconds", "q")}
OF_EXITANCE = (
    "Seconds: from the surface in memory to the exitance at the surface, meshing included, with nothing cached. "
    "Error: relative L2 over the surface (of a slab with a closed form, both faces away from the rim). "
)
OF_READINGS = (
    "Seconds: from the surface in memory to the readings, meshing included, with nothing cached. "
    "Error: of each detector's reading, relative; the median over the detectors. "
)
NOTE = (
    "NGSolve is given the exact shape, all others its triangles. "
    "p, q: error ~ unknowns^p, seconds ~ unknowns^q, by least squares over the runs shown."
)
NOTE_OF_MONTE_CARLO = (
    "Monte Carlo solves radiative transfer from the same sources; its value is the difference between the two models, "
    "not an error."
)
NOTE_OF_FINER_RUN = (
    "Dashed: the estimated error of a reference that is a finer run; errors near or below it are not reliable."
)


# Smaller errors, as of an exact series that the plan chose, are drawn at this one.
LEAST_ERROR = 1e-5
NOTE_OF_PLAN = (
    f'"{PLANNED.name}": model="auto", planning in its seconds. Where it takes the series that is the reference, its '
    f"error is rounding, and drawn at {100.0 * LEAST_ERROR:g} %; it is not part of the front."
)


class Style(NamedTuple):
    """How a method is drawn."""

    color: str
    marker: str
    line: str = "-"
    width: float = 1.5
    size: float = 7.5


STYLES = {
    OURS: Style("#d1203f", "o", width=3.0, size=9.5),
    PLANNED.name: Style("#111111", "d", "--", width=2.2, size=8.5),
    "charges": Style("#f06292", "p", width=2.2, size=9.0),
    "half-space subtracted, adaptive": Style("#ef8a2c", "h"),
    "half-space subtracted, uniform": Style("#ef8a2c", "s"),
    "free-space subtracted, adaptive": Style("#b8860b", "D"),
    "P1, adaptive": Style("#12355b", "^"),
    "P1, graded": Style("#3d7ebf", "v"),
    "P1, uniform": Style("#8fbbe0", "<"),
    "NGSolve P1": Style("#8fd18a", "P", size=9.0),
    "NGSolve P2": Style("#4caf50", "P", size=9.0),
    "NGSolve P3": Style("#1b5e20", "P", size=9.0),
    "redbirdpy P1": Style("#8e44ad", "X", size=9.0),
    "dipole alone": Style("#6d4c41", "*", "", size=14.0),
    "half-space alone": Style("#ef8a2c", "*", "", size=14.0),
    MONTE_CARLO.name: Style(FAINT, "x", ":"),
}


def draw_chart(measured: Sequence[MeasuredBenchmark], path: Path) -> None:
    """Draw all cases.

    Parameters
    ----------
    measured : sequence of MeasuredBenchmark
    path : Path
        The PNG to write, 2000 pixels wide.
    """
    lines = _notes(measured)
    foot = 0.35 + 0.25 * len(lines)
    rows = len(measured)
    height = ROW * rows + foot
    figure = Figure(figsize=(WIDTH, height), dpi=125, facecolor="white")
    FigureCanvasAgg(figure)
    for row, entry in enumerate(measured):
        bottom = foot + ROW * (rows - 1 - row) + BELOW
        left, middle, right, key = (
            figure.add_axes((x / WIDTH, bottom / height, width / WIDTH, (ROW - BELOW - ABOVE) / height))
            for x, width in PANELS
        )
        _draw_runs(entry.runs, entry.benchmark.quantity, left, middle, right)
        _draw_reference(entry.benchmark, left, middle)
        _draw_key(entry.runs, key)
    figure.text(
        PANELS[0][0] / WIDTH, 0.2 / height, "\n".join(lines), fontsize=12.5, color=INK, va="bottom", linespacing=1.3
    )
    figure.savefig(path)


def _notes(measured: Sequence[MeasuredBenchmark]) -> list[str]:
    """The lines of the notes below the picture."""
    read = any(entry.benchmark.detectors for entry in measured)
    lines = textwrap.wrap((OF_READINGS if read else OF_EXITANCE) + NOTE, WIDEST)
    if any(run.method == PLANNED.name for entry in measured for run in entry.runs):
        lines += textwrap.wrap(NOTE_OF_PLAN, WIDEST)
    if any(run.method == MONTE_CARLO.name for entry in measured for run in entry.runs):
        lines += textwrap.wrap(NOTE_OF_MONTE_CARLO, WIDEST)
    if any(entry.benchmark.reference.error > 0 for entry in measured):
        lines += textwrap.wrap(NOTE_OF_FINER_RUN, WIDEST)
    return lines


def _draw_reference(benchmark: Benchmark, left: Axes, middle: Axes) -> None:
    """Write the case and its reference above a row, and draw the error of the reference."""
    reference = benchmark.reference
    for axes in (left, middle):
        # Below this line the reference is no more accurate than the runs.
        low, high = axes.get_ylim()
        if low < reference.error < high:
            axes.axhline(reference.error, color=INK, linestyle="--", linewidth=1.2, zorder=1.5)
    name = left.annotate(
        benchmark.case.name, (0.0, 1.06), xycoords="axes fraction", fontsize=18, fontweight="bold", color=INK
    )
    left.annotate(
        f"reference: {reference.description}",
        (1.0, 0.0),
        (16.0, 0.0),
        xycoords=name,
        textcoords="offset points",
        va="bottom",
        fontsize=13,
        color=INK,
    )


def _draw_runs(runs: Sequence[Measurement], error: str, left: Axes, middle: Axes, right: Axes) -> None:
    """Error over seconds, error over unknowns, seconds over unknowns; `error` says which error it is."""
    _draw_front(runs, left)
    for name, style in STYLES.items():
        mine = [run for run in runs if run.method == name]
        sized = [run for run in mine if run.unknowns is not None]
        unknowns = [float(run.unknowns or 0) for run in sized]
        _plot_line(left, style, [run.seconds for run in mine], [max(run.error, LEAST_ERROR) for run in mine])
        _plot_line(middle, style, unknowns, [max(run.error, LEAST_ERROR) for run in sized])
        _plot_line(right, style, unknowns, [run.seconds for run in sized])
    for axes, below, beside in ((left, "seconds", error), (middle, "unknowns", error), (right, "unknowns", "seconds")):
        _format_axes(axes, below, beside)


def _draw_front(runs: Sequence[Measurement], axes: Axes) -> None:
    front = sorted((run for run in runs if run.on_front), key=lambda run: run.seconds)
    axes.step(
        [run.seconds for run in front],
        [run.error for run in front],
        where="post",
        color=FRONT,
        linewidth=8.0,
        solid_capstyle="round",
        solid_joinstyle="round",
        zorder=1,
    )


def _format_axes(axes: Axes, below: str, beside: str) -> None:
    """Make axes logarithmic and label them."""
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel(below, fontsize=14, color=INK)
    axes.set_ylabel(beside, fontsize=14, color=INK)
    _tick(axes.xaxis, axes.get_xlim(), below)
    _tick(axes.yaxis, axes.get_ylim(), beside)
    axes.tick_params(which="both", labelsize=13, colors=INK)
    axes.grid(which="major", alpha=0.35)
    axes.grid(which="minor", alpha=0.12)
    axes.spines[["top", "right"]].set_visible(False)


def _plot_line(axes: Axes, style: Style, x: list[float], y: list[float]) -> None:
    axes.plot(
        x,
        y,
        color=style.color,
        marker=style.marker,
        linestyle=style.line,
        linewidth=style.width,
        markersize=style.size,
        markeredgecolor=style.color if style.marker == "x" else "white",
        markeredgewidth=1.2 if style.marker == "x" else 0.6,
        zorder=style.width + 2.0,
    )


def _tick(axis: Axis, limits: tuple[float, float], quantity: str) -> None:
    """Label powers of ten, and values between them if an axis spans fewer than two decades."""
    decades = math.log10(limits[1] / limits[0])
    between = (1.0, 2.0, 5.0) if decades < 1.0 else (1.0, 3.0) if decades < 2.0 else (1.0,)
    axis.set_major_locator(LogLocator(subs=between, numticks=12))
    axis.set_minor_locator(LogLocator(subs=tuple(range(2, 10)), numticks=120))
    axis.set_minor_formatter(NullFormatter())

    def text(value: float, _: float) -> str:
        if "error" in quantity:
            return f"{100.0 * value:g} %"
        return f"{value / 1000.0:g}k" if value >= 1000.0 else f"{value:g}"

    axis.set_major_formatter(FuncFormatter(text))


def _draw_key(runs: Sequence[Measurement], axes: Axes) -> None:
    """Draw the key: methods, and their exponents in columns."""
    fitted = exponents(runs)
    shown = [name for name in STYLES if name in fitted]
    axes.set(xlim=(0.0, 1.0), ylim=(len(STYLES), -1.0))
    axes.axis("off")
    for x, (quantity, head) in KEY_COLUMNS.items():
        if any(fitted[name][quantity] is not None for name in shown):
            axes.text(x, -1.0, head, fontsize=13, style="italic", ha="right", va="center", color=INK)
    for y, name in enumerate(shown):
        _draw_key_of(name, fitted[name], y, axes)
    axes.plot([0.0, 0.08], [len(shown)] * 2, color=FRONT, linewidth=8.0, solid_capstyle="round", clip_on=False)
    axes.text(0.12, len(shown), "Pareto front", fontsize=12, va="center", color=INK)


def _draw_key_of(name: str, fitted: dict[str, float | None], y: float, axes: Axes) -> None:
    style = STYLES[name]
    _plot_line(axes, style._replace(marker="", size=0.0), [0.0, 0.08], [y, y])
    _plot_line(axes, style, [0.04], [y])
    axes.text(0.12, y, name, fontsize=12, va="center", color=INK, fontweight="bold" if name == OURS else None)
    for x, (quantity, _) in KEY_COLUMNS.items():
        exponent = fitted[quantity]
        if exponent is not None:
            text = f"{exponent:.1f}".replace("-", "\N{MINUS SIGN}")
            axes.text(x, y, text, fontsize=12, ha="right", va="center", color=INK)
