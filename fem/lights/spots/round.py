"""`RoundSpot`: what spots with a radius have in common."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from tetlux.fem.inputs import as_vector
from tetlux.fem.lights.spots.plane import distances_to_disc, prepend_center, sunflower
from tetlux.fem.lights.spots.spot import check_length
from tetlux.meshing.arrays import FloatArray, Vector


@dataclass(frozen=True)
class RoundSpot(ABC):
    """A spot that depends on the distance from the axis only."""

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        as_vector(self.center, "center")
        check_length(self.radius, "radius")

    @property
    @abstractmethod
    def reach(self) -> float:
        """See `Spot`."""

    def distances(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return distances_to_disc(offsets, direction, self.reach)

    def samples(self, count: int, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return prepend_center(sunflower(count, self.reach, direction))
