"""Places of lights, which derivatives and fits move."""

from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.body.body import Body
from tetlux.fem.inputs import as_vector, unit_vector
from tetlux.fem.lights.pencil import PencilBeam
from tetlux.fem.lights.point import PointSource
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.meshing.arrays import FloatArray


@dataclass(frozen=True)
class MovedLight:
    """A light at another place than the one whose charges and patches are kept with a mesh.

    These are found by the representation of a light, so this one has that of the light before it was moved: readings
    then depend smoothly on its place.

    Attributes
    ----------
    light : Light
        At its place.
    name : str
        Representation of the light that it was.
    """

    light: Light
    name: str

    def deposit_in(self, body: Body) -> Deposit:
        """See `Light`."""
        return self.light.deposit_in(body)

    def __repr__(self) -> str:
        return self.name


def place_of(light: Light) -> FloatArray | None:
    """The position of a point, or the origin of a pencil beam, (3,), unit; None of other lights.

    Rays that represent a wide beam along its path come and go at edges of the surface, so that it has none either.
    """
    if isinstance(light, MovedLight):
        return place_of(light.light)
    if isinstance(light, PointSource):
        return as_vector(light.position, "position")
    if isinstance(light, PencilBeam) and not (light.deposit == "line" and light.radius > 0):
        return as_vector(light.origin, "origin")
    return None


def free_direction(light: Light) -> FloatArray | None:
    """The direction, (3,), along which moving a light changes nothing; None if there is none."""
    if isinstance(light, MovedLight):
        return free_direction(light.light)
    return unit_vector(light.direction, "direction") if isinstance(light, PencilBeam) else None


def at_place(light: Light, place: FloatArray) -> Light:
    """A light that has a place, at another one (3,)."""
    x, y, z = np.asarray(place, dtype=float).tolist()
    if isinstance(light, MovedLight):
        return MovedLight(at_place(light.light, place), light.name)
    if isinstance(light, PointSource):
        return replace(light, position=(x, y, z))
    assert isinstance(light, PencilBeam)
    return replace(light, origin=(x, y, z))


def move_to(light: Light, place: FloatArray) -> MovedLight:
    """A light that has a place, at another one (3,), with the charges and patches of the light as it is."""
    return MovedLight(at_place(light, place), repr(light))
