"""Quadrature for integrands with a boundary layer of any width at one end."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from tetlux.meshing.arrays import FloatArray

# Integrals and sums end where a factor has fallen to exp(-CUTOFF), which is below the rounding of a double.
CUTOFF = 40.0


@lru_cache(maxsize=16)
def graded_rule(levels: int = 40, order: int = 14) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights on (0, 1): Gauss-Legendre on panels that halve towards 0.

    A singularity anywhere left of 0, or above or below it in the complex plane, is at least one panel
    length away from each panel, so the error falls like ``5.8^(-2 order)`` at every scale down to
    ``2^-levels`` (Trefethen, Approximation Theory and Approximation Practice, chapter 19).

    Returns
    -------
    nodes, weights : (levels * order,) ndarray
    """
    edges = np.concatenate([[0.0], 2.0 ** np.arange(1 - levels, 1, dtype=float)])
    return composite_rule(edges, order)


def composite_rule(edges: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of Gauss-Legendre quadrature of `order` points between neighbouring `edges`."""
    x, w = np.polynomial.legendre.leggauss(order)
    length = np.diff(edges)[:, None]
    nodes = edges[:-1, None] + 0.5 * length * (1.0 + x)
    return nodes.ravel(), np.asarray(0.5 * length * w).ravel()


def convolve_decays(s: FloatArray, first: float, second: float) -> FloatArray:
    """``∫0..s e^{-first t} e^{-second (s - t)} dt``, also if both rates are equal."""
    slow, difference = min(first, second), abs(first - second)
    if difference == 0.0:
        return np.asarray(s * np.exp(-slow * s))
    return np.asarray(np.exp(-slow * s) * -np.expm1(-difference * s) / difference)


def compute_in_chunks(compute: Callable[..., FloatArray], *arrays: FloatArray, size: int = 4096) -> FloatArray:
    """``compute(*arrays)``, of `size` entries at a time, which bounds the memory for tables of nodes times points."""
    total = arrays[0].size
    if total <= size:
        return compute(*arrays)
    parts = [slice(start, start + size) for start in range(0, total, size)]
    return np.concatenate([compute(*(array[part] for array in arrays)) for part in parts])
