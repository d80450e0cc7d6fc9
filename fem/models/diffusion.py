"""`Diffusion`: steady light in the diffusion approximation, one real unknown, the fluence."""

from dataclasses import dataclass

from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.boundary import PartialCurrent
from tetlux.fem.models.model import Block
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False)
class Diffusion:
    """``-div(D grad phi) + sigma_a phi = Q0 - div(Q1/sigma_t')``, with `PartialCurrent` (CS667 notes, eq. 9).

    Parameters
    ----------
    coefficients : Coefficients
        Of the tetrahedra of a mesh.
    """

    coefficients: Coefficients

    @property
    def boundary(self) -> PartialCurrent:
        """See `Model`."""
        return PartialCurrent(self.coefficients.outer)

    @property
    def blocks(self) -> tuple[tuple[Block]]:
        """One equation for one unknown."""
        coefficients = self.coefficients
        return ((Block(coefficients.diffusion, coefficients.sigma_a, coefficients.robin),),)

    @property
    def nonnegative(self) -> bool:
        """By the maximum principle."""
        return True

    __repr__ = one_line
