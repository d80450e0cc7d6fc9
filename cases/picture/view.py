"""The camera of a picture: a parallel projection, chosen by the light or given by the case file."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.cases.file.schema.camera import CameraSpec
from tetlux.meshing.arrays import BoolArray, FloatArray, Vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.search.rays import RayCaster
from tetlux.meshing.surface.surface import Surface

# Pixels of the panel that shows the body, unless the picture has a size of its own.
PANEL = (1150, 880)
# Direction to the lamp in the camera's axes: above the viewer's left shoulder.
LAMP = (-0.35, 0.5, 0.8)
# Angles about the vertical between lit side and eye, degrees, the best first.
TURNS = (50.0, -50.0, 25.0, -25.0, 80.0, -80.0, 0.0)
# This many entry points are tested for visibility.
MOST_ENTRIES = 12
# Margin around the body, as a share of the panel.
MARGIN = 0.05
# An intersection nearer to a point of the surface than this share of the diagonal is that surface itself.
SKIN = 2e-3
# Elevation of a camera that is given by its azimuth alone, degrees.
DEFAULT_ELEVATION = 20.0
UPRIGHT: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Ray:
    """A light as it is drawn: an arrow that ends where it meets the body, or a point (start = end)."""

    start: Vector
    end: Vector

    @property
    def is_point(self) -> bool:
        """Whether the light is drawn as a point."""
        return self.start == self.end


@dataclass(frozen=True, eq=False)
class Camera:
    """A parallel projection.

    Parameters
    ----------
    right, up, toward : (3,) ndarray
        Unit vectors: along the picture's rows, up its columns, and from the body to the eye.
    center : (3,) ndarray
        The point at the centre of the panel.
    pixel : float
        Size of a pixel of the panel, unit of length.
    panel : (int, int)
        Pixels of the panel.
    """

    right: FloatArray
    up: FloatArray
    toward: FloatArray
    center: FloatArray
    pixel: float
    panel: tuple[int, int] = PANEL

    @property
    def lamp(self) -> FloatArray:
        """Unit vector to the lamp that shades the body."""
        return unit(np.column_stack([self.right, self.up, self.toward]) @ LAMP)

    def project(self, points: FloatArray) -> FloatArray:
        """Column and row in the panel, from its left and top edges, and nearness to the eye, pixels, (n, 3)."""
        offset = np.asarray(points) - self.center
        across, above, near = (offset @ axis / self.pixel for axis in (self.right, self.up, self.toward))
        return np.column_stack([0.5 * self.panel[0] + across, 0.5 * self.panel[1] - above, near])


def unit(vectors: FloatArray) -> FloatArray:
    """Normalize vectors (..., 3); zeros stay zeros."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def upright_axes(up: Vector) -> FloatArray:
    """Three unit vectors (3, 3): the x axis made horizontal, that turned by 90 degrees about `up`, and `up`.

    If x itself is up, the y axis takes its place. An azimuth of -90 degrees, the front of most models, is then -y if
    z is up and z if y is up.
    """
    above = unit(np.asarray(up, dtype=float))
    first = np.eye(3)[1 if abs(above[0]) > 0.9 else 0]
    first = unit(first - (first @ above) * above)
    return np.stack([first, np.cross(above, first), above])


def direction_of(azimuth: float, elevation: float, up: Vector) -> FloatArray:
    """Unit vector at an azimuth, anticlockwise from the first of `upright_axes`, and an elevation, both degrees."""
    around, above = math.radians(azimuth), math.radians(elevation)
    level = math.cos(above)
    return np.array([level * math.cos(around), level * math.sin(around), math.sin(above)]) @ upright_axes(up)


def toward_camera(camera: CameraSpec, surface: Surface, up: Vector) -> FloatArray | None:
    """Unit vector from the body to the eye; None if the camera is at the centre of the bounding box, as in a ring.

    Raises
    ------
    InputError
        If the camera is inside the body.
    """
    if camera.position is None:
        assert camera.azimuth is not None
        elevation = DEFAULT_ELEVATION if camera.elevation is None else camera.elevation
        return direction_of(camera.azimuth, elevation, up)
    place = np.array(camera.position)
    if surface.contains(place[None])[0]:
        raise InputError("the camera is inside the body; move it outside.")
    away = place - 0.5 * (surface.points.min(axis=0) + surface.points.max(axis=0))
    return unit(away) if np.linalg.norm(away) > 1e-6 * surface.diagonal else None


