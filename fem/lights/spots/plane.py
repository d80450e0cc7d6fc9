"""Points and distances on the plane across a beam.

Offsets (q, 3) are relative to a point on the axis; `direction` is a unit vector (3,) along it.
"""

import numpy as np

from tetlux.fem.inputs import as_vector
from tetlux.meshing.arrays import FloatArray, Vector, perpendicular_axes
from tetlux.meshing.describe import as_text
from tetlux.meshing.errors import InputError

# The golden angle, 137.5 degrees, in half turns: points that differ by it spread evenly around a circle.
GOLDEN_ANGLE = 3.0 - np.sqrt(5.0)


def low_discrepancy(count: int) -> FloatArray:
    """Points (count, 2) of the unit square, spread evenly also along each axis (Roberts' R2 sequence)."""
    # Powers of the reciprocal of the plastic number.
    return np.asarray(np.modf(0.5 + np.outer(np.arange(count), [0.7548776662466927, 0.5698402909980532]))[0])


def sunflower(count: int, radius: float, direction: FloatArray) -> FloatArray:
    """Offsets (count, 3) spread evenly over a disc across a direction, by the golden angle (Vogel 1979)."""
    index = np.arange(count)
    distance, angle = radius * np.sqrt((index + 0.5) / count), index * np.pi * GOLDEN_ANGLE
    first, second = perpendicular_axes(direction)
    return np.asarray(np.outer(distance * np.cos(angle), first) + np.outer(distance * np.sin(angle), second))


def prepend_center(offsets: FloatArray) -> FloatArray:
    """Offsets (q, 3) after that of the center, (q + 1, 3)."""
    return np.vstack([np.zeros((1, 3)), offsets])


def squared_distances(offsets: FloatArray, direction: FloatArray) -> FloatArray:
    """Squared distances (q,) of offsets (q, 3) from the axis."""
    return np.asarray(np.einsum("ij,ij->i", offsets, offsets) - (offsets @ direction) ** 2)


def distances_to_disc(offsets: FloatArray, direction: FloatArray, radius: float) -> FloatArray:
    """Distances (q,) of offsets (q, 3) from a disc across the axis, 0 inside."""
    across = np.sqrt(np.maximum(squared_distances(offsets, direction), 0.0))
    return np.asarray(np.maximum(across - radius, 0.0))


def distances_to_rectangle(
    offsets: FloatArray, axes: tuple[FloatArray, FloatArray], size: tuple[float, float]
) -> FloatArray:
    """Distances (q,) of offsets (q, 3) from a rectangle with sides along two unit vectors, 0 inside."""
    past = [np.maximum(np.abs(offsets @ axis) - 0.5 * side, 0.0) for axis, side in zip(axes, size, strict=True)]
    return np.hypot(*past)


def right_and_up(direction: FloatArray, up: Vector) -> tuple[FloatArray, FloatArray]:
    """Unit vectors to the right and up on the plane, as seen along the beam.

    Raises
    ------
    InputError
        If `up` is along the beam.
    """
    raised = as_vector(up, "up")
    raised = raised - (raised @ direction) * direction
    length = float(np.linalg.norm(raised))
    if not length > 1e-6 * float(np.linalg.norm(up)):
        raise InputError(
            f"up of the spot is {as_text(up)}, along the beam; give another direction that is up.", field="up"
        )
    raised /= length
    return np.cross(direction, raised), raised
