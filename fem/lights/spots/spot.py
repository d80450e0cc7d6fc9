"""`Spot`: the cross-section of a collimated beam."""

import math
from typing import Protocol

from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.errors import InputError

# Pieces of facets across the sharp edge of a spot are at most this share of the spot's width. With the samples that
# are taken in each piece (`triangles.SAMPLES`) the power of a spot on a flat face is right to 0.2 %.
EDGE_SHARE = 1.0 / 8.0


class Spot(Protocol):
    """An irradiance pattern on the plane across a beam.

    Offsets (q, 3) are places relative to the center of the spot, unit. Their component along the beam's `direction`, a
    unit vector (3,), does not count.
    """

    @property
    def center(self) -> Vector:
        """A point on the axis of the beam, (3,), unit."""
        ...

    @property
    def reach(self) -> float:
        """Distance from the axis beyond which it is dark everywhere, unit."""
        ...

    @property
    def detail(self) -> float:
        """Length over which the irradiance varies, unit."""
        ...

    @property
    def edge_size(self) -> float:
        """Largest size of a facet's piece that a sharp edge of the spot may cross, unit; inf without sharp edges."""
        ...

    @property
    def area(self) -> float:
        """Integral of `brightness` over the plane, unit²: power over the irradiance where it is brightest."""
        ...

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """Compute the irradiance relative to that of the beam.

        Parameters
        ----------
        offsets : (q, 3) ndarray
        direction : (3,) ndarray

        Returns
        -------
        (q,) ndarray
            0 where it is dark.
        """
        ...

    def distances(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """Bound the distances to the bright part of the plane from below.

        Parameters
        ----------
        offsets : (q, 3) ndarray
        direction : (3,) ndarray

        Returns
        -------
        (q,) ndarray
            0 within it, unit.
        """
        ...

    def samples(self, count: int, direction: FloatArray) -> FloatArray:
        """Choose bright places.

        Parameters
        ----------
        count : int
            About how many.
        direction : (3,) ndarray

        Returns
        -------
        (q, 3) ndarray
            Offsets, that of the center first if it is bright.
        """
        ...


def check_length(value: float, name: str) -> None:
    """Refuse a length of a spot that is not positive and finite.

    Parameters
    ----------
    value : float
    name : str
        What the message calls it.

    Raises
    ------
    InputError
    """
    if not 0 < value < math.inf:
        raise InputError(f"{name} of the spot is {value:g}; give a length greater than 0.", field=name)
