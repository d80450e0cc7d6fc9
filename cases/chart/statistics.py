"""Statistics of runs: the Pareto front, and fitted exponents."""

import math
from collections.abc import Sequence

import numpy as np

from tetlux.meshing.arrays import BoolArray

# The least number of points that a line is fitted to.
FEWEST_FOR_A_FIT = 3


def pareto_front(seconds: Sequence[float], errors: Sequence[float]) -> BoolArray:
    """Which runs are on the Pareto front, (n,): no other is as fast and as accurate, and better in one of the two."""
    front = np.zeros(len(seconds), dtype=bool)
    best = math.inf
    for index in np.lexsort((errors, seconds)):
        if errors[index] < best:
            best, front[index] = errors[index], True
    return front


def fit_exponent(x: Sequence[float], y: Sequence[float]) -> float | None:
    """Fit p of ``y = c x^p`` by least squares of logarithms; None for fewer than three points or a single x."""
    if len(x) < FEWEST_FOR_A_FIT or min(*x, *y) <= 0 or max(x) == min(x):
        return None
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
