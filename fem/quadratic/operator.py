"""`QuadraticOperator`: the matrix of quadratic elements, its solver, and the dual solutions of measurements."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array, csr_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

from tetlux.fem.linear import krylov
from tetlux.fem.linear.krylov import Preconditioner, Product, norms
from tetlux.fem.linear.mixed import mixed_conjugate_gradients
from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.models.diffusion import Diffusion
from tetlux.fem.operators.assembly import Assembly
from tetlux.fem.quadratic.assembly import assemble, element_matrices, matrix_of
from tetlux.fem.quadratic.measurement import DiscreteMeasurement, Measurement
from tetlux.fem.quadratic.recovered_gradient import recovered_gradient_difference
from tetlux.fem.quadratic.space import QuadraticSpace, quadratic_space
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import THREADS, map_in_threads
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Relative residuals at which the iteration stops. A reading is corrected by the residual of the solution times the
# dual, so that its relative error is about the product of the two. Most columns are duals, which therefore are the
# rougher ones.
STOP_RESIDUAL, STOP_RESIDUAL_OF_DUALS = 1e-10, 1e-5
# Largest number of right-hand sides that are iterated together: a pass over the matrix serves all of them.
COLUMNS_PER_GROUP = 8
# Damping of the diagonal; and the stiffness of a value at a node over that of a hat, in any straight tetrahedron.
DAMPING, SHARE_OF_HAT = 0.8, 0.6
# Number of right-hand sides for which the solver of the linear part is chosen.
EXPECTED_RIGHT_HAND_SIDES = 10
# Memory for dual solutions that are kept for measurements that come again; the oldest are dropped.
BYTES_OF_KEPT_DUALS = 2**28
BYTES_OF_KEPT_STEPS = 2**28
# Names of what solves.
SOLVING = ("_product", "_single", "_precondition", "_order")


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

    def elements_of(self, cells: IntArray) -> NumberArray:
        """The matrices of some tetrahedra (c,), ascending, (c, 10, 10)."""
        diffusion, sigma = (at_cells(each, cells) for each in (self.coefficients.diffusion, self.coefficients.sigma))
        return element_matrices(self.space, diffusion, sigma, cells)

    @cached_property
    def mass(self) -> csr_array:
        """The mass matrix, (size, size)."""
        return assemble(self.space, 0.0, 1.0)

    @cached_property
    def matrix(self) -> csr_array:
        """The matrix, (size, size); complex for modulated light."""
        if self.steady is not None:
            return csr_array(self.steady.matrix + self.coefficients.shift * self.steady.mass)
        return matrix_of(self.space, self.coefficients)

    @cached_property
    def _order(self) -> IntArray:
        """DOFs in an order in which those of a tetrahedron are near each other, (size,): products take 2/3 the time."""
        if self.steady is not None:
            return self.steady._order
        edges, nodes = self.mesh.edges, len(self.mesh.points)
        graph = csr_matrix((np.ones(len(edges), dtype=bool), edges.T), shape=(nodes, nodes))
        at_nodes = np.asarray(reverse_cuthill_mckee(csr_matrix(graph + graph.T), symmetric_mode=True), dtype=np.int64)
        rank = np.empty(nodes, dtype=np.int64)
        rank[at_nodes] = np.arange(nodes)
        ends = np.sort(rank[edges], axis=1)
        return np.concatenate([at_nodes, nodes + np.lexsort(ends.T[::-1])])

    @cached_property
    def _product(self) -> Product:
        return Product(_in_order(self.matrix, self._order))

    @cached_property
    def _single(self) -> Product:
        return self._product.single

    @cached_property
    def _precondition(self) -> Preconditioner:
        """The sum of a solver of the linear part and of a damped Jacobi in the basis of values at nodes and middles.

        The condition number does not depend on the size of tetrahedra (additive Schwarz of two levels; Bramble, Pasciak
        & Xu 1990): about 40 iterations, of which the diagonal of bubbles alone takes 75. Both parts are real, with the
        modulus of a complex shift: see `tetlux.fem.linear.krylov.real_majorant`; and in single precision.
        """
        mesh, nodes = self.mesh, len(self.mesh.points)
        assembly = Assembly(mesh)
        real = Diffusion(replace(self.coefficients, shift=abs(self.coefficients.shift)))
        terms = assembly.terms(real.coefficients.diffusion, real.coefficients.sigma_a, self.robin)
        order = self._order
        matrix = _in_order(terms.combine(real.shift), order[:nodes])
        linear = assembly.solver(real, matrix, EXPECTED_RIGHT_HAND_SIDES).preconditioner
        diagonal = np.abs(self.matrix.diagonal())[order, None]
        of_nodes, of_middles = (
            each.astype(np.float32)
            for each in (DAMPING / (SHARE_OF_HAT * diagonal[:nodes]), DAMPING / diagonal[nodes:])
        )
        # A value at a node is a hat less half of the bubbles of its edges.
        rank = np.argsort(order[:nodes])
        ends = rank[mesh.edges[order[nodes:] - nodes]]
        weights = np.full(ends.size, 0.5, np.float32)
        halves = csr_array((weights, ends.ravel(), np.arange(0, ends.size + 1, 2)), (len(ends), nodes))
        to_nodes = csr_array(halves.T)

        def precondition(rest: FloatArray) -> FloatArray:
            found = np.empty_like(rest)
            at_nodes = of_nodes * (rest[:nodes] - to_nodes @ rest[nodes:])
            np.add(linear(np.ascontiguousarray(rest[:nodes])), at_nodes, out=found[:nodes])
            np.multiply(of_middles, rest[nodes:], out=found[nodes:])
            found[nodes:] -= halves @ at_nodes
            return found

        return precondition

    def shifted(self, shift: complex) -> "QuadraticOperator":
        """The operator with another shift, which shares the assembled matrices of this steady one."""
        return replace(self, coefficients=replace(self.coefficients, shift=shift), steady=self, _duals={})

    def solve(self, loads: NumberArray, stop_residual: float = STOP_RESIDUAL) -> NumberArray:
        """Solutions (size, k) for loads (size, k), to about a relative residual."""
        product, single, precondition = self._product, self._single, self._precondition
        order, solved = self._order, np.empty(loads.shape, np.result_type(loads, self.matrix.dtype, float))

        def work(columns: slice) -> None:
            group = np.asarray(loads[order, columns], dtype=solved.dtype)
            # Loads are scaled so that the iteration stops at this residual.
            size = norms(group) * stop_residual / krylov.STOP_RESIDUAL
            size[size == 0] = 1.0
            group /= size
            solved[order, columns] = size * mixed_conjugate_gradients(product, single, precondition, group)[0]

        count = min(COLUMNS_PER_GROUP, -(-loads.shape[1] // THREADS)) or 1
        map_in_threads(work, [slice(i, i + count) for i in range(0, loads.shape[1], count)])
        return solved

    def solve_near(
        self, loads: NumberArray, known: Sequence[NumberArray], stop_residual: float = STOP_RESIDUAL
    ) -> NumberArray:
        """Solutions (size, k) for loads (size, k), beginning with those of similar matrices and loads.

        The combination of them with the least residual is close to the solution for shifts that are next to each
        other on a contour.
        """
        if not known:
            return self.solve(loads, stop_residual)
        start = np.zeros(loads.shape, dtype=np.result_type(loads, self.matrix.dtype))
        for column in range(loads.shape[1]):
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


def _in_order(matrix: csr_array, order: IntArray) -> csr_array:
    """A matrix with rows and columns in another order."""
    rows = csr_array(matrix[order])
    places = np.empty(len(order), dtype=rows.indices.dtype)
    places[order] = np.arange(len(order))
    found = csr_array((rows.data, places[rows.indices], rows.indptr), shape=matrix.shape)
    # Products with columns in their order take four fifths of the time.
    found.sort_indices()
    return found
