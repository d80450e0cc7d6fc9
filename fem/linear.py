"""Solving the system, with the method that is quickest for its size."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array, csr_matrix

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.blocks import THREADS, at_once
from tetlux.meshing.errors import RunError
from tetlux.meshing.notes import Note

# The iteration aims here; a true residual above the second is refused.
AIM = 1e-11
REFUSED = 1e-8
# And here where a few digits are enough; a residual ten times as large is not taken for that.
ROUGH_AIM = 1e-4
ITERATIONS = 1000
# Right-hand sides that are iterated on together where every core has so many: each pass over the matrix then serves all
# of them. Fewer are quicker one by one, for SciPy's products with two or three columns.
TOGETHER = 8
# Below these many entries a second thread costs more than it brings.
ENTRIES_FOR_THREADS = 1_000_000
# Multigrid solves directly for this many unknowns, and estimates spectral radii in so many steps.
COARSEST = 500
POWER_STEPS = 8
# Factors of larger matrices fill gigabytes.
MOST_FOR_DIRECT = 20_000
# But where all else fails, they may.
MOST_TO_FALL_BACK = 100_000

# From residuals (n, k) to corrections of the solution, (n, k).
Method = Callable[[FloatArray], FloatArray]


class Product:
    """Products of a matrix with (n, k) arrays, large ones by blocks of rows on all cores.

    Parameters
    ----------
    matrix : (n, n) csr_array

    Attributes
    ----------
    iterations : int
        Most that conjugate gradients with these products have taken; 0 if there were none.
    """

    def __init__(self, matrix: csr_array) -> None:
        self.matrix = matrix
        self.iterations = 0
        threads = THREADS if matrix.nnz >= ENTRIES_FOR_THREADS else 1
        limits = np.searchsorted(matrix.indptr, np.linspace(0, matrix.nnz, threads + 1)[1:-1])
        cuts = [0, *limits.tolist(), matrix.shape[0]]
        self._rows = [slice(a, b) for a, b in pairwise(cuts)]
        self._blocks = [_rows_of(matrix, rows) for rows in self._rows] if threads > 1 else [matrix]
        self._pool = ThreadPoolExecutor(threads - 1) if threads > 1 else None

    @property
    def on_all_cores(self) -> bool:
        """Whether one product has all cores at work."""
        return self._pool is not None

    def __call__(self, x: FloatArray) -> FloatArray:
        """``matrix @ x``."""
        if self._pool is None:
            return np.asarray(self.matrix @ x)
        result = np.empty((self.matrix.shape[0], *x.shape[1:]))

        def multiply(index: int) -> None:
            result[self._rows[index]] = self._blocks[index] @ x

        others = [self._pool.submit(multiply, index) for index in range(1, len(self._blocks))]
        multiply(0)
        for other in others:
            other.result()
        return result


def _rows_of(matrix: csr_array, rows: slice) -> csr_array:
    """Rows of a matrix without a copy of them."""
    inside = slice(matrix.indptr[rows.start], matrix.indptr[rows.stop])
    starts = matrix.indptr[rows.start : rows.stop + 1] - inside.start
    return csr_array(
        (matrix.data[inside], matrix.indices[inside], starts), shape=(rows.stop - rows.start, matrix.shape[1])
    )


def jacobi(product: Product) -> Method:
    """Conjugate gradients, preconditioned by the diagonal."""
    inverse = 1.0 / product.matrix.diagonal()[:, None]
    return _on_all_cores(product, lambda rest: conjugate_gradients(product, lambda r: inverse * r, rest))


def direct(product: Product) -> Method:
    """Sparse Cholesky in all but name: LU of a symmetric matrix with the pivots on its diagonal (SuperLU)."""
    from scipy.sparse.linalg import splu  # noqa: PLC0415

    options = {"SymmetricMode": True}
    factors = splu(product.matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    return lambda rest: np.asarray(factors.solve(rest))


@dataclass(frozen=True, eq=False)
class Multigrid:
    """Conjugate gradients, preconditioned by a cycle through a hierarchy of matrices: this one's or one's like it."""

    product: Product
    cycle: Method

    def __call__(self, rest: FloatArray) -> FloatArray:
        """See `Method`."""
        return _on_all_cores(self.product, lambda some: conjugate_gradients(self.product, self.cycle, some))(rest)


def multigrid(product: Product) -> Multigrid:
    """Conjugate gradients, preconditioned by smoothed aggregation (Vaněk, Mandel & Brezina 1996)."""
    finest, levels = product, list[_Level]()
    while product.matrix.shape[0] > COARSEST and (level := _level(product)) is not None:
        levels.append(level)
        product = Product(csr_array(level.down.matrix @ (product.matrix @ level.up.matrix)))
    coarsest = direct(product)

    def cycle(rest: FloatArray, depth: int = 0) -> FloatArray:
        if depth == len(levels):
            return coarsest(rest)
        level = levels[depth]
        result = level.smoother * rest
        result += level.up(cycle(level.down(rest - level.product(result)), depth + 1))
        result += level.smoother * (rest - level.product(result))
        return result

    return Multigrid(finest, cycle)


def _on_all_cores(product: Product, method: Method) -> Method:
    """A method on a column or a few at once, each core at its own, unless one product has all of them at work."""

    def of_all(rest: FloatArray) -> FloatArray:
        count = rest.shape[1]
        size = TOGETHER if count >= TOGETHER * THREADS and not product.on_all_cores else 1
        groups = [np.ascontiguousarray(rest[:, start : start + size]) for start in range(0, count, size)]
        return np.hstack([method(group) for group in groups] if product.on_all_cores else at_once(method, groups))

    return of_all


@dataclass(frozen=True, eq=False)
class _Level:
    """A level of the hierarchy: its matrix, the ways to the coarser one and back, and a damped Jacobi, (n, 1)."""

    product: Product
    down: Product
    up: Product
    smoother: FloatArray


def _level(product: Product) -> _Level | None:
    """Aggregates of neighbours, whose indicator functions are smoothed by one step of Jacobi.

    PyAMG finds the aggregates. Its own set-up takes three times as long, for better estimates of spectral radii
    than damping needs, and its Gauss-Seidel runs neither on two cores nor on several columns.
    """
    from pyamg.aggregation import standard_aggregation  # noqa: PLC0415

    matrix = product.matrix
    indicators = csr_array(standard_aggregation(csr_matrix(matrix))[0].astype(np.float64))
    if indicators.nnz == 0:
        return None
    diagonal = matrix.diagonal()
    # A power iteration from any start ends between the radius and a little less, and 4/3 leaves room for 3/2 of it.
    vector = np.random.default_rng(0).normal(size=(len(diagonal), 1))
    for _ in range(POWER_STEPS):
        vector = product(vector) / diagonal[:, None]
        radius = np.sqrt(_dots(vector, vector))
        vector /= radius
    smoother = 4.0 / 3.0 / (radius * diagonal)
    smoothed = csr_array(matrix @ indicators)
    smoothed.data *= np.repeat(smoother, np.diff(smoothed.indptr))
    up = csr_array(indicators - smoothed)
    return _Level(product, Product(csr_array(up.T)), Product(up), smoother[:, None])


def conjugate_gradients(product: Product, precondition: Method, loads: FloatArray) -> FloatArray:
    """Preconditioned conjugate gradients (Saad 2003, algorithm 9.1) on all columns of (n, k) loads side by side.

    They stop when the norms of all residuals are below `AIM`, or after `ITERATIONS`.
    """
    result, rest = np.zeros_like(loads), loads.copy()
    step = precondition(rest)
    size = _dots(rest, step)
    for number in range(ITERATIONS):
        product.iterations = max(product.iterations, number + 1)
        image = product(step)
        length = _ratio(size, _dots(step, image))
        result += length * step
        rest -= length * image
        if np.sqrt(_dots(rest, rest).max(initial=0.0)) <= 0.5 * AIM:
            break
        towards = precondition(rest)
        before, size = size, _dots(rest, towards)
        step *= _ratio(size, before)
        step += towards
    return result


def _dots(a: FloatArray, b: FloatArray) -> FloatArray:
    """Dot products (k,) of the columns of (n, k) arrays."""
    # Not by BLAS: its threads wait for each other, and for whatever else the machine is doing.
    return np.asarray(np.einsum("ij,ij->j", a, b))


def _ratio(a: FloatArray, b: FloatArray) -> FloatArray:
    """``a/b``, and 0 where a column has nothing left to do."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0)


