"""A uniform, rectangular spot."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.fem.inputs import as_vector
from tetlux.fem.lights.spots.plane import distances_to_rectangle, low_discrepancy, prepend_center, right_and_up
from tetlux.fem.lights.spots.spot import EDGE_SHARE, check_length
from tetlux.meshing.arrays import FloatArray, Vector


@dataclass(frozen=True)
class Rectangle:
    """A uniform, rectangular spot.

    Parameters
    ----------
    center : (3,) floats
        A point on the beam's axis, unit.
    width : float
        Length across `up`, unit.
    height : float
        Length along `up`, unit.
    up : (3,) floats
        Direction of the height; its component along the beam does not count.

    Raises
    ------
    InputError
        If a coordinate is not finite or a length not positive; and, when solved, if `up` is along the beam.

    Examples
    --------
    >>> Rectangle(center=(0.0, 0.0, 20.0), width=4.0, height=1.0).area
    4.0
    """

    center: Vector
    width: float
    height: float
    up: Vector = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        as_vector(self.center, "center")
        check_length(self.width, "width")
        check_length(self.height, "height")

    @property
    def reach(self) -> float:
        """See `Spot`."""
        return 0.5 * math.hypot(self.width, self.height)

    @property
    def detail(self) -> float:
        """See `Spot`."""
        return 0.5 * min(self.width, self.height)

    @property
    def edge_size(self) -> float:
        """See `Spot`."""
        return EDGE_SHARE * min(self.width, self.height)

    @property
    def area(self) -> float:
        """See `Spot`."""
        return self.width * self.height

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        right, up = right_and_up(direction, self.up)
        inside = (np.abs(offsets @ right) <= 0.5 * self.width) & (np.abs(offsets @ up) <= 0.5 * self.height)
        return np.where(inside, 1.0, 0.0)

    def distances(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return distances_to_rectangle(offsets, right_and_up(direction, self.up), (self.width, self.height))

    def samples(self, count: int, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        places = (low_discrepancy(count) - 0.5) * [self.width, self.height]
        return prepend_center(places @ np.stack(right_and_up(direction, self.up)))
