"""Where parallel rays from outside enter a body."""

from collections.abc import Callable
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.surface import Surface

# Where the sine of the angle between ray and surface is less than this, a ray enters at the flat triangle, and not at
# the curved surface that the triangle approximates.
GRAZING = 0.1
# What is asked of a surface for single beams, which the runs of a sweep share; so many answers are kept.
_ANSWERS: WeakKeyDictionary[Surface, dict[bytes, object]] = WeakKeyDictionary()
MOST_KEPT = 10_000
Answer = TypeVar("Answer")


def contains_point(surface: Surface, point: FloatArray) -> bool:
    """Whether a point (3,) is inside of a surface; the answer is kept with the surface."""
    return _kept(surface, b"in" + point.tobytes(), lambda: bool(surface.contains(point[None])[0]))


def find_entry(surface: Surface, origin: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`find_entries` of one ray; the answer is kept with the surface."""

    def find() -> tuple[FloatArray, FloatArray]:
        points, normals = find_entries(surface, origin[None], direction)
        points.setflags(write=False)
        normals.setflags(write=False)
        return points, normals

    return _kept(surface, b"at" + origin.tobytes() + direction.tobytes(), find)


def _kept(surface: Surface, key: bytes, ask: Callable[[], Answer]) -> Answer:
    answers = _ANSWERS.setdefault(surface, {})
    if key not in answers:
        if len(answers) >= MOST_KEPT:
            answers.clear()
        answers[key] = ask()
    return answers[key]  # type: ignore[return-value]


def find_entries(
    surface: Surface, origins: FloatArray, direction: FloatArray, *, curved: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Find where parallel rays from outside first meet a surface.

    Parameters
    ----------
    surface : Surface
    origins : (r, 3) ndarray
        unit.
    direction : (3,) ndarray
        Unit vector.
    curved : bool
        Whether to continue to the curved surface that the triangles approximate.

    Returns
    -------
    points, normals : (e, 3) ndarray
        Of those rays that meet the surface; normals point outwards.
    """
    directions = np.broadcast_to(direction, origins.shape)
    distances, faces = surface.rays.first(origins, directions)
    met = (faces >= 0) & (surface.normals[faces] @ direction < 0)
    # From outside, a ray meets the back of a triangle only along a face or through an edge; such rays are intersected
    # again in double precision.
    unclear = ~met & ((faces >= 0) | (len(origins) == 1))
    for ray in np.flatnonzero(unclear).tolist():
        along, crossed = surface.crossings(origins[ray], direction)
        inward = np.flatnonzero(surface.normals[crossed] @ direction < 0)
        if len(inward):
            distances[ray], faces[ray], met[ray] = along[inward[0]], crossed[inward[0]], True
    points, faces = origins[met] + distances[met, None] * direction, faces[met]
    normals = surface.normals[faces]
    if not curved or len(points) == 0:
        return points, normals
    # Along the ray to the height of the curved surface above the triangle; grazing rays are nearly parallel to both.
    above, curved_normals = surface.on_curve(faces, points)
    slope = normals @ direction
    grazing = (slope > -GRAZING) | (curved_normals @ direction > -GRAZING)
    height = np.einsum("ij,ij->i", above - points, normals)
    step = np.where(grazing, 0.0, height / np.where(grazing, 1.0, slope))
    return points + step[:, None] * direction, np.where(grazing[:, None], normals, curved_normals)
