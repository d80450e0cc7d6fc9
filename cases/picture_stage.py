"""What both drawers of a picture are given: a camera, triangles with normals, and numbers to colour by."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, Vector
from tetlux.meshing.proximity import cross_segments

# Pixels of the panel that shows the body.
PANEL = (1150, 880)
# Each pixel is the mean of 2 x 2 drawn ones, in both drawers: smooth edges without multisampling.
OVERSAMPLING = 2
# Darker than this share of the maximum is drawn as dark as can be.
DECADES = 6.0
# A range narrower than this factor would show rounding errors as a pattern.
NARROWEST = 2.0
# The darkest colours of the map are left out: on black no shape can be seen.
COLOR_MAP, DARKEST = "inferno", 0.2
BACKGROUND: Vector = (0.953, 0.957, 0.965)
# Behind a body in colours of its own, most of which are darker than white.
DARK: Vector = (0.11, 0.12, 0.14)
LIGHT: Vector = (0.0, 0.62, 0.72)
# Brightness of a face turned away from the lamp and of one that faces it; between them it follows the
# cosine. Near enough to 1 that colours can be read off the bar.
SHADED, FULL = 0.66, 1.0
# Where the lamp stands, along the camera's axes: above the viewer's left shoulder.
LAMP = (-0.35, 0.5, 0.8)
# Neighbours that meet at a sharper angle than this are shaded as two faces.
SHARP = math.cos(math.radians(40.0))
# The mean normal at the hub of a fan of more triangles than this would cost the square of their number.
MOST_NEIGHBOURS = 100
# Degrees about the vertical from the lit side to the eye, the best first.
TURNS = (50.0, -50.0, 25.0, -25.0, 80.0, -80.0, 0.0)
# So many entry points are looked for; each costs a test of all triangles.
MOST_ENTRIES = 12
# The margin round the body, as a share of the panel.
MARGIN = 0.05
# Lengths of a drawn arrow, as shares of the body's diagonal.
SHORTEST_ARROW, LONGEST_ARROW = 0.16, 0.3


@dataclass(frozen=True, eq=False)
class Ray:
    """A light as it is drawn: an arrow that ends where it meets the body, or a point (start = end)."""

    start: Vector
    end: Vector

    @property
    def is_point(self) -> bool:
        """Whether this light has no direction."""
        return self.start == self.end


@dataclass(frozen=True, eq=False)
class Camera:
    """A parallel projection.

    Parameters
    ----------
    right, up, toward : (3,) ndarray
        Unit vectors: along the picture's rows, up its columns, and from the body to the eye.
    center : (3,) ndarray
        The point in the middle of the panel.
    pixel : float
        Size of a pixel of the panel, unit of length.
    """

    right: FloatArray
    up: FloatArray
    toward: FloatArray
    center: FloatArray
    pixel: float

    @property
    def lamp(self) -> FloatArray:
        """Unit vector to the lamp that shades the body."""
        return _unit(np.column_stack([self.right, self.up, self.toward]) @ LAMP)

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels right of the panel's left edge and below its top edge, and nearness in pixels, (n, 3)."""
        offset = np.asarray(points) - self.center
        across, above, near = (offset @ axis / self.pixel for axis in (self.right, self.up, self.toward))
        return np.column_stack([0.5 * PANEL[0] + across, 0.5 * PANEL[1] - above, near])


