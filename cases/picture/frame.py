"""The frame of a picture: title, colour bar, scale bar, axes, and marks of lights, regions and detectors."""

import math
from pathlib import Path

import numpy as np

from tetlux.cases.picture.canvas import Canvas
from tetlux.cases.picture.marks import Marks, draw_marks
from tetlux.cases.picture.stage import BACKGROUND, DARK, LIGHT, Image
from tetlux.cases.picture.view import PANEL, Camera, Ray
from tetlux.meshing.arrays import FloatArray

SIZE = (1400, 1050)
# The panel's left and top edges within the picture.
LEFT, TOP = 30, 100
# Colours of lines and text, strong and faint: on the light background, then on the dark one.
INK, FAINT = "#20242b", "#5d6673"
PALE, PALE_FAINT = "#e8eaee", "#9aa3b0"
# Middle of what stands to the right of the panel, and the colour bar's width, upper and lower end, pixels.
RIGHT = LEFT + PANEL[0] + 95
BAR_WIDTH, BAR_TOP, BAR_LOW = 30, 190, 930
# Height of the arrow below the bar that stands for all that is darker.
BELOW = 22
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def draw_frame(
    path: Path,
    image: Image,
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
    background, ink, faint = (BACKGROUND, INK, FAINT) if white is None else (DARK, PALE, PALE_FAINT)
    canvas = Canvas(SIZE, background)
    canvas.paste(image, LEFT, TOP)
    canvas.text((LEFT + 12, 56), _fit_title(title), 29, ink)
    _size_marks(canvas, camera, unit, extent, ink, faint)
    _axes_cross(canvas, camera, faint)
    draw_marks(canvas, marks, LEFT, TOP)
    _light_marks(canvas, camera, lights)
    if white is not None:
        _white_note(canvas, white, unit)
    elif ends is None:
        canvas.text((RIGHT, 0.5 * SIZE[1]), "no light leaves\nthe body", 21, INK, anchor="mm")
    else:
        _color_bar(canvas, ends, table, below, unit)
    canvas.save(path)


def _fit_title(title: str) -> str:
    """Shorten the title to one line of the picture."""
    line = " ".join(title.split())
    return line if len(line) <= 84 else line[:83] + "…"


def _size_marks(canvas: Canvas, camera: Camera, unit: str, extent: FloatArray, ink: str, faint: str) -> None:
    """Draw a scale bar, which is exact in a parallel projection, and write the size of the body."""
    length = round_length(0.22 * PANEL[0] * camera.pixel)
    left, low, width = LEFT + 12, SIZE[1] - 36, length / camera.pixel
    canvas.line([(left, low), (left + width, low)], 4.4, ink)
    for x in (left, left + width):
        canvas.line([(x, low - 7), (x, low + 7)], 2.2, ink)
    canvas.text((left + 0.5 * width, low - 8), f"{length:g} {unit}", 21, ink, anchor="md")
    sizes = " × ".join(f"{value:.3g}" for value in extent)
    canvas.text((left + width + 28, low), f"body {sizes} {unit}", 18, faint)


def round_length(longest: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above `longest`."""
    power = 10.0 ** math.floor(math.log10(longest))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest)


def _axes_cross(canvas: Canvas, camera: Camera, faint: str) -> None:
    """Draw the directions of x, y and z at the lower right."""
    x0, y0, length = float(RIGHT), SIZE[1] - 50.0, 40.0
    for axis, name in zip(np.eye(3), "xyz", strict=True):
        dx, dy = float(length * axis @ camera.right), float(-length * axis @ camera.up)
        if math.hypot(dx, dy) < 0.12 * length:
            continue  # it points at the eye
        canvas.line([(x0, y0), (x0 + dx, y0 + dy)], 2.5, faint, round_ends=True)
        stretch = 1.0 + 13.0 / math.hypot(dx, dy)
        canvas.text((x0 + stretch * dx, y0 + stretch * dy), name, 18, faint, anchor="mm")


def _light_marks(canvas: Canvas, camera: Camera, lights: tuple[Ray, ...]) -> None:
    """Draw a ring with a dot for each point source, over the body since it lies inside."""
    points = np.array([ray.end for ray in lights if ray.is_point]).reshape(-1, 3)
    placed = camera.project(points)[:, :2]
    # The camera may leave points outside the panel that are far from the body.
    inside = placed[((placed > 0) & (placed < PANEL)).all(axis=1)]
    light = "#" + "".join(f"{round(255 * value):02x}" for value in LIGHT)
    for x, y in (inside + np.array([LEFT, TOP])).tolist():
        canvas.disc((x, y), 13.9, "white", hole=7.0)
        canvas.disc((x, y), 12.2, light, hole=8.6)
        canvas.disc((x, y), 4.2, "white")
        canvas.disc((x, y), 3.2, light)


def _white_note(canvas: Canvas, white: float, unit: str) -> None:
    """Write the luminance of white under a white patch."""
    top, size = BAR_TOP, 64
    canvas.rectangle(RIGHT - size // 2, top, size, size, "white")
    if not white > 0:
        lines = "no light leaves\nthe body"
    else:
        lines = f"white is\nexitance of\n{_label(float(f'{white:.3g}'))} W/{unit}²"
    canvas.text((RIGHT, top + size + 16), lines, 19, PALE, anchor="ma")


def _color_bar(canvas: Canvas, ends: tuple[float, float], table: FloatArray, below: bool, unit: str) -> None:
    left, low = RIGHT - 60, BAR_LOW - (BELOW if below else 0)
    right, height = left + BAR_WIDTH, low - BAR_TOP
    rows = np.arange(height - 1, -1, -1) * len(table) // height
    colours = np.round(255 * table[rows]).astype(np.uint8)
    canvas.paste(np.repeat(colours[:, None], BAR_WIDTH, axis=1), left, BAR_TOP)
    if below:
        lowest = "#" + bytes(colours[-1].tolist()).hex()
        canvas.polygon([(left, low), (right, low), (left + 0.5 * BAR_WIDTH, BAR_LOW)], lowest)
    bottom, top = (math.log(end) for end in ends)
    for value, label in bar_ticks(*ends):
        y = low - height * (math.log(value) - bottom) / (top - bottom)
        canvas.line([(right, y), (right + 7, y)], 1.2, INK)
        canvas.text((right + 12, y), label, 21, INK)
    canvas.text((RIGHT, 168), f"exitance\nW/{unit}²", 21.5, INK, anchor="md")


def bar_ticks(bottom: float, top: float) -> list[tuple[float, str]]:
    """Ticks of a logarithmic colour bar, values and labels: decades, or finer steps on a short bar."""
    low, high = math.ceil(math.log10(bottom) - 1e-9), math.floor(math.log10(top) + 1e-9)
    if high - low >= 2:
        return [(10.0**n, f"10{_superscript(n)}") for n in range(low, high + 1)]
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
    return f"{value / 10.0**power:.4g}×10{_superscript(power)}"


def _superscript(number: int) -> str:
    return str(number).translate(SUPERSCRIPTS)
