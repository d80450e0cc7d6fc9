"""`Diffusion`: the diffusion approximation with one unknown, the fluence."""

from dataclasses import dataclass

from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.boundary import BoundaryCondition, boundary_condition_of
from tetlux.fem.models.model import Block
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False)
class Diffusion:
    """``-div(D grad phi) + (sigma_a + shift) phi = Q0 - div(Q1/sigma_t')`` (CS667 notes, eq. 9, where shift is 0).

    Parameters
    ----------
    coefficients : Coefficients
        Of the tetrahedra of a mesh, with the shift.
    """

    coefficients: Coefficients

    @property
    def shift(self) -> complex:
        """See `Model`."""
        return self.coefficients.shift

    @property
    def boundary_condition(self) -> BoundaryCondition:
        """See `Model`."""
        return boundary_condition_of(self.coefficients.outer)

    @property
    def blocks(self) -> tuple[tuple[Block]]:
        """One equation for one unknown."""
        coefficients = self.coefficients
        return ((Block(coefficients.diffusion, coefficients.sigma_a, self.boundary_condition.robin),),)

    @property
    def nonnegative(self) -> bool:
        """By the maximum principle, which holds for steady light."""
        return self.shift == 0

    __repr__ = one_line


def is_diffusion(model: object) -> bool:
    """Whether a model is `Diffusion`, steady or of modulated light.

    Only then do these apply: charges that are subtracted (`tetlux.fem.known`), quadratic elements
    (`tetlux.fem.quadratic`) and the estimate of the error (`tetlux.fem.error`).
    """
    return isinstance(model, Diffusion)
