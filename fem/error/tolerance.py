"""Tolerances of the exitance and of readings: their range, and which tetrahedra to split to meet them."""

from collections.abc import Iterable

import numpy as np

from tetlux.fem.error.estimate import Estimate
from tetlux.fem.quadratic.error import ReadingError
from tetlux.meshing.arrays import BoolArray, IntArray
from tetlux.meshing.errors import InputError

# Splitting tetrahedra removes the share GAIN of their error. Split those that hold enough of it to reach the aim, but
# always LEAST_SHARE of all error, since each mesh costs a solution, and at most SPLIT_SHARE.
SPLIT_SHARE, GAIN, LEAST_SHARE = 0.8, 0.4, 0.3
# The aim of refinement, as a share of the tolerance: for the exitance, and for the total power that leaves.
SAFETY, POWER_SAFETY = 0.65, 0.4
# Do not refine again when within 5 % of the aim.
WORTH_A_MESH = 1.05


# The aim of refinement for readings, as a share of the tolerance, leaves room for errors of more than the bar. There
# errors add up by their squares: splitting a tetrahedron leaves this share of its square. It is split this often at
# most before the next solution.
READING_SAFETY, LEFT, MOST_SPLITS = 0.5, 0.15, 3


def check_tolerance(tolerance: float, name: str = "tolerance") -> None:
    """Refuse a tolerance that is no sensible relative error.

    Raises
    ------
    InputError
    """
    if not 1e-4 <= tolerance < 1:
        raise InputError(f"{name} is {tolerance:g}; give a relative error between 0.0001 and 1, such as 0.02.")


def cells_to_split(estimates: Iterable[Estimate], tolerance: float) -> BoolArray:
    """Whether to split each tetrahedron, (m,): the fewest that bring the errors of each estimate to their aims."""
    wanted = [
        aim
        for estimate in estimates
        for aim in ((estimate.shares, SAFETY * tolerance), (estimate.power_shares, POWER_SAFETY * tolerance))
    ]
    marked = np.zeros(len(wanted[0][0]), dtype=bool)
    for shares, aim in wanted:
        error = float(shares.sum())
        if error <= WORTH_A_MESH * aim:
            continue
        part = float(np.clip((1.0 - aim / error) / GAIN, LEAST_SHARE, SPLIT_SHARE))
        order = np.argsort(-shares)
        reached = np.cumsum(shares[order])
        marked[order[: int(np.searchsorted(reached, part * reached[-1])) + 1]] = True
    return marked


def splits_for_readings(readings: Iterable[ReadingError], tolerance: float, cells: int) -> IntArray:
    """How often to split each of so many tetrahedra, (m,), to bring every reading to its aim.

    Tetrahedra are split until none adds more than a level to the square of the error, at which these sum to the aim.
    """
    splits = np.zeros(cells, dtype=np.int64)
    for reading in readings:
        aim = READING_SAFETY * tolerance * abs(reading.value)
        if not reading.error > WORTH_A_MESH * aim:
            continue
        ascending = np.sort(reading.squares)
        # What all sum to if the level is the square of each tetrahedron in turn.
        sums = np.cumsum(ascending) + ascending * np.arange(cells - 1, -1, -1)
        level = ascending[max(int(np.searchsorted(sums, aim**2)) - 1, 0)]
        level = max(float(level), aim**2 / cells)
        over = np.maximum(reading.squares / level, 1.0)
        splits = np.maximum(splits, np.ceil(np.log(over) / np.log(1.0 / LEFT)).astype(np.int64))
    return np.minimum(splits, MOST_SPLITS)
