"""Marks over the drawn body: outlines of the regions inside it, and detectors with their names."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.cases.picture.canvas import Canvas
from tetlux.cases.picture.rasterizer import visible_triangles
from tetlux.cases.picture.shading import place_samples, samples_of
from tetlux.cases.picture.stage import OVERSAMPLING, arrow_ends, is_end_on
from tetlux.cases.picture.view import Camera, Ray, caster_of, in_view
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, Vector

INK, PAPER = "#20242b", "#ffffff"
# Size of the names: font and line height, pixels.
FONT, LINE = 16.0, 18.0
# Pixels between a dot and its name.
GAP = 10.0
# Names keep off arrows: number of places along an arrow, and their distance from it, pixels.
ALONG_ARROW, OFF_ARROW = 16, 9.0
# Positions of a name relative to its dot (right, down), the best first.
SIDES = ((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, 1), (1, 1), (-1, -1))
# Opacity of the tint of a region; length of the dashes and of the gaps of its outline, pixels.
TINT, DASH, SPACE = 0.10, 7.7, 3.3


@dataclass(frozen=True, eq=False)
class RegionOutline:
    """A region to outline: its name, vertices (n, 3) and triangles (m, 3)."""

    name: str
    points: FloatArray
    triangles: IntArray


@dataclass(frozen=True, eq=False)
class Marks:
    """Marks in pixels of the panel.

    Parameters
    ----------
    outlines : sequence of (str, (h, w) ndarray)
        Names of the regions, and the share of each pixel that they cover.
    names : sequence of str
        Names of the detectors.
    dots : (d, 2) ndarray
        Positions of the detectors.
    hidden : (d,) ndarray of bool
        Whether the body hides the detector.
    beams : (b, 2) ndarray
        Where light enters along the line of sight and the entry is visible.
    arrows : (a, 2) ndarray
        Places along the arrows of lights.
    """

    outlines: Sequence[tuple[str, FloatArray]]
    names: Sequence[str]
    dots: FloatArray
    hidden: BoolArray
    beams: FloatArray
    arrows: FloatArray


def project_marks(
    camera: Camera,
    corners: FloatArray,
    regions: Sequence[RegionOutline],
    detectors: Sequence[tuple[str, Vector]],
    lights: Sequence[Ray],
    diagonal: float,
) -> Marks:
    """Project regions, detectors and light that is seen end-on into the panel of a camera.

    Parameters
    ----------
    camera : Camera
    corners : (m, 3, 3) ndarray
        Corners of the body's triangles.
    regions : sequence of RegionOutline
    detectors : sequence of (str, Vector)
        Name and position on the surface.
    lights : sequence of Ray
    diagonal : float
        Diagonal of the body, unit.

    Returns
    -------
    Marks
    """
    places = np.array([place for _, place in detectors], dtype=float).reshape(-1, 3)
    entries = [ray.end for ray in lights if not ray.is_point and is_end_on(ray, camera)]
    beams = np.array(entries, dtype=float).reshape(-1, 3)
    shafts = [arrow_ends(ray, diagonal) for ray in lights if not ray.is_point and not is_end_on(ray, camera)]
    along = [np.linspace(tail, tip, ALONG_ARROW) for tail, tip in shafts]
    body = caster_of(corners)
    return Marks(
        outlines=[(region.name, _coverage(camera, region)) for region in regions],
        names=[name for name, _ in detectors],
        dots=camera.project(places)[:, :2],
        hidden=~in_view(body, places, camera.toward, diagonal),
        beams=camera.project(beams[in_view(body, beams, camera.toward, diagonal)])[:, :2],
        arrows=camera.project(np.concatenate([np.empty((0, 3)), *along]))[:, :2],
    )


def _coverage(camera: Camera, region: RegionOutline) -> FloatArray:
    """The share of each pixel of the panel that a region covers, (h, w)."""
    placed = place_samples(camera, region.points[region.triangles])
    covered = visible_triangles(placed, samples_of(camera), closed=True).owner >= 0
    n, (width, height) = OVERSAMPLING, camera.panel
    return np.asarray(covered.reshape(height, n, width, n).mean(axis=(1, 3)))


def draw_marks(canvas: Canvas, marks: Marks, left: int, top: int) -> None:
    """Draw marks on a canvas of pixels, on which the panel begins at `left` and `top`."""
    corner = np.array([left, top])
    boxes: list[tuple[float, float, float, float]] = [(x - 6, y - 6, x + 6, y + 6) for x, y in marks.dots + corner]
    boxes += [(x - OFF_ARROW, y - OFF_ARROW, x + OFF_ARROW, y + OFF_ARROW) for x, y in marks.arrows + corner]
    _draw_detectors(canvas, marks, corner, boxes)
    for name, coverage in marks.outlines:
        _draw_outline(canvas, name, coverage, corner, boxes)


def _draw_outline(
    canvas: Canvas,
    name: str,
    coverage: FloatArray,
    corner: FloatArray,
    boxes: list[tuple[float, float, float, float]],
) -> None:
    if not (coverage > 0.5).any():
        return
    from contourpy import contour_generator  # noqa: PLC0415

    left, top = corner.astype(int).tolist()
    canvas.shade((coverage > 0.5).astype(float), left, top, PAPER, TINT)
    # Closed where the panel ends, too.
    rings = [np.asarray(ring) - 0.5 + corner for ring in contour_generator(z=np.pad(coverage, 1)).lines(0.5)]
    canvas.lines(rings, 4.7, PAPER, opacity=0.75)
    canvas.lines([dash for ring in rings for dash in cut_dashes(ring)], 2.1, INK)
    rows, columns = np.nonzero(coverage > 0.5)
    for row, sides in ((rows.min(), [(0, -1), (0, 1)]), (rows.max(), [(0, 1)])):
        place = np.array([columns.mean(), row]) + corner
        if _write_name(canvas, name, place, boxes, gap=4.0, sides=sides):
            return


def _draw_detectors(
    canvas: Canvas, marks: Marks, corner: FloatArray, boxes: list[tuple[float, float, float, float]]
) -> None:
    for name, dot, hidden in zip(marks.names, marks.dots + corner, marks.hidden, strict=True):
        opacity = 0.6 if hidden else 1.0
        canvas.disc(dot.tolist(), 8.3, PAPER, hole=3.6, opacity=opacity)
        canvas.disc(dot.tolist(), 6.7, INK, hole=4.4, opacity=opacity)
        if not hidden:
            canvas.disc(dot.tolist(), 4.4, PAPER)
        _write_name(canvas, name, dot, boxes, gap=GAP)


def cut_dashes(line: FloatArray) -> list[FloatArray]:
    """Cut a line through points (n, 2) into dashes."""
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    dashes = []
    for start in np.arange(0.0, length[-1], DASH + SPACE):
        end = min(start + DASH, length[-1])
        at = np.concatenate([[start], length[(length > start) & (length < end)], [end]])
        dashes.append(np.column_stack([np.interp(at, length, column) for column in line.T]))
    return dashes


def _write_name(
    canvas: Canvas,
    name: str,
    place: FloatArray,
    boxes: list[tuple[float, float, float, float]],
    *,
    gap: float,
    sides: Sequence[tuple[int, int]] = SIDES,
) -> bool:
    """Write a name beside a place without overlapping other marks, or return False if there is no room."""
    width, (x, y) = canvas.text_width(name, FONT), place
    for across, down in sides:
        middle = x + across * (gap + 0.5 * width), y + down * (gap + 0.5 * LINE)
        box = (middle[0] - 0.5 * width, middle[1] - 0.5 * LINE, middle[0] + 0.5 * width, middle[1] + 0.5 * LINE)
        if any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in boxes):
            continue
        boxes.append(box)
        canvas.text(middle, name, FONT, INK, anchor="mm", outline=PAPER)
        return True
    return False
