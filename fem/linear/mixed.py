"""Conjugate gradients in single precision, with residuals in double precision from time to time.

Products and vectors in single precision take half of the memory and less than half of the time. The residual that they
update drifts from the true one, by which it is replaced whenever it has become much smaller (reliable updates, Clark et
al. 2010, Comput. Phys. Commun. 181, 1517). Search directions begin anew then, not as there: in the norm of the
preconditioner the true residual may be far larger than the one that drifted, which the old direction would outweigh.
"""

import numpy as np

from tetlux.fem.linear.krylov import (
    ENTRIES_IN_CACHE,
    ITERATIONS,
    STOP_RESIDUAL,
    Preconditioner,
    Product,
    apply_to_parts,
    conjugate_gradients,
    dots,
    norms,
)
from tetlux.meshing.arrays import FloatArray, NumberArray, divide_or_zero

# The residual is replaced by the true one when the largest has decreased by this factor, or after so many iterations.
# It must then have decreased by the second factor; else the rest is left to double precision.
DECREASE, MOST_BETWEEN, LEAST_DECREASE = 1e-4, 100, 0.5
# Rows that are multiplied by factors of their columns as one: a loop over a few columns is slow.
ROWS_AS_ONE = 64


def mixed_conjugate_gradients(
    product: Product, single: Product, precondition: Preconditioner, loads: NumberArray
) -> tuple[NumberArray, int]:
    """Solve as `tetlux.fem.linear.krylov.conjugate_gradients` does, mostly in single precision.

    Parameters
    ----------
    product, single : Product
        Of the matrix, and of the same in single precision.
    precondition : callable
        In single precision.
    loads : (n, k) ndarray
        In double precision, of about the same norm each.

    Returns
    -------
    solution : (n, k) ndarray
    iterations : int
    """
    dtype = single.matrix.dtype if not np.iscomplexobj(loads) else np.dtype(np.complex64)
    solution, residuals = np.zeros_like(loads), loads.astype(dtype)
    part, last, since = np.zeros_like(residuals), norms(loads).max(initial=0.0), 0
    direction, product_of_residuals = np.zeros_like(residuals), np.zeros(loads.shape[1], dtype)
    for iteration in range(1, ITERATIONS + 1):
        corrections = apply_to_parts(precondition, residuals)
        before, product_of_residuals = product_of_residuals, _dots(residuals, corrections)
        _scale_and_add(direction, divide_or_zero(product_of_residuals, before), corrections)
        image = single(direction)
        length = divide_or_zero(product_of_residuals, _dots(direction, image))
        _add_scaled(part, direction, length)
        _add_scaled(residuals, image, -length)
        since += 1
        largest = _norms(residuals).max(initial=0.0)
        if largest > max(DECREASE * last, 0.5 * STOP_RESIDUAL) and since < MOST_BETWEEN:
            continue
        if np.isfinite(part).all():
            solution += part
        part[:] = 0.0
        rest = product(solution)
        np.subtract(loads, rest, out=rest)
        largest = norms(rest).max(initial=0.0)
        if largest <= STOP_RESIDUAL:
            return solution, iteration
        if not largest <= LEAST_DECREASE * last:
            more, iterations = conjugate_gradients(product, _in_double(precondition), rest)
            return solution + more, iteration + iterations
        residuals, last, since = rest.astype(dtype), largest, 0
        product_of_residuals[:] = 0.0
    return solution + part, ITERATIONS


def _in_double(precondition: Preconditioner) -> Preconditioner:
    """A preconditioner in single precision, of residuals in double precision, whose scale may be any."""

    def apply(rest: FloatArray) -> FloatArray:
        return np.asarray(precondition(rest.astype(np.float32)), dtype=np.float64)

    return apply


def _dots(a: NumberArray, b: NumberArray) -> NumberArray:
    """Dot products (k,) of columns of (n, k) arrays, with sums over blocks in double precision."""
    found = np.zeros(a.shape[1], np.result_type(a, np.float64))
    rows = max(1, ENTRIES_IN_CACHE // a.shape[1])
    for start in range(0, len(a), rows):
        found += dots(a[start : start + rows], b[start : start + rows])
    return found


def _norms(columns: NumberArray) -> FloatArray:
    """Euclidean norms (k,) of the columns of an (n, k) array."""
    parts = columns if not np.iscomplexobj(columns) else columns.view(columns.real.dtype)
    squares = _dots(parts, parts)
    return np.asarray(np.sqrt(squares.reshape(columns.shape[1], -1).sum(axis=1)))


def _add_scaled(columns: NumberArray, others: NumberArray, factors: NumberArray) -> None:
    """Add other columns (n, k) times factors (k,) to columns (n, k), in place."""
    for own, other, factor in _in_parts(columns, others, factors):
        np.add(own, factor * other, out=own)


def _scale_and_add(columns: NumberArray, factors: NumberArray, others: NumberArray) -> None:
    """Multiply columns (n, k) by factors (k,), and add other columns, in place."""
    for own, other, factor in _in_parts(columns, others, factors):
        np.multiply(own, factor, out=own)
        np.add(own, other, out=own)


def _in_parts(
    columns: NumberArray, others: NumberArray, factors: NumberArray
) -> list[tuple[NumberArray, NumberArray, NumberArray]]:
    """Blocks in the cache of two contiguous arrays (n, k), some rows as one, and factors (k,) of the columns."""
    count, factors = columns.shape[1], factors.astype(columns.dtype)
    whole = len(columns) // ROWS_AS_ONE * ROWS_AS_ONE
    own, other = (each[:whole].reshape(-1, ROWS_AS_ONE * count) for each in (columns, others))
    tiled, rows = np.tile(factors, ROWS_AS_ONE), max(1, ENTRIES_IN_CACHE // (ROWS_AS_ONE * count))
    blocks = [slice(start, start + rows) for start in range(0, len(own), rows)]
    return [*((own[some], other[some], tiled) for some in blocks), (columns[whole:], others[whole:], factors)]
