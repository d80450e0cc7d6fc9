"""`Spot`: what a beam's cross-section says of itself."""

import math
from typing import Protocol

from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.errors import InputError

# Parts of facets that an edge crosses are as small as this share of a spot's width. With the samples that
# `CollimatedBeam` takes in each, the power of a spot on a flat face is right to 0.2 %.
EDGE = 1.0 / 8.0


class Spot(Protocol):
    """A pattern on the plane across a beam."""

    @property
    def center(self) -> Vector:
        """A point on the beam's axis, unit."""
        ...

    @property
    def reach(self) -> float:
        """Distance from the middle beyond which it is dark, unit."""
        ...

    @property
    def detail(self) -> float:
        """Length over which it changes, unit."""
        ...

    @property
    def edge(self) -> float:
        """Size of the parts that are still told apart where it has a sharp edge, unit; inf where it has none."""
        ...

    @property
    def area(self) -> float:
        """Integral of `brightness` over the plane, unit²: power over irradiance."""
        ...

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """Share of the full irradiance at offsets (q, 3) from the middle, across `direction`, (q,)."""
        ...

    def away(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """How far from the lit area these offsets (q, 3) are at least, across `direction`, (q,), unit."""
        ...

    def looks(self, count: int, direction: FloatArray) -> FloatArray:
        """Offsets (q, 3) of some bright places of it, its middle first if that is bright, across `direction`."""
        ...


def check_length(value: float, name: str) -> None:
    """Refuse what is no length of a spot."""
    if not 0 < value < math.inf:
        raise InputError(f"{name} of the spot is {value:g}; give a length greater than 0.", field=name)
