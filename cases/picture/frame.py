"""The frame of a picture: title, colour bar, scale bar, axes, and marks of lights, regions and detectors."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tetlux.cases.picture.marks import Marks, draw_marks
from tetlux.cases.picture.stage import BACKGROUND, DARK, LIGHT
from tetlux.cases.picture.view import PANEL, Camera, Ray
from tetlux.meshing.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = (1400, 1050)
# The panel's left and top edges within the picture.
LEFT, TOP = 30, 100
# Colours of lines and text, strong and faint: on the light background, then on the dark one.
INK, FAINT = "#20242b", "#5d6673"
PALE, PALE_FAINT = "#e8eaee", "#9aa3b0"
DPI = 100


def draw_frame(
    path: Path,
    image: np.ndarray[tuple[int, ...], np.dtype[np.uint8]],
    camera: Camera,
    lights: tuple[Ray, ...],
    marks: Marks,
    *,
    ends: tuple[float, float] | None,
    table: FloatArray,
    below: bool,
    white: float | None,
    unit: str,
    title: str,
    extent: FloatArray,
) -> None:
    """Write the finished picture.

    Parameters
    ----------
    path : Path
        The PNG to write.
    image : (h, w, 3) ndarray of uint8
        The drawn body, of the size of the panel.
    camera : Camera
    lights : tuple of Ray
    marks : Marks
        Regions and detectors.
    ends : (float, float) or None
        Exitance at the ends of the colour map, W/unit²; None if no light leaves.
    table : (256, 3) ndarray
        The colour map.
    below : bool
        Whether parts of the body are darker than the lower end.
    white : float or None
        Luminance of white if the body has colours of its own, W/unit²; None if it has a colour bar.
    unit, title : str
    extent : (3,) ndarray
        The body's size along x, y and z, unit.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    # Not pyplot, whose figures and backend belong to the caller.
    background, ink, faint = (BACKGROUND, INK, FAINT) if white is None else (DARK, PALE, PALE_FAINT)
    figure = Figure(figsize=(SIZE[0] / DPI, SIZE[1] / DPI), dpi=DPI, facecolor=background)
    FigureCanvasAgg(figure)
    canvas = _panel(figure, (0, 0, *SIZE))
    canvas.set_axis_off()
    canvas.imshow(image, extent=(LEFT, LEFT + PANEL[0], TOP + PANEL[1], TOP), interpolation="none", zorder=1)
    canvas.set(xlim=(0, SIZE[0]), ylim=(SIZE[1], 0), aspect="auto")
    canvas.text(LEFT + 12, 56, _fit_title(title), size=21, color=ink, va="center", parse_math=False)
    _size_marks(canvas, camera, unit, extent, ink, faint)
    _axes_cross(canvas, camera, faint)
    draw_marks(canvas, marks, LEFT, TOP)
    _light_marks(canvas, camera, lights)
    if white is None:
        _color_bar(figure, ends, table, below, unit)
    else:
        _white_note(canvas, white, unit)
    figure.savefig(path, format="png", dpi=DPI, facecolor=background)


def _panel(figure: "Figure", box: tuple[float, float, float, float]) -> "Axes":
    """Axes at left, top, width and height in pixels."""
    left, top, width, height = box
    return figure.add_axes((left / SIZE[0], 1.0 - (top + height) / SIZE[1], width / SIZE[0], height / SIZE[1]))


def _fit_title(title: str) -> str:
    """Shorten the title to one line of the picture."""
    line = " ".join(title.split())
    return line if len(line) <= 84 else line[:83] + "…"


def _size_marks(canvas: "Axes", camera: Camera, unit: str, extent: FloatArray, ink: str, faint: str) -> None:
    """Draw a scale bar, which is exact in a parallel projection, and write the size of the body."""
    length = round_length(0.22 * PANEL[0] * camera.pixel)
    left, low, width = LEFT + 12, SIZE[1] - 36, length / camera.pixel
    canvas.plot([left, left + width], [low, low], color=ink, linewidth=3.2, solid_capstyle="butt")
    for x in (left, left + width):
        canvas.plot([x, x], [low - 7, low + 7], color=ink, linewidth=1.6, solid_capstyle="butt")
    canvas.text(left + 0.5 * width, low - 12, f"{length:g} {unit}", size=15, color=ink, ha="center", va="bottom")
    sizes = " × ".join(f"{value:.3g}" for value in extent)
    canvas.text(left + width + 28, low, f"body {sizes} {unit}", size=13, color=faint, va="center")


