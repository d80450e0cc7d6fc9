"""`QuadraticOperator`: the matrix of quadratic elements, its solver, and the dual solutions of measurements."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.linear import krylov
from tetlux.fem.linear.krylov import Preconditioner, Product, conjugate_gradients, norms
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.models.diffusion import Diffusion
from tetlux.fem.operators.assembly import Assembly
from tetlux.fem.quadratic.assembly import assemble, element_matrices, matrix_of
from tetlux.fem.quadratic.measurement import DiscreteMeasurement, Measurement
from tetlux.fem.quadratic.recovered_gradient import recovered_gradient_difference
from tetlux.fem.quadratic.space import QuadraticSpace, quadratic_space
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import map_in_threads
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Relative residuals at which the iteration stops. A reading is corrected by the residual of the solution times the
# dual, so that its relative error is about the product of the two. Most columns are duals, which therefore are the
# rougher ones.
STOP_RESIDUAL, STOP_RESIDUAL_OF_DUALS = 1e-10, 1e-5
# Number of right-hand sides that are iterated together.
COLUMNS_PER_GROUP = 4
# Number of right-hand sides for which the solver of the linear part is chosen.
EXPECTED_RIGHT_HAND_SIDES = 10
# Memory for dual solutions that are kept for measurements that come again; the oldest are dropped.
BYTES_OF_KEPT_DUALS = 2**28
BYTES_OF_KEPT_STEPS = 2**28
# Names of what solves.
SOLVING = ("_product", "_precondition")


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
    steady : QuadraticOperator, optional
        That of the same coefficients without their shift: see `shifted`.
    """

    mesh: TetMesh
    surface: Surface
    inner: Sequence[Surface]
    coefficients: Coefficients
    steady: "QuadraticOperator | None" = None
    _duals: dict[Measurement, NumberArray] = field(default_factory=dict)
    # By the identity of a dual: this dual, and what `gradient_steps` gives of it.
    _steps: dict[int, tuple[NumberArray, NumberArray]] = field(default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        """What solves cannot be pickled, and is made anew when it is needed."""
        return {name: value for name, value in vars(self).items() if name not in SOLVING} | {"_steps": {}}

    def gradient_steps(self, dual: NumberArray) -> NumberArray:
        """`recovered_gradient_difference` of a dual solution (size,), (m, 4, 3), in single precision.

        Those that were used last are kept: the scenes of one system are read by the same detectors.
        """
        kept = self._steps.pop(id(dual), None)
        if kept is None:
            steps = recovered_gradient_difference(self.space, dual)
            kept = dual, steps.astype(np.complex64 if np.iscomplexobj(steps) else np.float32)
        self._steps[id(dual)] = kept
        most = max(1, BYTES_OF_KEPT_STEPS // kept[1].nbytes)
        for oldest in list(self._steps)[: max(len(self._steps) - most, 0)]:
            self._steps.pop(oldest, None)
        return kept[1]

    def release(self) -> None:
        """Drop the matrices, which are made anew when they are needed."""
        for name in ("matrix", *SOLVING):
            vars(self).pop(name, None)

    @cached_property
    def space(self) -> QuadraticSpace:
        """The finite-element space."""
        return quadratic_space(self.mesh, self.surface, self.inner)

    @cached_property
    def mass(self) -> csr_array:
        """The mass matrix, (size, size)."""
        return assemble(self.space, element_matrices(self.space, 0.0, 1.0))

    @cached_property
    def matrix(self) -> csr_array:
        """The matrix, (size, size); complex for modulated light."""
        if self.steady is not None:
            return csr_array(self.steady.matrix + self.coefficients.shift * self.steady.mass)
        elements = element_matrices(self.space, self.coefficients.diffusion, self.coefficients.sigma)
        return matrix_of(self.space, self.coefficients, elements)

    @cached_property
    def _product(self) -> Product:
        return Product(self.matrix)

    @cached_property
    def _precondition(self) -> Preconditioner:
        """A solver of the linear part, and the diagonal of the bubbles.

        The condition number does not depend on the size of tetrahedra (Yserentant 1986): about 50 iterations. Both are
        real, with the modulus of a complex shift: see `tetlux.fem.linear.krylov.real_majorant`.
        """
        nodes = len(self.mesh.points)
        assembly = Assembly(self.mesh)
        real = Diffusion(replace(self.coefficients, shift=abs(self.coefficients.shift)))
        terms = assembly.terms(real.coefficients.diffusion, real.coefficients.sigma_a, self.robin)
        matrix = terms.combine(real.shift)
        linear = assembly.solver(real, matrix, EXPECTED_RIGHT_HAND_SIDES).preconditioner
        inverse = 1.0 / np.abs(self.matrix.diagonal()[nodes:, None])

        def precondition(rest: FloatArray) -> FloatArray:
            return np.concatenate([linear(np.ascontiguousarray(rest[:nodes])), inverse * rest[nodes:]])

        return precondition

    def shifted(self, shift: complex) -> "QuadraticOperator":
        """The operator with another shift, which shares the assembled matrices of this steady one."""
        return replace(self, coefficients=replace(self.coefficients, shift=shift), steady=self, _duals={})

    def solve(self, loads: NumberArray, stop_residual: float = STOP_RESIDUAL) -> NumberArray:
        """Solutions (size, k) for loads (size, k), to about a relative residual."""
        product, precondition = self._product, self._precondition
        loads = loads.astype(np.result_type(loads, self.matrix.dtype), copy=False)
        # Loads are scaled so that the iteration stops at this residual.
        size = norms(loads) * stop_residual / krylov.STOP_RESIDUAL
        size[size == 0] = 1.0
        scaled = loads / size
        groups = [
            np.ascontiguousarray(scaled[:, i : i + COLUMNS_PER_GROUP])
            for i in range(0, loads.shape[1], COLUMNS_PER_GROUP)
        ]
        found = map_in_threads(lambda group: conjugate_gradients(product, precondition, group)[0], groups)
        return np.asarray(np.hstack([np.zeros((len(loads), 0)), *found]) * size)

    def solve_near(
        self, loads: NumberArray, known: Sequence[NumberArray], stop_residual: float = STOP_RESIDUAL
    ) -> NumberArray:
        """Solutions (size, k) for loads (size, k), beginning with those of similar matrices and loads.

        The combination of them with the least residual is close to the solution for shifts that are next to each
        other on a contour.
        """
        start = np.zeros(loads.shape, dtype=np.result_type(loads, self.matrix.dtype))
        for column in range(loads.shape[1] if known else 0):
            basis = np.column_stack([each[:, column] for each in known])
            start[:, column] = basis @ np.linalg.lstsq(self.matrix @ basis, loads[:, column])[0]
        rest = loads - self.matrix @ start
        left = float((norms(rest) / np.maximum(norms(loads), np.finfo(float).tiny)).max(initial=0.0))
        return start if left <= stop_residual else start + self.solve(rest, min(stop_residual / left, 0.1))

    def discretise(self, measurement: Measurement) -> DiscreteMeasurement:
        """A measurement on the mesh."""
        return measurement.discretise(self.space, self.coefficients)

    @property
    def robin(self) -> float:
        """Ratio of exitance to fluence at the surface."""
        return boundary_condition_of(self.coefficients.outer).robin

    @property
    def most_duals(self) -> int:
        """Number of dual solutions that are kept."""
        return max(BYTES_OF_KEPT_DUALS // (self.matrix.dtype.itemsize * self.space.size), COLUMNS_PER_GROUP)

    def duals(self, measurements: Sequence[Measurement]) -> list[NumberArray]:
        """Dual solutions (size,) of measurements; the last `most_duals` are kept."""
        new = [measurement for measurement in dict.fromkeys(measurements) if measurement not in self._duals]
        if new:
            loads = np.column_stack([self.discretise(measurement).load for measurement in new])
            self._duals.update(zip(new, self.solve(loads, STOP_RESIDUAL_OF_DUALS).T.copy(), strict=True))
        found = [self._duals[measurement] for measurement in measurements]
        for oldest in list(self._duals)[: max(len(self._duals) - self.most_duals, 0)]:
            del self._duals[oldest]
        return found

    __repr__ = one_line
