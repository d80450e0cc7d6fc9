"""A uniform, round spot."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.fem.lights.spots.plane import squared_distances
from tetlux.fem.lights.spots.round import RoundSpot
from tetlux.fem.lights.spots.spot import EDGE_SHARE
from tetlux.meshing.arrays import FloatArray


@dataclass(frozen=True)
class Disc(RoundSpot):
    """A uniform, round spot.

    Parameters
    ----------
    center : (3,) floats
        A point on the beam's axis, unit.
    radius : float
        Radius of the spot, unit.

    Raises
    ------
    InputError
        If a coordinate is not finite or a length not positive.

    Examples
    --------
    >>> from tetlux.fem import CollimatedBeam
    >>> beam = CollimatedBeam(direction=(0.0, 0.0, -1.0), spot=Disc(center=(0.0, 0.0, 20.0), radius=2.0))
    >>> round(beam.spot.area, 4)  # unit², power over irradiance
    12.5664
    """

    @property
    def reach(self) -> float:
        """See `Spot`."""
        return self.radius

    @property
    def detail(self) -> float:
        """See `Spot`."""
        return self.radius / 2.0

    @property
    def edge_size(self) -> float:
        """See `Spot`."""
        return 2.0 * EDGE_SHARE * self.radius

    @property
    def area(self) -> float:
        """See `Spot`."""
        return math.pi * self.radius**2

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return np.where(squared_distances(offsets, direction) <= self.radius**2, 1.0, 0.0)
