"""Checks of the arguments of closed forms, which raise an `InputError` that names the argument."""

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError

Face = Literal["front", "back"]


def positive_number(name: str, value: float) -> float:
    """Return `value` if it is finite and greater than 0."""
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{name} is {value:g}; give a finite number greater than 0.", field=name)
    return float(value)


def number_within(name: str, value: float, low: float, high: float, body: str) -> float:
    """Return `value` if it lies strictly between `low` and `high`, the boundaries of a body of that name."""
    if not low < value < high:
        raise InputError(
            f"{name} is {value:g}, which is not inside the {body}; give a value between {low:g} and {high:g}.",
            field=name,
        )
    return float(value)


def numbers(name: str, values: npt.ArrayLike, low: float = -math.inf, high: float = math.inf) -> FloatArray:
    """Return `values` as an array if all are finite and from `low` to `high`, both included."""
    array = np.asarray(values, dtype=float)
    if not np.all(np.isfinite(array)):
        raise InputError(f"{name} holds a value that is not finite; remove it.", field=name)
    if np.any((array < low) | (array > high)):
        worst = array[(array < low) | (array > high)].flat[0]
        raise InputError(f"{name} holds {worst:g}; give values from {low:g} to {high:g}.", field=name)
    return array


def points(values: npt.ArrayLike) -> FloatArray:
    """Return `values` as an (n, 3) array."""
    array = numbers("points", values)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"points has the shape {array.shape}; give an array of shape (n, 3).", field="points")
    return array


def points_in_slab(values: npt.ArrayLike, low: float, high: float = math.inf) -> tuple[FloatArray, FloatArray]:
    """Distance from the z axis (n,) and z (n,) of points (n, 3) whose z is from `low` to `high`."""
    where = points(values)
    z = numbers("the z of points", where[:, 2], low=low, high=high)
    return np.hypot(where[:, 0], where[:, 1]), z


def source_in_body(radius: float, source_radius: float, body: str) -> tuple[float, float]:
    """Return the radius of a ball or cylinder, and the distance of its source from the centre or axis in radii."""
    a = positive_number("radius", radius)
    return a, number_within("source_radius", source_radius, -1e-300, a, body) / a


def source_in_slab(thickness: float, depth: float) -> tuple[float, float]:
    """Return the thickness of a slab and the depth of its source."""
    length = positive_number("thickness", thickness)
    return length, number_within("depth", depth, 0.0, length, "slab")


def core_in_ball(core_radius: float, radius: float) -> tuple[float, float]:
    """Return the radii of a core and of the ball around it."""
    b = positive_number("radius", radius)
    return number_within("core_radius", core_radius, 0.0, b, "ball"), b


def is_back(face: Face) -> bool:
    """Whether a face of a slab is its back."""
    if face not in ("front", "back"):
        raise InputError(f'face is "{face}"; it is "front" or "back".', field="face")
    return face == "back"


def too_close_source(fraction: float, body: str) -> InputError:
    """The error for a source at `fraction` of the radius, so close below the surface that a series is too long."""
    return InputError(
        f"the source is {1.0 - fraction:.1g} of the radius below the surface of the {body}, too close for its series; "
        "use half_space for it.",
        field="source_radius",
    )
