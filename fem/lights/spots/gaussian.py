"""A Gaussian spot."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.fem.inputs import as_vector
from tetlux.fem.lights.spots.plane import distances_to_disc, prepend_center, squared_distances, sunflower
from tetlux.fem.lights.spots.spot import check_length
from tetlux.meshing.arrays import FloatArray, Vector

# It is cut off where it has fallen to exp(-8), 0.03 %, of its middle.
GAUSSIAN_EDGE = 2.0


@dataclass(frozen=True)
class Gaussian:
    """A Gaussian spot, ``exp(-2 r²/radius²)``, cut off at twice its radius.

    Parameters
    ----------
    center : (3,) floats
        A point on the beam's axis, unit.
    radius : float
        Where irradiance has fallen to 1/e² of the middle's, unit.
    """

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        as_vector(self.center, "center")
        check_length(self.radius, "radius")

    @property
    def reach(self) -> float:
        """See `Spot`."""
        return GAUSSIAN_EDGE * self.radius

    @property
    def detail(self) -> float:
        """See `Spot`."""
        return self.radius / 4.0

    edge_size = math.inf

    @property
    def area(self) -> float:
        """See `Spot`."""
        return 0.5 * math.pi * self.radius**2 * (1.0 - math.exp(-2.0 * GAUSSIAN_EDGE**2))

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        across = squared_distances(offsets, direction)
        share = np.exp(-2.0 * across / self.radius**2)
        return np.where(across <= self.reach**2, share, 0.0)

    def distances(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return distances_to_disc(offsets, direction, self.reach)

    def samples(self, count: int, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return prepend_center(sunflower(count, self.reach, direction))
