"""Checks of places, directions and powers that users give."""

import math

import numpy as np

from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.errors import InputError

# Relative error that is wanted where no tolerance is given.
DEFAULT_TOLERANCE = 0.02
# Beyond this, in any unit, products of coordinates overflow.
FARTHEST = 1e30
# Squares of powers below this underflow, and squares of powers above its inverse overflow.
FAINTEST = 1e-60


def as_vector(value: Vector, name: str) -> FloatArray:
    """Convert three coordinates to an array.

    Parameters
    ----------
    value : (3,) floats
    name : str
        What the error calls them.

    Returns
    -------
    (3,) ndarray

    Raises
    ------
    InputError
        If they are not three finite numbers, or out of range.
    """
    vector = _finite(value, name)
    if np.abs(vector).max() > FARTHEST:
        raise InputError(
            f"{name} is {vector.tolist()}; coordinates reach from -{FARTHEST:g} to {FARTHEST:g}.", field=name
        )
    return vector


def _finite(value: Vector, name: str) -> FloatArray:
    try:
        vector = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is {value!r}; give three finite coordinates.", field=name) from error
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{name} is {vector.tolist()}; give three finite coordinates.", field=name)
    return vector


def unit_vector(value: Vector, name: str) -> FloatArray:
    """Normalize a direction to length 1.

    Parameters
    ----------
    value : (3,) floats
    name : str
        What the error calls it.

    Returns
    -------
    (3,) ndarray

    Raises
    ------
    InputError
        If it is zero, or not three finite numbers.
    """
    vector = _finite(value, name)
    largest = np.abs(vector).max()
    if not largest > 0:
        raise InputError(f"{name} is zero; give the {name} in which the light travels.", field=name)
    vector = vector / largest  # the square of a large component would overflow
    vector[np.abs(vector) < 1e-30] = 0.0  # so that divisions by a component do not overflow
    return np.asarray(vector / np.linalg.norm(vector))


def check_positive(value: float, name: str, unit: str) -> None:
    """Refuse a value that is not a positive number, or out of range."""
    if not math.isfinite(value) or value <= 0:
        raise InputError(f"{name} is {value:g}; give a number of {unit} greater than 0.", field=name)
    if not FAINTEST <= value <= 1.0 / FAINTEST:
        limits = f"between {FAINTEST:g} and {1.0 / FAINTEST:g}"
        raise InputError(f"{name} is {value:g}; give a number of {unit} {limits}.", field=name)