def choose_view(
    corners: FloatArray, brightness: FloatArray, lights: tuple[Ray, ...], diagonal: float, up: Vector
) -> FloatArray:
    """Choose the unit vector to the eye: from the lit side, turned aside and raised, with most entry points visible.

    Parameters
    ----------
    corners : (m, 3, 3) ndarray
        Corners of the body's triangles.
    brightness : (m,) ndarray
        Exitance of the triangles, W/unit².
    lights : tuple of Ray
    diagonal : float
        Diagonal of the body, unit.
    up : (3,) floats

    Returns
    -------
    (3,) ndarray
    """
    lit = _lit_side(corners, brightness, lights)
    entries = np.array([ray.end for ray in lights if not ray.is_point][:MOST_ENTRIES]).reshape(-1, 3)
    best, most = _oblique(lit, TURNS[0], up), -1
    body = caster_of(corners)
    for turn in TURNS:
        view = _oblique(lit, turn, up)
        visible = int(in_view(body, entries, view, diagonal).sum())
        if visible > most:
            best, most = view, visible
        if visible == len(entries):
            break
    return best


def _lit_side(corners: FloatArray, brightness: FloatArray, lights: tuple[Ray, ...]) -> FloatArray:
    """Direction that the light comes from: against the arrows, else where most of it leaves; zero if there is none."""
    back = sum((unit(np.subtract(ray.start, ray.end)) for ray in lights), np.zeros(3))
    if np.linalg.norm(back) > 0.1:
        return unit(back)
    power = np.clip(np.nan_to_num(brightness), 0.0, None)[:, None] * np.cross(
        corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    )
    mean = power.sum(axis=0) / max(float(np.linalg.norm(power, axis=1).sum()), np.finfo(float).tiny)
    # A body with nearly uniform exitance has no lit side.
    return unit(mean) if np.linalg.norm(mean) > 0.05 else np.zeros(3)


def _oblique(lit: FloatArray, turn: float, up: Vector) -> FloatArray:
    """Direction to the eye at `turn` degrees about the vertical from the lit side, raised unless that is far below."""
    x, y, z = upright_axes(up) @ lit
    level = math.hypot(x, y)
    height = math.degrees(math.atan2(z, level))
    azimuth = math.degrees(math.atan2(y, x)) if level > 0.2 else -90.0
    return direction_of(azimuth + turn, 18.0 + (0.28 if height > 0 else 0.65) * height, up)


def in_view(body: RayCaster, places: FloatArray, toward: FloatArray, diagonal: float) -> BoolArray:
    """Whether places (n, 3) on a body are visible from the direction `toward`, (n,)."""
    _, hit = body.first(places + SKIN * diagonal * toward, np.broadcast_to(toward, places.shape))
    return hit < 0


_last_cast: tuple[FloatArray, RayCaster] | None = None


def caster_of(corners: FloatArray) -> RayCaster:
    """Triangles (m, 3, 3), prepared for `in_view`; the last ones are kept, which a picture asks for three times."""
    global _last_cast  # noqa: PLW0603
    last = _last_cast
    if last is None or not np.array_equal(last[0], corners):
        last = _last_cast = corners, RayCaster(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    return last[1]


def camera_at(points: FloatArray, toward: FloatArray, up: Vector, panel: tuple[int, int] = PANEL) -> Camera:
    """The camera that looks from the direction `toward`, with all points (n, 3) within its panel."""
    first, _, above = upright_axes(up)
    right = np.cross(above, toward)
    # Seen from straight above or below, the first axis runs to the right.
    right = unit(right) if np.linalg.norm(right) > 1e-6 else first
    upward = np.cross(toward, right)
    axes = np.column_stack([right, upward, toward])
    placed = points @ axes
    low, high = placed.min(axis=0), placed.max(axis=0)
    room = 1.0 - 2.0 * MARGIN
    pixel = max((high[0] - low[0]) / (room * panel[0]), (high[1] - low[1]) / (room * panel[1]))
    return Camera(right, upward, toward, axes @ (0.5 * (low + high)), float(pixel), panel)
