"""Marks over the drawn body: outlines of the regions inside it, and detectors with their names."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tetlux.cases.picture.rasterizer import nearest_triangles
from tetlux.cases.picture.stage import OVERSAMPLING
from tetlux.cases.picture.view import PANEL, Camera, in_view
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, Vector

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, PAPER = "#20242b", "#ffffff"
# Size of the names: font, points; line height and mean width of a letter, pixels.
FONT, LINE, LETTER = 11.5, 18.0, 9.6
# Pixels between a dot and its name.
GAP = 10.0
# Positions of a name relative to its dot (right, down), the best first.
SIDES = ((1, 0), (-1, 0), (0, -1), (0, 1), (1, -1), (-1, 1), (1, 1), (-1, -1))
# This many detectors are tested for being hidden; each costs a test of all triangles.
MOST_TESTED = 200
# Opacity of the tint of a region.
TINT = 0.10


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
    """

    outlines: Sequence[tuple[str, FloatArray]]
    names: Sequence[str]
    dots: FloatArray
    hidden: BoolArray


def project_marks(
    camera: Camera,
    corners: FloatArray,
    regions: Sequence[RegionOutline],
    detectors: Sequence[tuple[str, Vector]],
    diagonal: float,
) -> Marks:
    """Project regions and detectors into the panel of a camera.

    Parameters
    ----------
    camera : Camera
    corners : (m, 3, 3) ndarray
        Corners of the body's triangles.
    regions : sequence of RegionOutline
    detectors : sequence of (str, Vector)
        Name and position on the surface.
    diagonal : float
        Diagonal of the body, unit.

    Returns
    -------
    Marks
    """
    places = np.array([place for _, place in detectors], dtype=float).reshape(-1, 3)
    hidden = np.zeros(len(places), dtype=bool)
    hidden[:MOST_TESTED] = ~in_view(corners, places[:MOST_TESTED], camera.toward, diagonal)
    return Marks(
        outlines=[(region.name, _coverage(camera, region)) for region in regions],
        names=[name for name, _ in detectors],
        dots=camera.project(places)[:, :2],
        hidden=hidden,
    )


def _coverage(camera: Camera, region: RegionOutline) -> FloatArray:
    """The share of each pixel of the panel that a region covers, (h, w)."""
    placed = camera.project(region.points)[region.triangles] * OVERSAMPLING
    covered = nearest_triangles(placed, closed=len(placed))[0] >= 0
    n = OVERSAMPLING
    return np.asarray(covered.reshape(PANEL[1], n, PANEL[0], n).mean(axis=(1, 3)))


def draw_marks(canvas: "Axes", marks: Marks, left: float, top: float) -> None:
    """Draw marks on a canvas of pixels, on which the panel begins at `left` and `top`."""
    corner = np.array([left, top])
    boxes: list[tuple[float, float, float, float]] = [(x - 6, y - 6, x + 6, y + 6) for x, y in marks.dots + corner]
    _draw_detectors(canvas, marks, corner, boxes)
    for name, coverage in marks.outlines:
        _draw_outline(canvas, name, coverage, corner, boxes)


def _draw_outline(
    canvas: "Axes",
    name: str,
    coverage: FloatArray,
    corner: FloatArray,
    boxes: list[tuple[float, float, float, float]],
) -> None:
    if not (coverage > 0.5).any():
        return
    x, y = np.arange(PANEL[0]) + 0.5 + corner[0], np.arange(PANEL[1]) + 0.5 + corner[1]
    canvas.contourf(x, y, coverage, levels=[0.5, 2.0], colors=[PAPER], alpha=TINT, zorder=2)
    canvas.contour(x, y, coverage, levels=[0.5], colors=[PAPER], linewidths=3.4, alpha=0.75, zorder=2.1)
    canvas.contour(x, y, coverage, levels=[0.5], colors=[INK], linewidths=1.5, linestyles=["--"], zorder=2.2)
    rows, columns = np.nonzero(coverage > 0.5)
    place = np.array([columns.mean(), rows.min()]) + corner
    _write_name(canvas, name, place, boxes, gap=4.0, sides=[(0, -1), (0, 1)])


def _draw_detectors(
    canvas: "Axes", marks: Marks, corner: FloatArray, boxes: list[tuple[float, float, float, float]]
) -> None:
    for name, dot, hidden in zip(marks.names, marks.dots + corner, marks.hidden, strict=True):
        face, alpha = ("none", 0.6) if hidden else (PAPER, 1.0)
        canvas.plot(*dot, "o", markersize=8.5, color="none", markeredgecolor=PAPER, markeredgewidth=3.4, alpha=alpha)
        canvas.plot(*dot, "o", markersize=8.0, color=face, markeredgecolor=INK, markeredgewidth=1.6, alpha=alpha)
        _write_name(canvas, name, dot, boxes, gap=GAP)


def _write_name(
    canvas: "Axes",
    name: str,
    place: FloatArray,
    boxes: list[tuple[float, float, float, float]],
    *,
    gap: float,
    sides: Sequence[tuple[int, int]] = SIDES,
) -> None:
    """Write a name beside a place without overlapping other marks; leave it out if there is no room."""
    from matplotlib.patheffects import withStroke  # noqa: PLC0415

    width, (x, y) = LETTER * len(name), place
    for across, down in sides:
        middle = x + across * (gap + 0.5 * width), y + down * (gap + 0.5 * LINE)
        box = (middle[0] - 0.5 * width, middle[1] - 0.5 * LINE, middle[0] + 0.5 * width, middle[1] + 0.5 * LINE)
        if any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in boxes):
            continue
        boxes.append(box)
        canvas.text(
            *middle, name, size=FONT, color=INK, ha="center", va="center", parse_math=False, zorder=4,
            path_effects=[withStroke(linewidth=3.0, foreground=PAPER)],
        )  # fmt: skip
        return
