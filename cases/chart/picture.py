"""The picture of a chart: a row for each case, of error against seconds, and both against unknowns."""

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
from tetlux.cases.chart.models import MONTE_CARLO
from tetlux.cases.chart.runs import Charted, Measurement, exponents

INK, FAINT, FRONT = "#30343f", "#8a8f99", "#ffd166"
# Inches: the picture's width, a row's height and what of it is above and below the panels, and where these begin and
# how wide they are. The last one is the key.
WIDTH, ROW, ABOVE, BELOW = 16.0, 4.7, 0.6, 0.7
PANELS = ((1.1, 3.7), (5.9, 2.4), (9.05, 2.4), (11.7, 4.2))
WIDEST = 150  # characters of a line of notes
# Columns of the key by their places: what their exponents are of, and their heads.
KEY_COLUMNS = {0.89: ("error", "p"), 1.0: ("seconds", "q")}
NOTE = (
    "Seconds: from the surface in memory to the exitance at the surface, meshing included, with nothing cached. "
    "Error: relative L2 over the surface (of a slab with a closed form, both faces away from the rim). "
    "NGSolve is given the exact shape, all others its triangles. "
    "p, q: error ~ unknowns^p, seconds ~ unknowns^q, by least squares over the runs shown."
)
NOTE_OF_MONTE_CARLO = (
    "Monte Carlo solves radiative transfer from the same sources: what is shown is the difference between that and "
    "diffusion, an error of neither."
)
NOTE_OF_FINER_RUN = (
    "Dashed: the estimated error of a reference that is itself a finer run; errors near it or below mean little."
)


class Look(NamedTuple):
    """How a method is drawn."""

    color: str
    marker: str
    line: str = "-"
    width: float = 1.5
    size: float = 7.5


LOOKS = {
    OURS: Look("#d1203f", "o", width=3.0, size=9.5),
    "half-space subtracted, uniform": Look("#ef8a2c", "s"),
    "free-space subtracted, adaptive": Look("#b8860b", "D"),
    "P1, adaptive": Look("#12355b", "^"),
    "P1, graded": Look("#3d7ebf", "v"),
    "P1, uniform": Look("#8fbbe0", "<"),
    "NGSolve P1": Look("#8fd18a", "P", size=9.0),
    "NGSolve P2": Look("#4caf50", "P", size=9.0),
    "NGSolve P3": Look("#1b5e20", "P", size=9.0),
    "redbirdpy P1": Look("#8e44ad", "X", size=9.0),
    "dipole alone": Look("#6d4c41", "*", "", size=14.0),
    "half-space alone": Look("#ef8a2c", "*", "", size=14.0),
    MONTE_CARLO.name: Look(FAINT, "x", ":"),
}


def draw_chart(charted: Sequence[Charted], path: Path) -> None:
    """Draw all cases.

    Parameters
    ----------
    charted : sequence of Charted
    path : Path
        Where the PNG goes, 2000 pixels wide.
    """
    lines = _notes(charted)
    foot = 0.35 + 0.25 * len(lines)
    rows = len(charted)
    height = ROW * rows + foot
    figure = Figure(figsize=(WIDTH, height), dpi=125, facecolor="white")
    FigureCanvasAgg(figure)
    for row, one in enumerate(charted):
        bottom = foot + ROW * (rows - 1 - row) + BELOW
        left, middle, right, key = (
            figure.add_axes((x / WIDTH, bottom / height, width / WIDTH, (ROW - BELOW - ABOVE) / height))
            for x, width in PANELS
        )
        _draw_runs(one.runs, left, middle, right)
        _draw_reference(one.benchmark, left, middle)
        _draw_key(one.runs, key)
    figure.text(
        PANELS[0][0] / WIDTH, 0.2 / height, "\n".join(lines), fontsize=12.5, color=INK, va="bottom", linespacing=1.3
    )
    figure.savefig(path)


