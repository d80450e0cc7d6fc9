"""Parts of the Fourier and Bessel series for a cylinder."""

import math

import numpy as np

from tetlux.fem.exact.numerics.bessel import wall_rates
from tetlux.fem.exact.numerics.quadrature import CUTOFF
from tetlux.meshing.arrays import FloatArray

HALF = 0.0  # the order of I_m is m itself
CHUNK = 4_000_000  # numbers in one table of ratios: 32 MB


def reach(k: float, a: float, t: float) -> float:
    """Largest q to integrate to, 1/unit: ``e^{-(kappa - k)(a - r0)}`` has fallen to the cutoff there."""
    rest = CUTOFF / (a * (1.0 - t))
    return math.sqrt(rest * (rest + 2.0 * k))


def multiplicity(order: int) -> FloatArray:
    """``e_m``: 1 for order 0, else 2."""
    return np.asarray(np.where(np.arange(order + 1) == 0, 1.0, 2.0))


def reflection(beta: float, x: FloatArray, order: int) -> FloatArray:
    """``e_m (beta v - 1)/[(1 + beta u)(u + v)]``, of shape (order + 1, len(x))."""
    rates = wall_rates(order, x, HALF)
    u, v = rates.growth, rates.decay
    with np.errstate(divide="ignore"):  # order 0 at x = 0
        return np.asarray(multiplicity(order)[:, None] * (beta * v - 1.0) / ((1.0 + beta * u) * (u + v)))


def cosine_sum(series: FloatArray, theta: FloatArray) -> FloatArray:
    """``sum_m c_m cos(m theta)``; coefficients (orders, 1) for all angles, or (orders, n)."""
    total = np.zeros_like(theta)
    chunk = max(1, CHUNK // max(theta.size, 1))
    for start in range(0, len(series), chunk):
        m = np.arange(start, min(start + chunk, len(series)))
        total += np.sum(series[m] * np.cos(np.outer(m, theta)), axis=0)
    return total
