"""`QuadraticOperator`: the matrix of quadratic elements, its solver, and the dual solutions of measurements."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.linear import krylov
from tetlux.fem.linear.krylov import Preconditioner, Product, conjugate_gradients, dots
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.diffusion import Diffusion
from tetlux.fem.operators.assembly import Assembly
from tetlux.fem.quadratic.assembly import element_matrices, matrix_of
from tetlux.fem.quadratic.measurement import DiscreteMeasurement, Measurement
from tetlux.fem.quadratic.space import QuadraticSpace, quadratic_space
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import map_in_threads
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Relative residual at which the iteration stops, for solutions and duals. A reading is corrected by the residual of the
# solution times the dual, so that its relative error is about the square of this.
STOP_RESIDUAL = 1e-7
# Number of right-hand sides that are iterated together.
COLUMNS_PER_GROUP = 4
# Number of right-hand sides for which the solver of the linear part is chosen.
EXPECTED_RIGHT_HAND_SIDES = 10


@dataclass(frozen=True, eq=False)
class QuadraticOperator:
    """A matrix of quadratic elements on a mesh, and its solver.

    Attributes
    ----------
    mesh : TetMesh
    surface : Surface
        The true surface of the body.
    inner : sequence of Surface
        True surfaces of the regions.
    coefficients : Coefficients
    """

    mesh: TetMesh
    surface: Surface
    inner: Sequence[Surface]
    coefficients: Coefficients
    _duals: dict[Measurement, FloatArray] = field(default_factory=dict)
    _discretised: dict[Measurement, DiscreteMeasurement] = field(default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        """What solves cannot be pickled, and is made anew when it is needed."""
        return {name: value for name, value in vars(self).items() if name not in ("_product", "_precondition")}

    @cached_property
    def space(self) -> QuadraticSpace:
        """The finite-element space."""
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

        The condition number does not depend on the size of tetrahedra (Yserentant 1986): about 50 iterations.
        """
        nodes = len(self.mesh.points)
        assembly = Assembly(self.mesh)
        matrix = assembly.assemble(self.coefficients)
        linear = assembly.solver(Diffusion(self.coefficients), matrix, EXPECTED_RIGHT_HAND_SIDES).preconditioner
        inverse = 1.0 / self.matrix.diagonal()[nodes:, None]

        def precondition(rest: FloatArray) -> FloatArray:
            return np.concatenate([linear(np.ascontiguousarray(rest[:nodes])), inverse * rest[nodes:]])

        return precondition

    def solve(self, loads: FloatArray) -> FloatArray:
        """Solutions (size, k) for loads (size, k), to relative residuals of about 1e-7."""
        product, precondition = self._product, self._precondition
        # Loads are scaled so that the iteration stops at STOP_RESIDUAL.
        size = np.sqrt(dots(loads, loads)) * STOP_RESIDUAL / krylov.STOP_RESIDUAL
        size[size == 0] = 1.0
        scaled = loads / size
        groups = [
            np.ascontiguousarray(scaled[:, i : i + COLUMNS_PER_GROUP])
            for i in range(0, loads.shape[1], COLUMNS_PER_GROUP)
        ]
        found = map_in_threads(lambda group: conjugate_gradients(product, precondition, group)[0], groups)
        return np.asarray(np.hstack([np.zeros((len(loads), 0)), *found]) * size)

    def discretise(self, measurement: Measurement) -> DiscreteMeasurement:
        """A measurement on the mesh; each is made once."""
        if measurement not in self._discretised:
            self._discretised[measurement] = measurement.discretise(self.space, self.coefficients)
        return self._discretised[measurement]

    def duals(self, measurements: Sequence[Measurement]) -> list[FloatArray]:
        """Dual solutions (size,) of measurements; each is solved for once."""
        new = [measurement for measurement in dict.fromkeys(measurements) if measurement not in self._duals]
        if new:
            loads = np.column_stack([self.discretise(measurement).load for measurement in new])
            self._duals.update(zip(new, self.solve(loads).T.copy(), strict=True))
        return [self._duals[measurement] for measurement in measurements]

    __repr__ = one_line