@dataclass(frozen=True, eq=False)
class Stage:
    """Triangles ready to be drawn; each has three corners of its own.

    Parameters
    ----------
    camera : Camera
    corners, normals : (m, 3, 3) ndarray
        Places and unit normals of the corners of the body.
    shares : (m, 3) ndarray
        Where the corners lie on the colour map, 0 to 1.
    arrows, arrow_normals : (k, 3, 3) ndarray
        Corners and normals of the lights' arrows.
    table : (256, 3) ndarray
        The colour map, red, green and blue from 0 to 1.
    colours : (m, 3, 3) ndarray or None
        Colours of the corners themselves, from 0 to 1, in place of the colour map.
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
        """Red, green and blue behind the body."""
        return BACKGROUND if self.colours is None else DARK


def exitance_range(exitance: FloatArray) -> tuple[float, float] | None:
    """What the ends of the colour map stand for, or None where no light leaves.

    The range ends at the largest value; it begins at the smallest positive one, yet no further than
    `DECADES` below the largest, and spans a factor of `NARROWEST` at least.
    """
    seen = exitance[np.isfinite(exitance) & (exitance > 0)]
    if len(seen) == 0:
        return None
    top = float(seen.max())
    bottom = max(float(seen.min()), top * 10.0**-DECADES)
    return min(bottom, top / NARROWEST), top


def map_shares(exitance: FloatArray, ends: tuple[float, float] | None) -> FloatArray:
    """Where each value lies on the colour map, 0 to 1, by its logarithm; what is not positive lies at 0."""
    if ends is None:
        return np.zeros(len(exitance))
    bottom, top = ends
    clipped = np.clip(np.nan_to_num(exitance, nan=0.0, posinf=top, neginf=0.0), bottom, top)
    return np.asarray(np.log(clipped / bottom) / math.log(top / bottom))


def color_table() -> FloatArray:
    """Red, green and blue, 0 to 1, at 256 steps of the colour map."""
    from matplotlib import colormaps  # noqa: PLC0415

    return np.asarray(colormaps[COLOR_MAP](np.linspace(DARKEST, 1.0, 256))[:, :3])


def build_stage(
    points: FloatArray,
    triangles: IntArray,
    exitance: FloatArray,
    lights: tuple[Ray, ...],
    colours: FloatArray | None = None,
) -> Stage:
    """Choose the camera, and make arrows, normals and colours for it."""
    shares = map_shares(exitance, exitance_range(exitance))
    corners = points[triangles]
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    shafts = [arrow_ends(ray, diagonal) for ray in lights if not ray.is_point]
    arrows = [_arrow(tail, tip, 0.008 * diagonal) for tail, tip in shafts]
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    marked = [np.array(ray.end) for ray in lights] + [tail for tail, _ in shafts]
    # A lamp far away must not shrink the body to a speck.
    near = [place[None] for place in marked if np.linalg.norm(place - middle) < diagonal]
    toward = _choose_view(corners, exitance[triangles].mean(axis=1), lights, diagonal)
    return Stage(
        camera=_camera(np.vstack([points, *near]), toward),
        corners=corners,
        normals=corner_normals(corners, triangles),
        shares=shares[triangles],
        arrows=np.concatenate([np.empty((0, 3, 3)), *(c for c, _ in arrows)]),
        arrow_normals=np.concatenate([np.empty((0, 3, 3)), *(n for _, n in arrows)]),
        table=color_table(),
        colours=None if colours is None else colours[triangles],
    )


def arrow_ends(ray: Ray, diagonal: float) -> tuple[FloatArray, FloatArray]:
    """Tail and tip of a light's arrow, of a length that suits a body of this diagonal."""
    tip, back = np.asarray(ray.end, dtype=float), np.subtract(ray.start, ray.end)
    length = float(np.linalg.norm(back))
    drawn = min(max(length, SHORTEST_ARROW * diagonal), LONGEST_ARROW * diagonal)
    return tip + back * (drawn / length), tip


def corner_normals(corners: FloatArray, triangles: IntArray) -> FloatArray:
    """Unit normals (m, 3, 3) of the corners of triangles, smooth over the body yet broken at sharp edges.

    A corner's normal is the mean, weighted by area, of the triangles round its vertex that face nearly
    the way its own triangle does.
    """
    from scipy.sparse import csr_array  # noqa: PLC0415

    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = _unit(weighted)
    owner = np.repeat(np.arange(len(triangles)), 3)
    count = len(owner)
    vertex = triangles.ravel()
    calm = np.flatnonzero(np.bincount(vertex)[vertex] <= MOST_NEIGHBOURS)
    at_vertex = csr_array((np.ones(len(calm)), (calm, vertex[calm])), shape=(count, int(vertex.max()) + 1))
    one, other = (at_vertex @ at_vertex.T).tocoo().coords
    alike = np.einsum("ij,ij->i", flat[owner[one]], flat[owner[other]]) > SHARP
    one, other = one[alike], other[alike]
    summed = csr_array((np.ones(len(one)), (one, owner[other])), shape=(count, len(triangles))) @ weighted
    normals = np.where(summed.any(axis=1, keepdims=True), summed, weighted[owner])
    return np.asarray(_unit(normals).reshape(-1, 3, 3))


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def _choose_view(corners: FloatArray, brightness: FloatArray, lights: tuple[Ray, ...], diagonal: float) -> FloatArray:
    """Unit vector to the eye: towards the lit side, turned aside and a bit up, entry points in view."""
    lit = _lit_side(corners, brightness, lights)
    entries = np.array([ray.end for ray in lights if not ray.is_point][:MOST_ENTRIES]).reshape(-1, 3)
    best, most = _oblique(lit, TURNS[0]), -1
    for turn in TURNS:
        view = _oblique(lit, turn)
        seen = int(_visible(corners, entries, view, diagonal).sum())
        if seen > most:
            best, most = view, seen
        if seen == len(entries):
            break
    return best


