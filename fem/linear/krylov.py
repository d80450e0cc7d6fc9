"""Preconditioned conjugate gradients, for many right-hand sides at once and on all cores."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.host.blocks import THREADS, map_in_threads

# Relative residual at which the iteration stops.
AIM = 1e-11
ITERATIONS = 1000
# Right-hand sides that are iterated on together where every core has so many: each pass over the matrix then serves all
# of them. Fewer are quicker one by one, for SciPy's products with two or three columns.
TOGETHER = 8
# Below these many entries a second thread costs more than it brings.
ENTRIES_FOR_THREADS = 1_000_000

# From residuals (n, k) to rough corrections of the solution, (n, k).
Preconditioner = Callable[[FloatArray], FloatArray]
# From residuals (n, k) to corrections (n, k), and the most iterations that a column took, 0 of a direct method.
Method = Callable[[FloatArray], tuple[FloatArray, int]]


class Product:
    """Products of a matrix with (n, k) arrays, large ones by blocks of rows on all cores.

    Parameters
    ----------
    matrix : (n, n) csr_array
    """

    def __init__(self, matrix: csr_array) -> None:
        self.matrix = matrix
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
    return preconditioned(product, lambda rest: inverse * rest)


def preconditioned(product: Product, precondition: Preconditioner) -> Method:
    """Conjugate gradients on one or a few columns at a time, a core each, unless one product keeps all cores busy."""

    def iterate(rest: FloatArray) -> tuple[FloatArray, int]:
        return conjugate_gradients(product, precondition, rest)

    def iterate_on_groups(rest: FloatArray) -> tuple[FloatArray, int]:
        count = rest.shape[1]
        size = TOGETHER if count >= TOGETHER * THREADS and not product.on_all_cores else 1
        groups = [np.ascontiguousarray(rest[:, start : start + size]) for start in range(0, count, size)]
        found = [iterate(group) for group in groups] if product.on_all_cores else map_in_threads(iterate, groups)
        return np.hstack([x for x, _ in found]), max(iterations for _, iterations in found)

    return iterate_on_groups


def conjugate_gradients(product: Product, precondition: Preconditioner, loads: FloatArray) -> tuple[FloatArray, int]:
    """Preconditioned conjugate gradients (Saad 2003, algorithm 9.1) on all columns of (n, k) loads side by side.

    They stop when the norms of all residuals are below `AIM`, or after `ITERATIONS`. The second result is how many
    there were.
    """
    result, rest = np.zeros_like(loads), loads.copy()
    step = precondition(rest)
    size = dots(rest, step)
    iterations = 0
    while iterations < ITERATIONS:
        iterations += 1
        image = product(step)
        length = _ratio(size, dots(step, image))
        result += length * step
        rest -= length * image
        if np.sqrt(dots(rest, rest).max(initial=0.0)) <= 0.5 * AIM:
            break
        towards = precondition(rest)
        before, size = size, dots(rest, towards)
        step *= _ratio(size, before)
        step += towards
    return result, iterations


def dots(a: FloatArray, b: FloatArray) -> FloatArray:
    """Dot products (k,) of the columns of (n, k) arrays."""
    # Not by BLAS: its threads wait for each other, and for whatever else the machine is doing.
    return np.asarray(np.einsum("ij,ij->j", a, b))


def _ratio(a: FloatArray, b: FloatArray) -> FloatArray:
    """``a/b``, and 0 where a column has nothing left to do."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0)
