"""Checks of what users give: places, directions, powers."""

import math

import numpy as np

from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.errors import InputError

# Farther away, in whatever unit, products of coordinates overflow.
FARTHEST = 1e30
# Squares of fainter and brighter lights are no numbers any more.
FAINTEST = 1e-60


def as_vector(value: Vector, name: str) -> FloatArray:
    """Three coordinates as an array, or an InputError that names them."""
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
    """A direction of length 1, or an InputError that names it."""
    vector = _finite(value, name)
    largest = np.abs(vector).max()
    if not largest > 0:
        raise InputError(f"{name} is zero; give the {name} in which the light travels.", field=name)
    vector = vector / largest  # its square may be out of range
    vector[np.abs(vector) < 1e-30] = 0.0  # and what is divided by it
    return np.asarray(vector / np.linalg.norm(vector))


def check_positive(value: float, name: str, unit: str) -> None:
    """Refuse what is not a positive number."""
    if not math.isfinite(value) or value <= 0:
        raise InputError(f"{name} is {value:g}; give a number of {unit} greater than 0.", field=name)
    if not FAINTEST <= value <= 1.0 / FAINTEST:
        limits = f"between {FAINTEST:g} and {1.0 / FAINTEST:g}"
        raise InputError(f"{name} is {value:g}; give a number of {unit} {limits}.", field=name)
