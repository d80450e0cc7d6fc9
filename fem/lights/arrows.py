"""`Arrows`: how a light is drawn, if it comes from somewhere."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface


@dataclass(frozen=True, eq=False)
class Arrows:
    """Arrows along a light, or points.

    Parameters
    ----------
    places : (p, 3) ndarray
        Where the light meets the body, or the points that it shines from, unit.
    direction : (3,) ndarray, optional
        Unit vector in which the light travels; without one the places are drawn as points.
    count : int
        Largest number of arrows or points to draw.
    """

    places: FloatArray
    direction: FloatArray | None = None
    count: int = 1

    __repr__ = one_line


@runtime_checkable
class HasArrows(Protocol):
    """A light that pictures show. Light from everywhere and light of the volume have no such method."""

    def arrows(self, surface: Surface) -> Arrows:
        """Choose where a picture of a body with this surface shows the light.

        Parameters
        ----------
        surface : Surface

        Returns
        -------
        Arrows
        """
        ...
