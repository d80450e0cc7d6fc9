"""`QuadraticOperator`: the matrix of quadratic elements and its solver."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.linear import krylov
from tetlux.fem.linear.krylov import Product, dots, preconditioned
from tetlux.fem.linear.solver import Solver
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.quadratic.assembly import matrix_of
from tetlux.fem.quadratic.space import QuadraticSpace, quadratic_space
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Relative residual of solutions and of duals. A reading is corrected by what is left, weighted by its dual, so that it
# is off by the product of the two.
AIM = 1e-7


@dataclass(frozen=True, eq=False)
class QuadraticOperator:
    """A matrix of quadratic elements on a mesh, and its solver.

    Attributes
    ----------
    mesh : TetMesh
    surface : Surface
        What the mesh stands for.
    inner : tuple of Surface
        Of its regions.
    coefficients : Coefficients
    linear : Solver
        That of linear elements with the same coefficients, which preconditions.
    """

    mesh: TetMesh
    surface: Surface
    inner: Sequence[Surface]
    coefficients: Coefficients
    linear: Solver

    @cached_property
    def space(self) -> QuadraticSpace:
        """The functions."""
        return quadratic_space(self.mesh, self.surface, self.inner)

    @cached_property
    def matrix(self) -> csr_array:
        """The matrix, (size, size)."""
        return matrix_of(self.space, self.coefficients)

    @cached_property
    def product(self) -> Product:
        """Its products."""
        return Product(self.matrix)

    def solve(self, loads: FloatArray) -> FloatArray:
        """Solutions (size, k) for loads (size, k), to relative residuals of about 1e-7.

        Conjugate gradients, preconditioned by a solver of the linear part and by the diagonal of the bubbles: the two
        parts meet at an angle that is the same however fine the mesh is (Yserentant 1986).
        """
        nodes = len(self.mesh.points)
        coarse, inverse = self.linear.preconditioner, 1.0 / self.matrix.diagonal()[nodes:, None]

        def precondition(rest: FloatArray) -> FloatArray:
            return np.concatenate([coarse(np.ascontiguousarray(rest[:nodes])), inverse * rest[nodes:]])

        # In units in which the iteration stops at the aim.
        size = np.sqrt(dots(loads, loads)) * AIM / krylov.AIM
        size[size == 0] = 1.0
        return np.asarray(preconditioned(self.product, precondition)(loads / size)[0] * size)

    __repr__ = one_line
