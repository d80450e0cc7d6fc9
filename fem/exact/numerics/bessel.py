"""Ratios of modified Bessel functions, which neither overflow nor underflow at any order.

The recurrences hold for ``I_nu`` and ``K_nu`` with ``nu = l + half`` (DLMF 10.29.1, 10.51.4). `half` is SPHERICAL for
``i_l`` and ``k_l``, which are ``I_nu`` and ``K_nu`` but for a power of the argument, and CYLINDRICAL for ``I_l`` and
``K_l``.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from tetlux.meshing.arrays import FloatArray

SPHERICAL, CYLINDRICAL = 0.5, 0.0
# Numbers in one table of ratios: 32 MB.
TABLE_SIZE = 4_000_000


@dataclass(frozen=True)
class WallRates:
    """Logarithmic derivatives of both solutions at the wall, of the orders 0, 1, 2, ...

    Attributes
    ----------
    growth : (orders, ...) ndarray
        ``u = x i'(x)/i(x)`` of the solution that is regular at the centre.
    decay : (orders, ...) ndarray
        ``v = -x k'(x)/k(x)`` of the solution that vanishes at infinity. By the Wronskian, ``i k`` is
        ``1/(x (u + v))`` for the spherical functions and ``1/(u + v)`` for the cylindrical ones.
    """

    growth: FloatArray
    decay: FloatArray


def ratios_of_orders(order: int, x: FloatArray, half: float) -> FloatArray:
    """``H_l = I_{nu+1}(x)/(x I_nu(x))`` for l = 0..order, by the downward continued fraction.

    Downward recurrence is stable: in each step at an order above x, the error of the initial value falls by a factor of
    6. At x = 0 the value is ``1/(2 nu + 2)``.

    Parameters
    ----------
    order : int
        Largest l.
    x : (...) ndarray
        Arguments, not negative.
    half : float
        SPHERICAL or CYLINDRICAL.

    Returns
    -------
    (order + 1, ...) ndarray
    """
    start = int(max(order, np.max(x, initial=0.0))) + 40
    squared = x**2
    nu = start + half
    value = 1.0 / (nu + 1.0 + np.hypot(nu + 1.0, x))
    result = np.empty((order + 1, *x.shape))
    for l in range(start - 1, -1, -1):  # noqa: E741 - the order has been l since Legendre
        value = 1.0 / (2.0 * (l + half + 1.0) + squared * value)
        if l <= order:
            result[l] = value
    return result


def wall_rates(order: int, x: FloatArray, half: float) -> WallRates:
    """Logarithmic derivatives of both solutions at argument `x`, for l = 0..order.

    Upward recurrence is stable for the decaying solution. The cylindrical decay of order 0 vanishes like
    ``1/log(1/x)`` at x = 0.

    Parameters
    ----------
    order : int
        Largest l.
    x : (...) ndarray
        Arguments, not negative.
    half : float
        SPHERICAL or CYLINDRICAL.

    Returns
    -------
    WallRates
        With arrays of shape (order + 1, ...).
    """
    orders = np.arange(order + 1, dtype=float).reshape(-1, *(1,) * x.ndim)
    growth = orders + x**2 * ratios_of_orders(order, x, half)
    # s_l = x k_{l-1}(x)/k_l(x)
    decay = np.empty((order + 1, *x.shape))
    if half:
        s = x.copy()
    else:
        safe = np.maximum(x, 1e-300)
        s = np.where(x > 0, safe * special.k1e(safe) / special.k0e(safe), 0.0)
    squared = x**2
    for l in range(order + 1):  # noqa: E741
        decay[l] = s + l + 2.0 * half
        s = squared / np.maximum(s + 2.0 * (l + half), 1e-300)
    return WallRates(growth, decay)


def inner_ratios(order: int, x: float | FloatArray, fraction: FloatArray, half: float) -> FloatArray:
    """``rho_l = i_l(x t)/i_l(x)`` with the fraction t of the radius, for l = 0..order.

    Parameters
    ----------
    order : int
        Largest l.
    x : float or ndarray
        Argument at the wall; its shape must broadcast with that of `fraction`.
    fraction : (...) ndarray
        ``t``, from 0 to 1.
    half : float
        SPHERICAL or CYLINDRICAL.

    Returns
    -------
    (order + 1, ...) ndarray
        Falls with l; at x = 0 it is ``t^l``.
    """
    wall = np.asarray(x, dtype=float)
    wall = wall.reshape((1,) * (fraction.ndim - wall.ndim) + wall.shape)
    inner = wall * fraction
    start = _sinhc_scaled if half else special.i0e
    first = start(inner) / start(wall)
    step = fraction * ratios_of_orders(order, inner, half)[:-1] / ratios_of_orders(order, wall, half)[:-1]
    result = np.empty((order + 1, *inner.shape))
    result[0] = first * np.exp(inner - wall)
    result[1:] = step
    # High orders underflow to 0, which is correct to rounding.
    with np.errstate(under="ignore"):
        return np.cumprod(result, axis=0, out=result)


def order_needed(x: float, fraction: float, half: float, digits: float) -> int:
    """The order at which ``i_l(x t)/i_l(x)`` has fallen to ``exp(-digits)`` of its value at order 0.

    It follows from the leading term of the uniform expansion of ``I_nu(nu z)`` (DLMF 10.41.3).
    """
    if fraction <= 0.0:
        return 1

    def decay(l: float) -> float:  # noqa: E741
        nu = l + half
        outer, inner = np.hypot(nu, x), np.hypot(nu, x * fraction)
        rise = nu * np.log((nu + inner) / (fraction * (nu + outer))) if nu else 0.0
        return float(outer - inner + rise - x * (1.0 - fraction))

    high = 1
    while decay(high) < digits and high < 2**40:
        high *= 2
    low = high // 2
    while high - low > max(1, high // 64):
        middle = (low + high) // 2
        low, high = (middle, high) if decay(middle) < digits else (low, middle)
    return high + 2


def _sinhc_scaled(x: FloatArray) -> FloatArray:
    """``i_0(x) e^{-x} = (1 - e^{-2x})/(2x)``."""
    safe = np.where(x > 0, x, 1.0)
    return np.where(x > 0, -np.expm1(-2.0 * safe) / (2.0 * safe), 1.0)
