"""Boundary conditions: how much of the fluence leaves, and what light from outside adds."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tetlux.fem.media.fresnel import moments
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray, NumberArray


class BoundaryCondition(Protocol):
    """A boundary condition ``E.n = robin phi - inflow``, with E.n the net flux that leaves the body.

    All finite elements ask it for these factors. Only what has no mesh (`tetlux.fem.charges`, `tetlux.fem.exact`) and
    the weak form that checks the matrices (`tetlux.fem.operators.forms`) compute them for themselves.
    """

    @property
    def medium(self) -> Medium:
        """The medium below the surface, whose refractive index light leaves."""
        ...

    @property
    def robin(self) -> float:
        """Net flux that leaves for a fluence of 1; 0 where no light passes (Neumann)."""
        ...

    def inflow(self, transmitted: float | FloatArray) -> float | FloatArray:
        """What diffuse irradiance that passes to the inside adds to the right-hand side, W/unit²."""
        ...

    def exitance_offset(self, transmitted: float | FloatArray) -> float | FloatArray:
        """Exitance where the fluence is 0, from the transmitted irradiance, W/unit²."""
        ...

    def exitance(self, fluence: NumberArray, transmitted: float | FloatArray) -> NumberArray:
        """Exitance (q,) from the fluence (q,) at points of the boundary and the transmitted irradiance, W/unit²."""
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

    @property
    def robin(self) -> float:
        """``1/(2A)``."""
        return 0.5 / self.medium.boundary_factor

    def inflow(self, transmitted: float | FloatArray) -> float | FloatArray:
        """``2 E_t/(1 + 3 C2)``, W/unit²."""
        return 2.0 * transmitted / (1.0 + 3.0 * moments(self.medium.eta)[1])

    def exitance_offset(self, transmitted: float | FloatArray) -> float | FloatArray:
        """``E_t (1 - 2/(1 + 3 C2))``: E_t less the inflow, W/unit²."""
        return transmitted * (1.0 - 2.0 / (1.0 + 3.0 * moments(self.medium.eta)[1]))

    def exitance(self, fluence: NumberArray, transmitted: float | FloatArray) -> NumberArray:
        """``M = E.n + E_t``, W/unit²."""
        exitance = self.robin * fluence
        if np.any(transmitted):
            exitance = exitance + self.exitance_offset(transmitted)
        return np.asarray(exitance)


def boundary_condition_of(medium: Medium) -> BoundaryCondition:
    """The boundary condition of a body whose outer medium is given.

    A further kind of `Medium.boundary` is chosen here; "exact" and "classic" are one kind, with different factors A.
    """
    return PartialCurrent(medium)
