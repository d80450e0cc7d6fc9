"""What a light leaves in a medium: isotropic points, and beams that fade along straight segments."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from tetlux.fem.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface import Surface


def _no_vectors() -> FloatArray:
    return np.zeros((0, 3))


def _no_values() -> FloatArray:
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class Deposit:
    """Where the power of a light goes; a deposit knows the body, not its mesh.

    Parameters
    ----------
    incident : float
        Power that meets the body, W; for an irradiance it follows from the mesh's area.
    specular : float
        Power that its surface reflects at once, W.
    absorbed : float
        Power absorbed before it was ever scattered, W.
    ballistic : float
        Power that leaves the body without having been scattered, W.
    points, powers : (p, 3), (p,) ndarray
        Isotropic points and their power, W.
    starts, directions, lengths, fluxes : (s, 3), (s, 3), (s,), (s,) ndarray
        Beam segments: start, unit direction, length, and power carried at the start, W. The power fades
        as ``exp(-sigma_t* l)``.
    irradiance, transmitted_irradiance : float
        Diffuse light on the outside of the whole surface, and what of it passes to the inside, W/unit².
    resolution : float
        Length near the deposit that a mesh has to resolve, unit.
    warnings : tuple of str
    """

    incident: float = 0.0
    specular: float = 0.0
    absorbed: float = 0.0
    ballistic: float = 0.0
    points: FloatArray = field(default_factory=_no_vectors)
    powers: FloatArray = field(default_factory=_no_values)
    starts: FloatArray = field(default_factory=_no_vectors)
    directions: FloatArray = field(default_factory=_no_vectors)
    lengths: FloatArray = field(default_factory=_no_values)
    fluxes: FloatArray = field(default_factory=_no_values)
    irradiance: float = 0.0
    transmitted_irradiance: float = 0.0
    resolution: float = np.inf
    warnings: tuple[str, ...] = ()


class Light(Protocol):
    """Anything that can say what it leaves in a body."""

    def deposit_in(self, surface: Surface, medium: Medium) -> Deposit:
        """What this light leaves in a body of the given surface and medium."""
        ...