def _notes(charted: Sequence[Charted]) -> list[str]:
    """What is to be read with the picture, in lines."""
    lines = textwrap.wrap(NOTE, WIDEST)
    if any(run.method == MONTE_CARLO.name for one in charted for run in one.runs):
        lines += textwrap.wrap(NOTE_OF_MONTE_CARLO, WIDEST)
    if any(one.benchmark.reference.error > 0 for one in charted):
        lines += textwrap.wrap(NOTE_OF_FINER_RUN, WIDEST)
    return lines


def _draw_reference(benchmark: Benchmark, left: Axes, middle: Axes) -> None:
    """Title a row with its case and reference, and draw the reference's own error."""
    reference = benchmark.reference
    for axes in (left, middle):
        # Below this line the reference is no better than what is measured against it.
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


def _draw_runs(runs: Sequence[Measurement], left: Axes, middle: Axes, right: Axes) -> None:
    """Error over seconds, error over unknowns, seconds over unknowns."""
    _draw_front(runs, left)
    for name, look in LOOKS.items():
        mine = [run for run in runs if run.method == name]
        sized = [run for run in mine if run.unknowns is not None]
        unknowns = [float(run.unknowns or 0) for run in sized]
        _line(left, look, [run.seconds for run in mine], [run.error for run in mine])
        _line(middle, look, unknowns, [run.error for run in sized])
        _line(right, look, unknowns, [run.seconds for run in sized])
    error = "relative L2 error of exitance"
    for axes, below, beside in ((left, "seconds", error), (middle, "unknowns", error), (right, "unknowns", "seconds")):
        _style(axes, below, beside)


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


def _style(axes: Axes, below: str, beside: str) -> None:
    """Logarithmic axes with their labels."""
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel(below, fontsize=14, color=INK)
    axes.set_ylabel(beside, fontsize=14, color=INK)
    _tick(axes.xaxis, axes.get_xlim(), below)
    _tick(axes.yaxis, axes.get_ylim(), beside)
    axes.tick_params(which="both", labelsize=13, colors=INK)
    axes.grid(which="major", alpha=0.35)
    axes.grid(which="minor", alpha=0.12)
    axes.spines[["top", "right"]].set_visible(False)


def _line(axes: Axes, look: Look, x: list[float], y: list[float]) -> None:
    axes.plot(
        x,
        y,
        color=look.color,
        marker=look.marker,
        linestyle=look.line,
        linewidth=look.width,
        markersize=look.size,
        markeredgecolor=look.color if look.marker == "x" else "white",
        markeredgewidth=1.2 if look.marker == "x" else 0.6,
        zorder=look.width + 2.0,
    )


def _tick(axis: Axis, limits: tuple[float, float], quantity: str) -> None:
    """Label powers of ten, and values between them where an axis spans fewer than two."""
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
    """Methods with their exponents, in columns."""
    fitted = exponents(runs)
    shown = [name for name in LOOKS if name in fitted]
    axes.set(xlim=(0.0, 1.0), ylim=(len(LOOKS), -1.0))
    axes.axis("off")
    for x, (quantity, head) in KEY_COLUMNS.items():
        if any(fitted[name][quantity] is not None for name in shown):
            axes.text(x, -1.0, head, fontsize=13, style="italic", ha="right", va="center", color=INK)
    for y, name in enumerate(shown):
        _draw_key_of(name, fitted[name], y, axes)
    axes.plot([0.0, 0.08], [len(shown)] * 2, color=FRONT, linewidth=8.0, solid_capstyle="round", clip_on=False)
    axes.text(0.12, len(shown), "not beaten (Pareto front)", fontsize=12, va="center", color=INK)


def _draw_key_of(name: str, fitted: dict[str, float | None], y: float, axes: Axes) -> None:
    look = LOOKS[name]
    _line(axes, look._replace(marker="", size=0.0), [0.0, 0.08], [y, y])
    _line(axes, look, [0.04], [y])
    axes.text(0.12, y, name, fontsize=12, va="center", color=INK, fontweight="bold" if name == OURS else None)
    for x, (quantity, _) in KEY_COLUMNS.items():
        exponent = fitted[quantity]
        if exponent is not None:
            text = f"{exponent:.1f}".replace("-", "\N{MINUS SIGN}")
            axes.text(x, y, text, fontsize=12, ha="right", va="center", color=INK)
