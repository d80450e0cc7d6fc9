"""Preconditioned conjugate gradients, for many right-hand sides at once and on all cores.

For a complex symmetric matrix ``A + i beta M`` they are COCG, conjugate orthogonal conjugate gradients (van der Vorst &
Melissen 1990): the same recurrences with dot products that conjugate nothing.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from tetlux.meshing.arrays import FloatArray, NumberArray, divide_or_zero
from tetlux.meshing.host.blocks import THREADS, map_in_threads

# Relative residual at which the iteration stops.
STOP_RESIDUAL = 1e-11
ITERATIONS = 1000
# Right-hand sides that share one iteration, where there are as many for every core: each pass over the matrix then
# serves all of them. Fewer are quicker one by one, since SciPy's products with two or three columns are slow.
GROUP = 8
# Entries of a vector that are worked on at once.
ENTRIES_IN_CACHE = 1 << 15
# Below these many entries a second thread costs more than it brings.
ENTRIES_FOR_THREADS = 1_000_000

# From residuals (n, k) to rough corrections of the solution, (n, k), real.
Preconditioner = Callable[[FloatArray], FloatArray]
# From residuals (n, k) to corrections (n, k), and the most iterations that a column took, 0 of a direct method.
# Complex where the matrix is.
Method = Callable[[NumberArray], tuple[NumberArray, int]]


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

    @property
    def on_all_cores(self) -> bool:
        """Whether one product has all cores at work."""
        return len(self._blocks) > 1

    @property
    def single(self) -> "Product":
        """Products with the matrix in single precision, which shares its pattern."""
        matrix = self.matrix
        dtype = np.complex64 if self.is_complex else np.float32
        return Product(csr_array((matrix.data.astype(dtype), matrix.indices, matrix.indptr), shape=matrix.shape))

    @property
    def is_complex(self) -> bool:
        """Whether the matrix is complex."""
        return np.iscomplexobj(self.matrix)

    def __call__(self, x: NumberArray) -> NumberArray:
        """``matrix @ x``."""
        if not self.on_all_cores:
            return np.asarray(self.matrix @ x)
        result = np.empty((self.matrix.shape[0], *x.shape[1:]), np.result_type(self.matrix.dtype, x.dtype))

        def multiply(index: int) -> None:
            result[self._rows[index]] = self._blocks[index] @ x

        map_in_threads(multiply, range(len(self._blocks)))
        return result


def _rows_of(matrix: csr_array, rows: slice) -> csr_array:
    """Rows of a matrix without a copy of them."""
    inside = slice(matrix.indptr[rows.start], matrix.indptr[rows.stop])
    starts = matrix.indptr[rows.start : rows.stop + 1] - inside.start
    return csr_array(
        (matrix.data[inside], matrix.indices[inside], starts), shape=(rows.stop - rows.start, matrix.shape[1])
    )


def jacobi(product: Product) -> Method:
    """Conjugate gradients, preconditioned by the diagonal; by its modulus where it is complex."""
    inverse = 1.0 / abs(product.matrix.diagonal())[:, None]
    return make_preconditioned_cg(product, lambda residuals: inverse * residuals)


def make_preconditioned_cg(product: Product, precondition: Preconditioner) -> Method:
    """Conjugate gradients on one or a few columns at a time, a core each; few columns in turn on all cores."""

    def iterate(loads: NumberArray) -> tuple[NumberArray, int]:
        return conjugate_gradients(product, precondition, loads)

    def iterate_on_groups(loads: NumberArray) -> tuple[NumberArray, int]:
        count = loads.shape[1]
        size = GROUP if count >= GROUP * THREADS else 1
        groups = [np.ascontiguousarray(loads[:, start : start + size]) for start in range(0, count, size)]
        in_turn = product.on_all_cores and size == 1
        solved = [iterate(group) for group in groups] if in_turn else map_in_threads(iterate, groups)
        return np.hstack([x for x, _ in solved]), max(iterations for _, iterations in solved)

    return iterate_on_groups


def real_majorant(matrix: csr_array) -> csr_array:
    """The real matrix ``A + |B|``, by which a complex symmetric matrix ``A + i B`` is preconditioned.

    With A positive definite and B or -B positive semidefinite, eigenvalues of the preconditioned matrix are
    ``(1 ± i t)/(1 + t)`` with t >= 0: of a modulus between .7 and 1, at most 45 degrees from the real axis.
    """
    return csr_array(matrix.real + abs(matrix.imag))


def split_complex(values: NumberArray) -> FloatArray:
    """Real and imaginary parts of complex columns (n, k), as the real columns (n, 2k)."""
    values = np.ascontiguousarray(values)
    return values.view(values.real.dtype)


def join_complex(parts: FloatArray) -> NumberArray:
    """The complex columns (n, k) of given real and imaginary parts (n, 2k)."""
    return np.ascontiguousarray(parts).view(np.result_type(parts, np.complex64))


def apply_to_parts(function: Preconditioner, values: NumberArray) -> NumberArray:
    """Apply a real linear function of columns to real or complex columns (n, k)."""
    return join_complex(function(split_complex(values))) if np.iscomplexobj(values) else function(values)


def conjugate_gradients(product: Product, precondition: Preconditioner, loads: NumberArray) -> tuple[NumberArray, int]:
    """Preconditioned conjugate gradients (Saad 2003, algorithm 9.1) on all columns of (n, k) loads side by side.

    They stop when the norms of all residuals are below `STOP_RESIDUAL`, or after `ITERATIONS`. The second result is the
    number of iterations. For complex columns this is COCG, with the same real preconditioner.
    """
    solution, residuals = np.zeros_like(loads), loads.copy()
    direction = apply_to_parts(precondition, residuals)
    product_of_residuals = dots(residuals, direction)
    iterations = 0
    while iterations < ITERATIONS:
        iterations += 1
        image = product(direction)
        # A dot product is 0 in a column that is solved, or where COCG breaks down.
        length = divide_or_zero(product_of_residuals, dots(direction, image))
        add_scaled(solution, direction, length)
        add_scaled(residuals, image, -length)
        if norms(residuals).max(initial=0.0) <= 0.5 * STOP_RESIDUAL:
            break
        corrections = apply_to_parts(precondition, residuals)
        before, product_of_residuals = product_of_residuals, dots(residuals, corrections)
        direction *= divide_or_zero(product_of_residuals, before)
        direction += corrections
    return solution, iterations


def add_scaled(columns: NumberArray, others: NumberArray, factors: NumberArray) -> None:
    """Add other columns (n, k) times factors (k,) to columns (n, k), in place; block by block in the cache."""
    rows = max(1, ENTRIES_IN_CACHE // columns.shape[1])
    for start in range(0, len(columns), rows):
        some = slice(start, start + rows)
        columns[some] += factors * others[some]


def dots(a: NumberArray, b: NumberArray) -> NumberArray:
    """Dot products (k,) of the columns of (n, k) arrays; nothing is conjugated."""
    # Not by BLAS: its threads wait for each other, and for whatever else the machine is doing.
    return np.asarray(np.einsum("ij,ij->j", a, b))


def norms(columns: NumberArray) -> FloatArray:
    """Euclidean norms (k,) of the columns of an (n, k) array."""
    squares = dots(columns, columns) if not np.iscomplexobj(columns) else dots(columns, columns.conj()).real
    return np.asarray(np.sqrt(squares))
