"""`Stage`: what is drawn of a body, a camera and triangles with normals and colours."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.cases.picture.scale import Scale, scale_of
from tetlux.cases.picture.view import PANEL, UPRIGHT, Camera, Ray, camera_at, choose_view, unit
from tetlux.meshing.arrays import FloatArray, IntArray, Vector, perpendicular_axes, sum_by_index

Image = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]

# A pixel has 2 x 2 samples, whose mean smooths edges.
OVERSAMPLING = 2
BACKGROUND: Vector = (0.953, 0.957, 0.965)
# Background of a body with colours of its own.
DARK: Vector = (0.11, 0.12, 0.14)
LIGHT: Vector = (0.0, 0.62, 0.72)
# Brightness of a face that faces away from the lamp, and of one that faces it; between them it follows the cosine.
# Both are near enough to 1 for colours to be compared with the bar.
SHADED, FULL = 0.66, 1.0
# Neighbours that meet at a larger angle than this are shaded as separate faces.
SHARP, HALF_SHARP = math.cos(math.radians(40.0)), math.cos(math.radians(20.0))
# Normals are not smoothed at vertices of more triangles than this, since the cost grows with the square.
MOST_NEIGHBOURS = 100
# Shortest and longest arrow, as shares of the body's diagonal.
SHORTEST_ARROW, LONGEST_ARROW = 0.1, 0.18
# Radius of the shaft of an arrow, as a share of the body's diagonal.
ARROW_RADIUS = 0.0042
# An arrow within 20 degrees of the line of sight hides what it lights, and is drawn as a mark.
END_ON = math.cos(math.radians(20.0))
# Opacity of arrows in front of the body.
ARROW_OPACITY = 0.5


@dataclass(frozen=True, eq=False)
class Stage:
    """Triangles ready to be rendered, which share no corners.

    Parameters
    ----------
    camera : Camera
    corners, normals : (m, 3, 3) ndarray
        Positions and unit normals of the corners of the body.
    shares : (m, 3) ndarray
        Positions of the corners on the colour map, 0 to 1.
    arrows, arrow_normals : (k, 3, 3) ndarray
        Corners and normals of the lights' arrows.
    table : (256, 3) ndarray
        The colour map, red, green and blue from 0 to 1.
    colours : (m, 3, 3) ndarray or None
        Colours of the corners, from 0 to 1, if they replace the colour map.
    """

    camera: Camera
    corners: FloatArray
    normals: FloatArray
    shares: FloatArray
    arrows: FloatArray
    arrow_normals: FloatArray
    table: FloatArray
    colours: FloatArray | None = None

    @property
    def background(self) -> Vector:
        """Background colour, red, green and blue from 0 to 1."""
        return BACKGROUND if self.colours is None else DARK


def build_stage(
    points: FloatArray,
    triangles: IntArray,
    exitance: FloatArray,
    lights: tuple[Ray, ...],
    colours: FloatArray | None = None,
    *,
    up: Vector = UPRIGHT,
    toward: FloatArray | None = None,
    panel: tuple[int, int] = PANEL,
    scale: Scale | None = None,
    values: FloatArray | None = None,
) -> Stage:
    """Make the camera, arrows, normals and colours of a picture.

    `toward`, if given, sets the direction to the eye, `values` and their `scale` the colours in place of the exitance.
    """
    scale = scale or scale_of(exitance, "exitance", "")
    shares = scale.shares(exitance if values is None else values)
    corners = points[triangles]
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    camera = choose_camera(points, triangles, exitance, lights, up=up, toward=toward, panel=panel)
    shafts = [arrow_ends(ray, diagonal) for ray in lights if not ray.is_point and not is_end_on(ray, camera)]
    arrows = [_arrow(tail, tip, ARROW_RADIUS * diagonal) for tail, tip in shafts]
    return Stage(
        camera=camera,
        corners=corners,
        normals=corner_normals(corners, triangles),
        shares=shares[triangles],
        arrows=np.concatenate([np.empty((0, 3, 3)), *(c for c, _ in arrows)]),
        arrow_normals=np.concatenate([np.empty((0, 3, 3)), *(n for _, n in arrows)]),
        table=scale.table,
        colours=None if colours is None else colours[triangles],
    )


def choose_camera(
    points: FloatArray,
    triangles: IntArray,
    exitance: FloatArray,
    lights: tuple[Ray, ...],
    *,
    up: Vector = UPRIGHT,
    toward: FloatArray | None = None,
    panel: tuple[int, int] = PANEL,
) -> Camera:
    """The camera of a picture of a body and its lights; `toward`, if given, sets the direction to the eye."""
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    marked = [np.array(ray.end) for ray in lights] + [
        arrow_ends(ray, diagonal)[0] for ray in lights if not ray.is_point
    ]
    # A light far away must not shrink the body to a speck.
    near = [place[None] for place in marked if np.linalg.norm(place - middle) < diagonal]
    if toward is None:
        toward = choose_view(points[triangles], exitance[triangles].mean(axis=1), lights, diagonal, up)
    return camera_at(np.vstack([points, *near]), toward, up, panel)


def is_end_on(ray: Ray, camera: Camera) -> bool:
    """Whether a camera looks along the arrow of a light, from either end."""
    return abs(float(unit(np.subtract(ray.start, ray.end)) @ camera.toward)) > END_ON


def arrow_ends(ray: Ray, diagonal: float) -> tuple[FloatArray, FloatArray]:
    """Tail and tip of a light's arrow, with its length clipped to shares of the body's diagonal."""
    tip, back = np.asarray(ray.end, dtype=float), np.subtract(ray.start, ray.end)
    length = float(np.linalg.norm(back))
    drawn = min(max(length, SHORTEST_ARROW * diagonal), LONGEST_ARROW * diagonal)
    return tip + back * (drawn / length), tip


def corner_normals(corners: FloatArray, triangles: IntArray) -> FloatArray:
    """Unit normals (m, 3, 3) at the corners of triangles, smooth except across sharp edges.

    The normal at a corner is the mean, weighted by area, over those triangles at its vertex whose normals are within
    40 degrees of that of its own triangle.
    """
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat, vertex = unit(weighted), triangles.ravel()
    owner = np.repeat(np.arange(len(triangles)), 3)
    count = int(vertex.max()) + 1
    summed = np.column_stack([sum_by_index(vertex, np.repeat(axis, 3), count) for axis in weighted.T])[vertex]
    # Triangles within half the angle of their mean are within the angle of each other; others are compared in pairs.
    bent = np.einsum("ij,ij->i", flat[owner], unit(summed)) < HALF_SHARP
    apart = sum_by_index(vertex, bent, count)[vertex] > 0
    summed[apart] = _sums_of_like(flat, weighted, owner[apart], vertex[apart])
    normals = np.where(summed.any(axis=1, keepdims=True), summed, weighted[owner])
    return np.asarray(unit(normals).reshape(-1, 3, 3))


def _sums_of_like(flat: FloatArray, weighted: FloatArray, owner: IntArray, vertex: IntArray) -> FloatArray:
    """For corners (c,) of given triangles and vertices the sum of normals of like triangles at the vertex, (c, 3)."""
    from scipy.sparse import csr_array  # noqa: PLC0415

    count = len(owner)
    calm = np.flatnonzero(np.bincount(vertex)[vertex] <= MOST_NEIGHBOURS) if count else np.zeros(0, np.int64)
    at_vertex = csr_array((np.ones(len(calm)), (calm, vertex[calm])), shape=(count, int(vertex.max(initial=0)) + 1))
    corner, other = (at_vertex @ at_vertex.T).tocoo().coords
    alike = np.einsum("ij,ij->i", flat[owner[corner]], flat[owner[other]]) > SHARP
    corner, other = corner[alike], other[alike]
    return np.asarray(csr_array((np.ones(len(corner)), (corner, owner[other])), shape=(count, len(flat))) @ weighted)


def _arrow(tail: FloatArray, tip: FloatArray, radius: float, sides: int = 24) -> tuple[FloatArray, FloatArray]:
    """Corners and normals (k, 3, 3) of an arrow with a shaft and a head that ends at `tip`."""
    axis = unit(tip - tail)
    across, up = perpendicular_axes(axis)
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    spoke = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * up
    neck, head = tip - 7.0 * radius * axis, 2.6 * radius
    rings = [tail, tail + radius * spoke, neck + radius * spoke, neck + head * spoke, tip]
    slant = unit(spoke + head / (7.0 * radius) * axis)
    bands = [(0, 1, -axis), (1, 2, spoke), (2, 3, -axis), (3, 4, slant)]
    corners, normals = [], []
    for first, last, normal in bands:
        low, high = (np.broadcast_to(rings[i], spoke.shape) for i in (first, last))
        facing = np.broadcast_to(normal, spoke.shape)
        here, there = slice(None, -1), slice(1, None)
        corners.append(np.stack([low[here], low[there], high[here]], axis=1))
        normals.append(np.stack([facing[here], facing[there], facing[here]], axis=1))
        corners.append(np.stack([low[there], high[there], high[here]], axis=1))
        normals.append(np.stack([facing[there], facing[there], facing[here]], axis=1))
    return np.concatenate(corners), np.concatenate(normals)
