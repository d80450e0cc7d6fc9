"""Boundary conditions: how much of the fluence leaves, and what light from outside adds."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tetlux.fem.media.fresnel import moments
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray, NumberArray


class Boundary(Protocol):
    """A boundary condition ``E.n = robin phi - inflow``, with E.n the net flux that leaves.

    The factor robin is in the blocks of a model: 1/(2A), or 0 where no light passes (Neumann).
    """

    @property
    def medium(self) -> Medium:
        """The medium below the surface, whose refractive index light leaves."""
        ...

    def inflow(self, transmitted: float | FloatArray) -> float | FloatArray:
        """What diffuse irradiance that passes to the inside adds to the right-hand side, W/unit²."""
        ...

    def exitance(self, fluence: NumberArray, transmitted: float | FloatArray) -> NumberArray:
        """Exitance (q,) from the fluence (q,) at places of the boundary and the transmitted irradiance, W/unit²."""
        ...


@dataclass(frozen=True)
class PartialCurrent:
    """The boundary of the diffusion approximation with internal reflection: ``E.n = phi/(2A)`` in the dark.

    Under diffuse light of which E_t passes to the inside, ``E.n = (phi - 4 E_t/(1 - 2 C1))/(2A)``, with C1 and C2 the
    moments of the internal reflectance and ``A = (1 + 3 C2)/(1 - 2 C1)``.

    Parameters
    ----------
    medium : Medium
    """

    medium: Medium

    def inflow(self, transmitted: float | FloatArray) -> float | FloatArray:
        """``2 E_t/(1 + 3 C2)``, W/unit²."""
        return 2.0 * transmitted / (1.0 + 3.0 * moments(self.medium.eta)[1])

    def exitance(self, fluence: NumberArray, transmitted: float | FloatArray) -> NumberArray:
        """``M = E.n + E_t``, W/unit²."""
        exitance = fluence / (2.0 * self.medium.boundary_factor)
        if np.any(transmitted):
            _, c2 = moments(self.medium.eta)
            exitance = exitance + transmitted * (1.0 - 2.0 / (1.0 + 3.0 * c2))
        return np.asarray(exitance)
