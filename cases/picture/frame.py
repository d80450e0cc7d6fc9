"""The frame of a picture: title, colour bar, scale bar, axes, and marks of lights, regions and detectors."""

import math

import numpy as np

from tetlux.cases.picture.canvas import Canvas
from tetlux.cases.picture.marks import Marks, draw_marks
from tetlux.cases.picture.scale import Scale, number_label, round_length
from tetlux.cases.picture.stage import BACKGROUND, DARK, LIGHT, Image
from tetlux.cases.picture.view import Camera, Ray
from tetlux.meshing.arrays import FloatArray

# The panel's left and top edges within the picture, and what the picture has more than the panel, pixels.
LEFT, TOP = 30, 100
AROUND = (250, 170)
# Colours of lines and text, strong and faint: on the light background, then on the dark one.
INK, FAINT = "#20242b", "#5d6673"
PALE, PALE_FAINT = "#e8eaee", "#9aa3b0"
# Middle of what stands to the right of the panel, from its right edge; the colour bar's width, its upper end from the
# top of the picture, and its lower end from the bottom, pixels.
RIGHT = 95
BAR_WIDTH, BAR_TOP, BAR_LOW = 30, 190, 120
# Colour of lights, and the radius of the mark of one that is seen end-on, pixels.
TEAL = "#" + "".join(f"{round(255 * value):02x}" for value in LIGHT)
BEAM = 15.0
# Height of the arrow below the bar that stands for all that is darker.
BELOW = 22


def draw_frame(
    image: Image,
    camera: Camera,
    lights: tuple[Ray, ...],
    marks: Marks,
    *,
    scale: Scale,
    below: bool,
    white: float | None,
    unit: str,
    title: str,
    extent: FloatArray,
) -> Canvas:
    """Draw the finished picture.

    Parameters
    ----------
    image : (h, w, 3) ndarray of uint8
        The drawn body, of the size of the panel.
    camera : Camera
    lights : tuple of Ray
    marks : Marks
        Regions and detectors.
    scale : Scale
        Of the colour bar.
    below : bool
        Whether parts of the body are darker than the lower end.
    white : float or None
        Luminance of white if the body has colours of its own, W/unit²; None if it has a colour bar.
    unit, title : str
    extent : (3,) ndarray
        The body's size along x, y and z, unit.

    Returns
    -------
    Canvas
    """
    background, ink, faint = (BACKGROUND, INK, FAINT) if white is None else (DARK, PALE, PALE_FAINT)
    width, height = size = camera.panel[0] + AROUND[0], camera.panel[1] + AROUND[1]
    canvas = Canvas(size, background)
    canvas.paste(image, LEFT, TOP)
    canvas.text((LEFT + 12, 56), _fit_title(title, width), 29, ink)
    _size_marks(canvas, camera, unit, extent, ink, faint)
    _axes_cross(canvas, camera, faint)
    draw_marks(canvas, marks, LEFT, TOP)
    _light_marks(canvas, camera, lights)
    _beam_marks(canvas, marks.beams + np.array([LEFT, TOP]))
    right = LEFT + camera.panel[0] + RIGHT
    if white is not None:
        _white_note(canvas, right, white, unit)
    elif scale.ends is None:
        canvas.text((right, 0.5 * height), "no light leaves\nthe body", 21, INK, anchor="mm")
    else:
        _color_bar(canvas, right, height - BAR_LOW, scale, below)
    return canvas


def _fit_title(title: str, width: int) -> str:
    """Shorten the title to one line of the picture."""
    line, longest = " ".join(title.split()), int(0.06 * width)
    return line if len(line) <= longest else line[: longest - 1] + "…"


def _size_marks(canvas: Canvas, camera: Camera, unit: str, extent: FloatArray, ink: str, faint: str) -> None:
    """Draw a scale bar, which is exact in a parallel projection, and write the size of the body."""
    length = round_length(0.22 * camera.panel[0] * camera.pixel)
    left, low, width = LEFT + 12, camera.panel[1] + AROUND[1] - 36, length / camera.pixel
    canvas.line([(left, low), (left + width, low)], 4.4, ink)
    for x in (left, left + width):
        canvas.line([(x, low - 7), (x, low + 7)], 2.2, ink)
    canvas.text((left + 0.5 * width, low - 8), f"{length:g} {unit}", 21, ink, anchor="md")
    sizes = " × ".join(f"{value:.3g}" for value in extent)
    canvas.text((left + width + 28, low), f"body {sizes} {unit}", 18, faint)


def _axes_cross(canvas: Canvas, camera: Camera, faint: str) -> None:
    """Draw the directions of x, y and z at the lower right."""
    x0, y0 = LEFT + camera.panel[0] + float(RIGHT), camera.panel[1] + AROUND[1] - 62.0
    length = 40.0
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
    inside = placed[((placed > 0) & (placed < camera.panel)).all(axis=1)]
    for x, y in (inside + np.array([LEFT, TOP])).tolist():
        canvas.disc((x, y), 13.9, "white", hole=7.0)
        canvas.disc((x, y), 12.2, TEAL, hole=8.6)
        canvas.disc((x, y), 4.2, "white")
        canvas.disc((x, y), 3.2, TEAL)


def _beam_marks(canvas: Canvas, places: FloatArray) -> None:
    """Draw a ring with a cross, the tail of an arrow, where light enters along the line of sight."""
    for x, y in places.tolist():
        for radius, width, colour in ((BEAM + 0.8, 5.2, "white"), (BEAM, 2.8, TEAL)):
            arm = (radius - 0.5 * width) / math.sqrt(2.0)
            canvas.disc((x, y), radius, colour, hole=radius - width)
            canvas.lines([[(x - arm, y - s * arm), (x + arm, y + s * arm)] for s in (-1, 1)], 0.6 * width, colour)


def _white_note(canvas: Canvas, right: int, white: float, unit: str) -> None:
    """Write the luminance of white under a white patch."""
    top, size = BAR_TOP, 64
    canvas.rectangle(right - size // 2, top, size, size, "white")
    if not white > 0:
        lines = "no light leaves\nthe body"
    else:
        lines = f"white is\nexitance of\n{number_label(float(f'{white:.3g}'))} W/{unit}²"
    canvas.text((right, top + size + 16), lines, 19, PALE, anchor="ma")


def _color_bar(canvas: Canvas, middle: int, lowest: int, scale: Scale, below: bool) -> None:
    assert scale.ends is not None
    left, low = middle - 60, lowest - (BELOW if below else 0)
    right, height = left + BAR_WIDTH, low - BAR_TOP
    rows = np.arange(height - 1, -1, -1) * len(scale.table) // height
    colours = np.round(255 * scale.table[rows]).astype(np.uint8)
    canvas.paste(np.repeat(colours[:, None], BAR_WIDTH, axis=1), left, BAR_TOP)
    if below:
        colour = "#" + bytes(colours[-1].tolist()).hex()
        canvas.polygon([(left, low), (right, low), (left + 0.5 * BAR_WIDTH, lowest)], colour)
    ticks = scale.ticks()
    for share, (_, label) in zip(scale.shares(np.array([value for value, _ in ticks])), ticks, strict=True):
        y = low - height * float(share)
        canvas.line([(right, y), (right + 7, y)], 1.2, INK)
        canvas.text((right + 12, y), label, 21, INK)
    canvas.text((middle, 168), scale.heading, 21.5, INK, anchor="md")
