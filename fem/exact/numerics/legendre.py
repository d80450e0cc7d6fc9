"""Sums of Legendre series of any length."""

import numpy as np

from tetlux.meshing.arrays import FloatArray


def legendre_sum(coefficients: FloatArray, gamma: FloatArray) -> FloatArray:
    """``sum_l c_l P_l(cos gamma)``.

    The recurrence is that of the differences ``P_{l+1} - P_l`` with ``1 - cos gamma = 2 sin²(gamma/2)``: at high orders
    and small angles, ``cos gamma`` has too few digits.

    Parameters
    ----------
    coefficients : (orders,) or (orders, n) ndarray
        One series for all angles, or one for each angle.
    gamma : (n,) ndarray
        Angles, radians.

    Returns
    -------
    (n,) ndarray
    """
    versine = 2.0 * np.sin(0.5 * gamma) ** 2
    value = np.ones_like(gamma)
    difference = np.zeros_like(gamma)
    total = np.zeros_like(gamma)
    for l, coefficient in enumerate(coefficients):  # noqa: E741
        total += coefficient * value
        difference = (l * difference - (2 * l + 1) * versine * value) / (l + 1)
        value = value + difference
    return total
