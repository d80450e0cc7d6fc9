"""Parts of the Fourier and Bessel series for a cylinder."""

import math

import numpy as np

from tetlux.fem.exact.numerics.bessel import CYLINDRICAL, TABLE_SIZE, wall_rates
from tetlux.fem.exact.numerics.quadrature import CUTOFF
from tetlux.meshing.arrays import FloatArray


def reach(k: float, a: float, t: float) -> float:
    """The largest q of the integral, 1/unit: there ``e^{-(kappa - k)(a - r0)}`` is below the cutoff."""
    rest = CUTOFF / (a * (1.0 - t))
    return math.sqrt(rest * (rest + 2.0 * k))


def multiplicity(order: int) -> FloatArray:
    """``e_m`` for m = 0..order: 1 for m = 0, else 2."""
    return np.asarray(np.where(np.arange(order + 1) == 0, 1.0, 2.0))


def reflection(beta: float, x: FloatArray, order: int) -> FloatArray:
    """``e_m (beta v - 1)/[(1 + beta u)(u + v)]``, of shape (order + 1, len(x))."""
    rates = wall_rates(order, x, CYLINDRICAL)
    u, v = rates.growth, rates.decay
    with np.errstate(divide="ignore"):  # order 0 at x = 0
        return np.asarray(multiplicity(order)[:, None] * (beta * v - 1.0) / ((1.0 + beta * u) * (u + v)))


def cosine_sum(series: FloatArray, theta: FloatArray) -> FloatArray:
    """``sum_m c_m cos(m theta)``; coefficients (orders, 1) for all angles, or (orders, n)."""
    total = np.zeros_like(theta)
    chunk = max(1, TABLE_SIZE // max(theta.size, 1))
    for start in range(0, len(series), chunk):
        m = np.arange(start, min(start + chunk, len(series)))
        total += np.sum(series[m] * np.cos(np.outer(m, theta)), axis=0)
    return total