class Solver:
    """Prepared once for a matrix, then solves for as many right-hand sides as wanted.

    Parameters
    ----------
    matrix : (n, n) csr_array
        Symmetric, positive definite.
    methods : sequence of callables
        `jacobi`, `multigrid`, `direct`. The first is prepared at once, the next ones only when those before leave
        too large a residual.

    Attributes
    ----------
    note : str
        A `Note` for the user where the first method was not enough; else empty.
    residual : float
        Largest relative residual that a solution was returned with.
    """

    def __init__(self, matrix: csr_array, methods: Sequence[Callable[[Product], Method]]) -> None:
        self.matrix = matrix
        self._product = Product(matrix)
        self._methods = list(methods)
        self._ready = [methods[0](self._product)]
        self._row_sums = np.asarray(matrix.sum(axis=1))[:, None]
        self.note = ""
        self.residual = 0.0

    @property
    def iterations(self) -> int:
        """Most iterations that a solution took; 0 if all were direct."""
        return self._product.iterations

    @property
    def cycle(self) -> Method | None:
        """That which preconditions it, if multigrid does."""
        first = self._ready[0]
        return first.cycle if isinstance(first, Multigrid) else None

    def solve(self, load: FloatArray) -> FloatArray:
        """Solve for one right-hand side or for several.

        Parameters
        ----------
        load : (n,) or (n, k) ndarray

        Returns
        -------
        (n,) or (n, k) ndarray
            Its residuals sum to zero, so that no power is lost.

        Raises
        ------
        RunError
            If a residual, computed anew from the solution, is above 1e-8 of its load.
        """
        loads = load.reshape(len(load), -1)
        result = np.empty(loads.shape)
        portion = TOGETHER * THREADS
        for start in range(0, loads.shape[1], portion):
            columns = slice(start, start + portion)
            result[:, columns] = self._solved(np.asarray(loads[:, columns], dtype=np.float64))
        return result.reshape(load.shape)

    def roughly(self, load: FloatArray) -> FloatArray:
        """Solve to a few digits, for less than half of the iterations: as `solve`, to a residual of 1e-3 at most."""
        # In units in which the iteration stops there.
        size = np.sqrt(_dots(load, load)) * ROUGH_AIM / AIM
        size[size == 0] = 1.0
        result = self._ready[0](load / size) * size
        left = load - self._product(result)
        return result if (np.sqrt(_dots(left, left)) <= 10.0 * AIM * size).all() else self.solve(load)

    def _solved(self, loads: FloatArray) -> FloatArray:
        size = np.linalg.norm(loads, axis=0)
        size[size == 0] = 1.0
        loads = loads / size
        result, rest, residual = np.zeros_like(loads), loads, 1.0
        for number, method in enumerate(self._methods):
            if residual <= AIM:
                break
            if residual > REFUSED and number > 0:
                self.note = Note(
                    "solver-fallback",
                    f"the linear solver had to fall back from {self._methods[0].__name__} to {method.__name__}, which "
                    "takes longer: coefficients are far apart, or tetrahedra flat.",
                )
            if number == len(self._ready):
                self._ready.append(method(self._product))
            helps = True
            # The iteration's own residual drifts from the true one; the same again on what is left mends that.
            while residual > AIM and helps:
                better = result + self._ready[number](rest)
                left = loads - self._product(better)
                reached = float(np.linalg.norm(left, axis=0).max())
                helps = reached < 0.1 * residual
                if reached < residual:
                    result, rest, residual = better, left, reached
        # Moving all nodes alike makes the residuals sum to zero, and the ledger of power is such a sum.
        shift = rest.sum(axis=0) / self._row_sums.sum()
        result, rest = result + shift, rest - shift * self._row_sums
        residual = float(np.linalg.norm(rest, axis=0).max())
        if not residual <= REFUSED:
            raise RunError(
                f"the linear solver stopped at a relative residual of {residual:.1e}, above {REFUSED:.0e}; "
                "the mesh is too badly shaped or the coefficients too far apart: try a finer or cleaner mesh."
            )
        self.residual = max(self.residual, residual)
        return np.asarray(result * size)


