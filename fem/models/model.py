"""`Model`: equations of diffusion type for one or more unknowns at each node, and what becomes of light in them."""

from dataclasses import dataclass
from typing import Protocol

from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.boundary import Boundary
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False)
class Block:
    """Coefficients of ``∫ D grad u . grad v + ∫ sigma u v + ∮ robin u v`` for one unknown u in one equation.

    Attributes
    ----------
    diffusion : float or (m,) ndarray
        D of all or of each tetrahedron, unit; 0 where the unknown is not differentiated.
    sigma : float or (m,) ndarray
        1/unit; negative where the unknown is a source in this equation.
    robin : float or (f,) ndarray
        Of all or of each boundary triangle.
    """

    diffusion: float | FloatArray
    sigma: float | FloatArray
    robin: float | FloatArray

    __repr__ = one_line


class Model(Protocol):
    """What a model says of itself; `tetlux.fem.models.diffusion.Diffusion` is one.

    Its weak form is a sum of `Block` over equations i and unknowns j. Each block becomes the `Terms` of one matrix
    (`Assembly.terms`), all of one pattern, real, and combined with any shift.

    A model of modulated light has the blocks and the boundary of diffusion. It combines them with the shift
    ``i omega n/c``, its unknown is complex, and `nonnegative` is False.

    SP3 has two unknowns, phi_1 = phi_0 + 2 phi_2 and phi_2 (Klose & Larsen 2006). It has to implement:

    * `blocks`, two by two: D and sigma of each equation on the diagonal, the coupling sigma off the diagonal with
      D = 0, and its boundary condition, solved for the two fluxes, as four values of robin;
    * a `Boundary` that returns the exitance from both unknowns;
    * an operator that puts the four matrices into one and loads both equations: `fem/operators/operator.py` and
      `load_vector` have one equation;
    * the fluence phi_1 - 2 phi_2 of a `Solution`;
    * and `subtract="nothing"`, since the charges of `tetlux.fem.known` and the estimate of `tetlux.fem.error` know
      diffusion only.
    """

    @property
    def coefficients(self) -> Coefficients:
        """Of the media, on the tetrahedra of a mesh."""
        ...

    @property
    def boundary(self) -> Boundary:
        """What passes through the boundary."""
        ...

    @property
    def blocks(self) -> tuple[tuple[Block, ...], ...]:
        """For each equation, the block of each unknown: as many as there are unknowns at a node."""
        ...

    @property
    def nonnegative(self) -> bool:
        """Whether sources that are not negative make a fluence that is not: if so, it may be limited to that."""
        ...