def _lit_side(corners: FloatArray, brightness: FloatArray, lights: tuple[Ray, ...]) -> FloatArray:
    """Where the light comes from: against the arrows, or else where most of it leaves; may be zero."""
    back = sum((_unit(np.subtract(ray.start, ray.end)) for ray in lights), np.zeros(3))
    if np.linalg.norm(back) > 0.1:
        return _unit(back)
    power = np.clip(np.nan_to_num(brightness), 0.0, None)[:, None] * np.cross(
        corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    )
    mean = power.sum(axis=0) / max(float(np.linalg.norm(power, axis=1).sum()), np.finfo(float).tiny)
    # A body that glows nearly evenly has no lit side.
    return _unit(mean) if np.linalg.norm(mean) > 0.05 else np.zeros(3)


def _oblique(lit: FloatArray, turn: float) -> FloatArray:
    """A view `turn` degrees about the vertical from the lit side, and from above or, if it must be, below."""
    level = math.hypot(lit[0], lit[1])
    height = math.degrees(math.atan2(lit[2], level))
    azimuth = math.degrees(math.atan2(lit[1], lit[0])) if level > 0.2 else -90.0
    around = math.radians(azimuth + turn)
    above = math.radians(18.0 + (0.28 if height > 0 else 0.65) * height)
    return np.array([math.cos(above) * math.cos(around), math.cos(above) * math.sin(around), math.sin(above)])


def _visible(corners: FloatArray, entries: FloatArray, toward: FloatArray, diagonal: float) -> BoolArray:
    """Whether nothing of the body hides an entry point from the eye."""
    count = len(corners)
    free = np.empty(len(entries), dtype=bool)
    for i, entry in enumerate(entries):
        distance, _ = cross_segments(
            np.broadcast_to(entry, (count, 3)), np.broadcast_to(toward, (count, 3)), corners, slack=0.0
        )
        free[i] = not (distance > 2e-3 * diagonal).any()
    return free


def _camera(points: FloatArray, toward: FloatArray) -> Camera:
    """The camera that looks against `toward`, z up, with all points within the panel."""
    right = _unit(np.cross([0.0, 0.0, 1.0], toward))
    up = np.cross(toward, right)
    placed = points @ np.column_stack([right, up, toward])
    low, high = placed.min(axis=0), placed.max(axis=0)
    room = 1.0 - 2.0 * MARGIN
    pixel = max((high[0] - low[0]) / (room * PANEL[0]), (high[1] - low[1]) / (room * PANEL[1]))
    middle = 0.5 * (low + high)
    return Camera(right, up, toward, np.column_stack([right, up, toward]) @ middle, float(pixel))


def _arrow(tail: FloatArray, tip: FloatArray, radius: float, sides: int = 24) -> tuple[FloatArray, FloatArray]:
    """Corners and normals (k, 3, 3) of an arrow: a shaft, and a head that ends at `tip`."""
    axis = _unit(tip - tail)
    across = _unit(np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]))
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    spoke = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(axis, across)
    neck, head = tip - 7.0 * radius * axis, 2.6 * radius
    rings = [tail, tail + radius * spoke, neck + radius * spoke, neck + head * spoke, tip]
    slant = _unit(spoke + head / (7.0 * radius) * axis)
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