def solver_for(matrix: csr_array, loads: int = 1, cycle: Method | None = None) -> Solver:
    """The solver that is quickest for a matrix.

    Parameters
    ----------
    matrix : (n, n) csr_array
        Symmetric, positive definite.
    loads : int
        How many right-hand sides are to come, roughly.
    cycle : callable, optional
        That of a matrix much like this one: if multigrid is the method, its preparation is spared.

    Returns
    -------
    Solver

    Notes
    -----
    Milliseconds of one core to prepare + to solve for one load (for one of many), on spheres of radius 10 graded
    towards a point one mean free path deep, sigma_a .01, sigma_s' 1, eta 1.4:

    ======= ================== ================= ===================
    nodes   jacobi             multigrid         direct
    ======= ================== ================= ===================
    836     0 + 1.9 (.7)       2 + 1.8 (.6)      3 + .2 (.06)
    1,990   0 + 4.2 (2.2)      3 + 3.5 (1.6)     10 + .5 (.16)
    5,446   0 + 12 (8)         7 + 9 (5)         92 + 1.9 (.8)
    16,876  1 + 51 (39)        21 + 30 (17)      1,020 + 9 (4.5)
    50,181  2 + 210 (176)      55 + 106 (65)     17,000 + 45 (23)
    127,469 6 + 823 (723)      147 + 296 (206)
    ======= ================== ================= ===================

    An albedo of .9999 with eta 1.5 changes nothing; in a strong absorber (sigma_a 3, sigma_s' 10) jacobi takes a
    third of these times, multigrid three quarters.
    """
    nodes = matrix.shape[0]
    if nodes <= MOST_FOR_DIRECT and loads > 1 + (nodes / 1800) ** 2:
        return Solver(matrix, [direct, multigrid])
    if nodes * loads > 15_000:
        methods: list[Callable[[Product], Method]] = [multigrid, jacobi]
        if nodes <= MOST_TO_FALL_BACK:
            methods.append(direct)
        if cycle is not None:

            def multigrid_of_another(product: Product) -> Multigrid:
                return Multigrid(product, cycle)

            methods.insert(0, multigrid_of_another)
        return Solver(matrix, methods)
    return Solver(matrix, [jacobi, multigrid, direct])
