"""An even, round spot."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.fem.inputs import as_vector
from tetlux.fem.lights.spots.plane import distances_to_disc, prepend_center, squared_distances, sunflower
from tetlux.fem.lights.spots.spot import EDGE_SHARE, check_length
from tetlux.meshing.arrays import FloatArray, Vector


@dataclass(frozen=True)
class Disc:
    """An even, round spot.

    Parameters
    ----------
    center : (3,) floats
        A point on the beam's axis, unit.
    radius : float
        unit.
    """

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        as_vector(self.center, "center")
        check_length(self.radius, "radius")

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

    def distances(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return distances_to_disc(offsets, direction, self.reach)

    def samples(self, count: int, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return prepend_center(sunflower(count, self.reach, direction))