def round_length(longest: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above `longest`."""
    power = 10.0 ** math.floor(math.log10(longest))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest)


def _axes_cross(canvas: "Axes", camera: Camera, faint: str) -> None:
    """Draw the directions of x, y and z at the lower right."""
    x0, y0, length = LEFT + PANEL[0] + 95.0, SIZE[1] - 50.0, 40.0
    for axis, name in zip(np.eye(3), "xyz", strict=True):
        dx, dy = float(length * axis @ camera.right), float(-length * axis @ camera.up)
        if math.hypot(dx, dy) < 0.12 * length:
            continue  # it points at the eye
        canvas.plot([x0, x0 + dx], [y0, y0 + dy], color=faint, linewidth=1.8, solid_capstyle="round")
        stretch = 1.0 + 13.0 / math.hypot(dx, dy)
        canvas.text(x0 + stretch * dx, y0 + stretch * dy, name, size=13, color=faint, ha="center", va="center")


def _light_marks(canvas: "Axes", camera: Camera, lights: tuple[Ray, ...]) -> None:
    """Draw a ring with a dot for each point source, over the body since it lies inside."""
    points = np.array([ray.end for ray in lights if ray.is_point]).reshape(-1, 3)
    placed = camera.project(points)[:, :2]
    # The camera may leave points outside the panel that are far from the body.
    x, y = placed[((placed > 0) & (placed < PANEL)).all(axis=1)].T
    for size, face, edge, width in (
        (15.0, "none", "white", 5.0),
        (15.0, "none", LIGHT, 2.6),
        (5.0, LIGHT, "white", 1.0),
    ):
        canvas.plot(
            x + LEFT,
            y + TOP,
            "o",
            markersize=size,
            markerfacecolor=face,
            markeredgecolor=edge,
            markeredgewidth=width,
        )


def _white_note(canvas: "Axes", white: float, unit: str) -> None:
    """Write the luminance of white under a white patch."""
    center, top, size = LEFT + PANEL[0] + 95, 190, 64
    left, right, low = center - size / 2, center + size / 2, top + size
    canvas.fill([left, right, right, left], [top, top, low, low], facecolor="white")
    if not white > 0:
        lines = "no light leaves\nthe body"
    else:
        lines = f"white is\nexitance of\n{_label(float(f'{white:.3g}'))} W/{unit}²"
    canvas.text(center, low + 16, lines, size=14, color=PALE, ha="center", va="top", linespacing=1.4)


def _color_bar(figure: "Figure", ends: tuple[float, float] | None, table: FloatArray, below: bool, unit: str) -> None:
    from matplotlib.colorbar import Colorbar  # noqa: PLC0415
    from matplotlib.colors import ListedColormap, LogNorm  # noqa: PLC0415
    from matplotlib.ticker import FixedLocator, NullLocator  # noqa: PLC0415

    center = LEFT + PANEL[0] + 95
    if ends is None:
        figure.text(center / SIZE[0], 0.5, "no light leaves\nthe body", size=15, color=INK, ha="center")
        return
    axes = _panel(figure, (center - 60, 190, 30, 740))
    colors = ListedColormap(table.tolist())
    ticks = bar_ticks(*ends)
    bar = Colorbar(axes, cmap=colors, norm=LogNorm(*ends), extend="min" if below else "neither", extendfrac=0.03)
    bar.ax.yaxis.set_major_locator(FixedLocator([value for value, _ in ticks]))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.set_yticklabels([label for _, label in ticks], size=15, color=INK)
    bar.ax.tick_params(length=5, color=INK)
    bar.outline.set_visible(False)
    heading = f"exitance\nW/{unit}²"
    figure.text(
        center / SIZE[0],
        1 - 168 / SIZE[1],
        heading,
        size=15.5,
        color=INK,
        ha="center",
        va="bottom",
        linespacing=1.25,
    )


def bar_ticks(bottom: float, top: float) -> list[tuple[float, str]]:
    """Ticks of a logarithmic colour bar, values and labels: decades, or finer steps on a short bar."""
    low, high = math.ceil(math.log10(bottom) - 1e-9), math.floor(math.log10(top) + 1e-9)
    if high - low >= 2:
        return [(10.0**n, f"$10^{{{n}}}$") for n in range(low, high + 1)]
    if top / bottom > 5.0:
        steps = [s * 10.0**n for n in range(low - 1, high + 1) for s in (1.0, 2.0, 5.0)]
    else:
        step = round_length((top - bottom) / 3.0)
        steps = [n * step for n in range(math.ceil(bottom / step - 1e-9), math.floor(top / step + 1e-9) + 1)]
    return [(s, _label(s)) for s in steps if bottom * (1 - 1e-9) <= s <= top * (1 + 1e-9)]


def _label(value: float) -> str:
    power = math.floor(math.log10(value))
    if -3 <= power <= 3:
        return f"{value:.6g}"
    return f"${value / 10.0**power:.4g}\\!\\times\\!10^{{{power}}}$"
