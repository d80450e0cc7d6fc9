"""A Gaussian spot."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.fem.lights.spots.plane import squared_distances
from tetlux.fem.lights.spots.round import RoundSpot
from tetlux.meshing.arrays import FloatArray

# The spot ends at this multiple of its radius, where the irradiance is exp(-8), 0.03 %, of that on the axis.
CUT_OFF = 2.0


@dataclass(frozen=True)
class Gaussian(RoundSpot):
    """A Gaussian spot, ``exp(-2 r²/radius²)``, cut off at twice its radius.

    Parameters
    ----------
    center : (3,) floats
        A point on the beam's axis, unit.
    radius : float
        Distance from the axis at which the irradiance is 1/e² of that on the axis, unit.

    Raises
    ------
    InputError
        If a coordinate is not finite or a length not positive.

    Examples
    --------
    >>> round(Gaussian(center=(0.0, 0.0, 20.0), radius=2.0).area, 4)  # pi radius²/2, but for the cut-off
    6.2811
    """

    @property
    def reach(self) -> float:
        """See `Spot`."""
        return CUT_OFF * self.radius

    @property
    def detail(self) -> float:
        """See `Spot`."""
        return self.radius / 4.0

    edge_size = math.inf

    @property
    def area(self) -> float:
        """See `Spot`."""
        return 0.5 * math.pi * self.radius**2 * (1.0 - math.exp(-2.0 * CUT_OFF**2))

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        across = squared_distances(offsets, direction)
        share = np.exp(-2.0 * across / self.radius**2)
        return np.where(across <= self.reach**2, share, 0.0)
