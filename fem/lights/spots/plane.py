"""Places and distances on the plane across a beam."""

import numpy as np

from tetlux.fem.inputs import as_vector
from tetlux.meshing.arrays import FloatArray, Vector, perpendicular_axes
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError


def scattered(count: int) -> FloatArray:
    """Points (count, 2) of the unit square, evenly spread along each axis too, and along slanting lines."""
    # Roberts' additive sequence of the plastic number.
    return np.asarray(np.modf(0.5 + np.outer(np.arange(count), [0.7548776662466927, 0.5698402909980532]))[0])


def squared(offsets: FloatArray, direction: FloatArray) -> FloatArray:
    """Squared lengths of offsets (q, 3) across a direction, (q,)."""
    return np.asarray(np.einsum("ij,ij->i", offsets, offsets) - (offsets @ direction) ** 2)


def beyond(offsets: FloatArray, direction: FloatArray, radius: float) -> FloatArray:
    """How far from a disc offsets (q, 3) are, across a direction, (q,)."""
    across = np.sqrt(np.maximum(squared(offsets, direction), 0.0))
    return np.asarray(np.maximum(across - radius, 0.0))


def with_middle(offsets: FloatArray) -> FloatArray:
    """Offsets (q, 3) after that of the middle itself, (q + 1, 3)."""
    return np.vstack([np.zeros((1, 3)), offsets])


def sunflower(count: int, radius: float, direction: FloatArray) -> FloatArray:
    """Places (count, 3) that cover a disc across a direction evenly, no two on one radius (Vogel 1979)."""
    index = np.arange(count)
    distance, angle = radius * np.sqrt((index + 0.5) / count), index * np.pi * (3.0 - np.sqrt(5.0))
    first, second = perpendicular_axes(direction)
    return np.asarray(np.outer(distance * np.cos(angle), first) + np.outer(distance * np.sin(angle), second))


def axes(direction: FloatArray, up: Vector) -> tuple[FloatArray, FloatArray]:
    """Unit vectors to the right and up on the plane across a beam, as one sees it who looks along the beam."""
    raised = as_vector(up, "up")
    raised = raised - (raised @ direction) * direction
    length = float(np.linalg.norm(raised))
    if not length > 1e-6 * float(np.linalg.norm(up)):
        raise InputError(
            f"up of the spot is {as_text(up)}, along the beam; give another direction that is up.", field="up"
        )
    raised /= length
    return np.cross(direction, raised), raised


def outside(offsets: FloatArray, axes: tuple[FloatArray, FloatArray], size: tuple[float, float]) -> FloatArray:
    """How far from a rectangle offsets (q, 3) are, (q,)."""
    past = [np.maximum(np.abs(offsets @ axis) - 0.5 * side, 0.0) for axis, side in zip(axes, size, strict=True)]
    return np.hypot(*past)
