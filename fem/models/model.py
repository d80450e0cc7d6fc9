"""`Model`: equations of diffusion type for one or more unknowns at each node, and what becomes of light in them."""

from dataclasses import dataclass
from typing import Protocol

from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.boundary import BoundaryCondition
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
    (`Assembly.terms`), all of one pattern and real. `operator_of` combines them with `shift`. A model is given to
    `tetlux.fem.system.System` as `model_of`; `tetlux.fem.scenes.Scenes.system_on` makes those of `solve`.

    `CONTRIBUTING.md` lists what SP3 has to add.
    """

    @property
    def coefficients(self) -> Coefficients:
        """Of the media, on the tetrahedra of a mesh."""
        ...

    @property
    def boundary_condition(self) -> BoundaryCondition:
        """What passes through the boundary."""
        ...

    @property
    def shift(self) -> complex:
        """What is added to sigma_a, 1/unit: 0 for steady light, ``i omega n/c`` for light modulated at omega (rad/s).

        c is the speed of light in vacuum in unit/s, n the refractive index itself, `eta` times that of
        the outside. It is one number, as all media of a body have one index.
        """
        ...

    @property
    def blocks(self) -> tuple[tuple[Block, ...], ...]:
        """For each equation, the block of each unknown: as many as there are unknowns at a node."""
        ...

    @property
    def nonnegative(self) -> bool:
        """Whether sources that are not negative make a fluence that is not: if so, it may be limited to that."""
        ...
