"""`QuadraticOperator`: the matrix of quadratic elements, its solver, and the dual solutions of what is read."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.linear import krylov
from tetlux.fem.linear.krylov import Preconditioner, Product, conjugate_gradients, dots
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.diffusion import Diffusion
from tetlux.fem.operators.assembly import Assembly
from tetlux.fem.quadratic.assembly import element_matrices, matrix_of
from tetlux.fem.quadratic.sight import Seen, Sight
from tetlux.fem.quadratic.space import QuadraticSpace, quadratic_space
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import map_in_threads
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Relative residual of solutions and of duals. A reading is corrected by what is left of the load, weighted by its dual,
# so that it is off by about the product of the two.
AIM = 1e-7
# Columns that are iterated on side by side.
GROUP = 4
# Of how many loads a solver of the linear part should think, roughly.
EXPECTED = 10


@dataclass(frozen=True, eq=False)
class QuadraticOperator:
    """A matrix of quadratic elements on a mesh, and its solver.

    Attributes
    ----------
    mesh : TetMesh
    surface : Surface
        What the mesh stands for.
    inner : sequence of Surface
        Of its regions.
    coefficients : Coefficients
    """

    mesh: TetMesh
    surface: Surface
    inner: Sequence[Surface]
    coefficients: Coefficients
    _duals: dict[Sight, FloatArray] = field(default_factory=dict)
    _seen: dict[Sight, Seen] = field(default_factory=dict)

    @cached_property
    def space(self) -> QuadraticSpace:
        """The functions."""
        return quadratic_space(self.mesh, self.surface, self.inner)

    @cached_property
    def elements(self) -> FloatArray:
        """The matrices of tetrahedra, (m, 10, 10)."""
        return element_matrices(self.space, self.coefficients)

    @cached_property
    def matrix(self) -> csr_array:
        """The matrix, (size, size)."""
        return matrix_of(self.space, self.coefficients, self.elements)

    @cached_property
    def _product(self) -> Product:
        return Product(self.matrix)

    @cached_property
    def _precondition(self) -> Preconditioner:
        """A solver of the linear part, and the diagonal of the bubbles.

        The two parts meet at an angle that is the same however fine the mesh is (Yserentant 1986): 50 iterations.
        """
        nodes = len(self.mesh.points)
        assembly = Assembly(self.mesh)
        matrix = assembly.assemble(self.coefficients)
        linear = assembly.solver(Diffusion(self.coefficients), matrix, EXPECTED).preconditioner
        inverse = 1.0 / self.matrix.diagonal()[nodes:, None]

        def precondition(rest: FloatArray) -> FloatArray:
            return np.concatenate([linear(np.ascontiguousarray(rest[:nodes])), inverse * rest[nodes:]])

        return precondition

    def solve(self, loads: FloatArray) -> FloatArray:
        """Solutions (size, k) for loads (size, k), to relative residuals of about 1e-7."""
        product, precondition = self._product, self._precondition
        # In units in which the iteration stops at the aim.
        size = np.sqrt(dots(loads, loads)) * AIM / krylov.STOP_RESIDUAL
        size[size == 0] = 1.0
        scaled = loads / size
        groups = [np.ascontiguousarray(scaled[:, i : i + GROUP]) for i in range(0, loads.shape[1], GROUP)]
        found = map_in_threads(lambda group: conjugate_gradients(product, precondition, group)[0], groups)
        return np.asarray(np.hstack([np.zeros((len(loads), 0)), *found]) * size)

    def see(self, sight: Sight) -> Seen:
        """A sight on the mesh."""
        if sight not in self._seen:
            self._seen[sight] = sight.on(self.space, self.coefficients)
        return self._seen[sight]

    def duals(self, sights: Sequence[Sight]) -> list[FloatArray]:
        """Dual solutions (size,) of what is read; each is solved for once."""
        new = [sight for sight in dict.fromkeys(sights) if sight not in self._duals]
        if new:
            loads = np.column_stack([self.see(sight).load for sight in new])
            self._duals.update(zip(new, self.solve(loads).T.copy(), strict=True))
        return [self._duals[sight] for sight in sights]

    __repr__ = one_line
