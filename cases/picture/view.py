"""From where a picture shows a body: a parallel projection, chosen by the light or by the case file."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.cases.file.schema.lights import CameraSpec
from tetlux.meshing.arrays import BoolArray, FloatArray, Vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.search.proximity import cross_segments
from tetlux.meshing.surface.surface import Surface

# Pixels of the panel that shows the body.
PANEL = (1150, 880)
# Where the lamp stands, along the camera's axes: above the viewer's left shoulder.
LAMP = (-0.35, 0.5, 0.8)
# Degrees about the vertical from the lit side to the eye, the best first.
TURNS = (50.0, -50.0, 25.0, -25.0, 80.0, -80.0, 0.0)
# So many entry points are looked for; each costs a test of all triangles.
MOST_ENTRIES = 12
# The margin round the body, as a share of the panel.
MARGIN = 0.05
# Of the body's diagonal: what lies nearer in front of a point of the surface is that surface itself.
SKIN = 2e-3
# Degrees above the horizon of a camera that is given by its azimuth alone.
DEFAULT_ELEVATION = 20.0
UPRIGHT: Vector = (0.0, 0.0, 1.0)


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
        return unit(np.column_stack([self.right, self.up, self.toward]) @ LAMP)

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels right of the panel's left edge and below its top edge, and nearness in pixels, (n, 3)."""
        offset = np.asarray(points) - self.center
        across, above, near = (offset @ axis / self.pixel for axis in (self.right, self.up, self.toward))
        return np.column_stack([0.5 * PANEL[0] + across, 0.5 * PANEL[1] - above, near])


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 3) of length 1; zeros stay zeros."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def upright_axes(up: Vector) -> FloatArray:
    """Three unit vectors (3, 3): the x axis laid level, the one 90 degrees anticlockwise of it seen from above, up.

    Where x itself is up the y axis takes its place. With y up, -90 degrees is z: the front of a model, as with z up
    it is -y.
    """
    above = unit(np.asarray(up, dtype=float))
    first = np.eye(3)[1 if abs(above[0]) > 0.9 else 0]
    first = unit(first - (first @ above) * above)
    return np.stack([first, np.cross(above, first), above])


def direction_of(azimuth: float, elevation: float, up: Vector) -> FloatArray:
    """Unit vector at so many degrees anticlockwise of the first of `upright_axes`, and so many above the horizon."""
    around, above = math.radians(azimuth), math.radians(elevation)
    level = math.cos(above)
    return np.array([level * math.cos(around), level * math.sin(around), math.sin(above)]) @ upright_axes(up)


def toward_camera(camera: CameraSpec, surface: Surface, up: Vector) -> FloatArray | None:
    """Unit vector from the body to the eye, or None where that is at the body's very middle, as in a ring's hole.

    Raises
    ------
    InputError
        If it is inside the body.
    """
    if camera.position is None:
        assert camera.azimuth is not None
        elevation = DEFAULT_ELEVATION if camera.elevation is None else camera.elevation
        return direction_of(camera.azimuth, elevation, up)
    place = np.array(camera.position)
    if surface.contains(place[None])[0]:
        raise InputError("the camera is inside the body, where no light of its surface goes; move it outside.")
    away = place - 0.5 * (surface.points.min(axis=0) + surface.points.max(axis=0))
    return unit(away) if np.linalg.norm(away) > 1e-6 * surface.diagonal else None


def choose_view(
    corners: FloatArray, brightness: FloatArray, lights: tuple[Ray, ...], diagonal: float, up: Vector
) -> FloatArray:
    """Unit vector to the eye: towards the lit side, turned aside and a bit up, entry points in view.

    Parameters
    ----------
    corners : (m, 3, 3) ndarray
        Of the body's triangles.
    brightness : (m,) ndarray
    lights : tuple of Ray
    diagonal : float
        Of the body, unit.
    up : (3,) floats
    """
    lit = _lit_side(corners, brightness, lights)
    entries = np.array([ray.end for ray in lights if not ray.is_point][:MOST_ENTRIES]).reshape(-1, 3)
    best, most = _oblique(lit, TURNS[0], up), -1
    for turn in TURNS:
        view = _oblique(lit, turn, up)
        seen = int(in_view(corners, entries, view, diagonal).sum())
        if seen > most:
            best, most = view, seen
        if seen == len(entries):
            break
    return best


def _lit_side(corners: FloatArray, brightness: FloatArray, lights: tuple[Ray, ...]) -> FloatArray:
    """Where the light comes from: against the arrows, or else where most of it leaves; may be zero."""
    back = sum((unit(np.subtract(ray.start, ray.end)) for ray in lights), np.zeros(3))
    if np.linalg.norm(back) > 0.1:
        return unit(back)
    power = np.clip(np.nan_to_num(brightness), 0.0, None)[:, None] * np.cross(
        corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    )
    mean = power.sum(axis=0) / max(float(np.linalg.norm(power, axis=1).sum()), np.finfo(float).tiny)
    # A body that glows nearly evenly has no lit side.
    return unit(mean) if np.linalg.norm(mean) > 0.05 else np.zeros(3)


def _oblique(lit: FloatArray, turn: float, up: Vector) -> FloatArray:
    """A view `turn` degrees about the vertical from the lit side, and from above or, if it must be, below."""
    x, y, z = upright_axes(up) @ lit
    level = math.hypot(x, y)
    height = math.degrees(math.atan2(z, level))
    azimuth = math.degrees(math.atan2(y, x)) if level > 0.2 else -90.0
    return direction_of(azimuth + turn, 18.0 + (0.28 if height > 0 else 0.65) * height, up)


def in_view(corners: FloatArray, places: FloatArray, toward: FloatArray, diagonal: float) -> BoolArray:
    """Whether nothing of a body of triangles (m, 3, 3) hides places of its surface (n, 3) from the eye, (n,)."""
    count = len(corners)
    free = np.empty(len(places), dtype=bool)
    for i, place in enumerate(places):
        distance, _ = cross_segments(
            np.broadcast_to(place, (count, 3)), np.broadcast_to(toward, (count, 3)), corners, slack=0.0
        )
        free[i] = not (distance > SKIN * diagonal).any()
    return free


def camera_at(points: FloatArray, toward: FloatArray, up: Vector) -> Camera:
    """The camera that looks against `toward`, with `up` upright and all points (n, 3) within the panel."""
    first, _, above = upright_axes(up)
    right = np.cross(above, toward)
    # From right above or below nothing is upright: the first axis runs to the right.
    right = unit(right) if np.linalg.norm(right) > 1e-6 else first
    upward = np.cross(toward, right)
    axes = np.column_stack([right, upward, toward])
    placed = points @ axes
    low, high = placed.min(axis=0), placed.max(axis=0)
    room = 1.0 - 2.0 * MARGIN
    pixel = max((high[0] - low[0]) / (room * PANEL[0]), (high[1] - low[1]) / (room * PANEL[1]))
    return Camera(right, upward, toward, axes @ (0.5 * (low + high)), float(pixel))
