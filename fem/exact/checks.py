"""Checks of arguments of the closed forms; a violation is an `InputError` of one sentence, which names the argument."""

import math

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError


def positive(name: str, value: float) -> float:
    """Return `value` if it is finite and greater than 0."""
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{name} is {value:g}; give a finite number greater than 0.", field=name)
    return float(value)


def within(name: str, value: float, low: float, high: float, body: str) -> float:
    """Return `value` if it lies strictly between `low` and `high`, which are the boundaries of `body`."""
    if not low < value < high:
        raise InputError(
            f"{name} is {value:g}, which is not inside the {body}; give a value between {low:g} and {high:g}.",
            field=name,
        )
    return float(value)


def numbers(name: str, values: npt.ArrayLike, low: float = -math.inf, high: float = math.inf) -> FloatArray:
    """Return `values` as an array if they all are numbers from `low` to `high`, both included."""
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
