"""An isotropic point source inside the body."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.lights.arrows import Arrows
from tetlux.fem.media.varying import as_text
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface

# A point nearer to the surface than this share of the body's diagonal is on it.
ON_SURFACE = 1e-9
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


@dataclass(frozen=True)
class PointSource:
    """An isotropic point: ``Q0 = power delta(x - position)``, ``Q1 = 0`` (CS667 notes, eqs. 4 and 7).

    Parameters
    ----------
    position : (3,) floats
        Inside the body, unit.
    power : float
        W.

    Raises
    ------
    InputError
        If a coordinate is not finite or the power not positive; and, when solved, if it lies outside.
    """

    position: Vector
    power: float = 1.0

    def __post_init__(self) -> None:
        as_vector(self.position, "position")
        check_positive(self.power, "power", "watts")

    def arrows(self, surface: Surface) -> Arrows:
        """A point."""
        del surface
        return Arrows(as_vector(self.position, "position")[None])

    def deposit_in(self, body: Body) -> Deposit:
        """All of its power at one point."""
        surface, position = body.surface, as_vector(self.position, "position")
        if not surface.contains(position[None])[0]:
            raise InputError(
                f"the point source at {as_text(position)} lies outside the body, which spans {surface.extent}; "
                "move it inside."
            )
        nearest, _ = surface.closest(position[None])
        depth = float(np.linalg.norm(nearest[0] - position))
        if depth <= ON_SURFACE * surface.diagonal:
            raise InputError(f"the point source at {as_text(position)} lies on the surface; move it inside.")
        mean_free_path = float(body.mean_free_paths(position[None])[0])
        return Deposit(
            incident=self.power,
            points=position[None],
            powers=np.array([self.power]),
            resolution=max(depth, min(0.1 * mean_free_path, 0.02 * surface.diagonal)),
        )
