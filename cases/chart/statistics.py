"""What runs add up to: the Pareto front, and fitted exponents."""

import math
from collections.abc import Sequence

import numpy as np

from tetlux.meshing.arrays import BoolArray

# Fewer points than this make no line.
FEWEST_FOR_A_FIT = 3


def pareto_front(seconds: Sequence[float], errors: Sequence[float]) -> BoolArray:
    """Which runs (n,) are not beaten: no other is as quick and as accurate, and better in one of the two."""
    front = np.zeros(len(seconds), dtype=bool)
    best = math.inf
    for index in np.lexsort((errors, seconds)):
        if errors[index] < best:
            best, front[index] = errors[index], True
    return front


def fitted_exponent(x: Sequence[float], y: Sequence[float]) -> float | None:
    """The p of ``y = c x^p`` by least squares of the logarithms; None for fewer than three points or one x."""
    if len(x) < FEWEST_FOR_A_FIT or min(*x, *y) <= 0 or max(x) == min(x):
        return None
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
