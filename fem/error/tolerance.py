"""Tolerances of the exitance and of readings: their range, and which tetrahedra to split to meet them."""

from collections.abc import Iterable

import numpy as np

from tetlux.fem.error.estimate import Estimate
from tetlux.fem.error.readings import ReadingError
from tetlux.meshing.arrays import BoolArray
from tetlux.meshing.errors import InputError

# Splitting tetrahedra removes the share GAIN of their error. Split those that hold enough of it to reach the aim, but
# always LEAST_SHARE of all error, since each mesh costs a solution, and at most SPLIT_SHARE.
SPLIT_SHARE, GAIN, LEAST_SHARE = 0.8, 0.4, 0.3
# The aim of refinement, as a share of the tolerance: for the exitance, and for the total power that leaves.
SAFETY, POWER_SAFETY = 0.65, 0.4
# Do not refine again when within 5 % of the aim.
WORTH_A_MESH = 1.05


# The same for readings: errors add up by their squares there, and quadratic elements gain more. Their aim, as a share
# of the tolerance, leaves room for errors of more than the bar.
READING_GAIN, READING_SHARES, READING_SAFETY = 0.85, (0.5, 0.95), 0.6


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


def cells_for_readings(readings: Iterable[ReadingError], tolerance: float, cells: int) -> BoolArray:
    """Whether to split each of so many tetrahedra, (m,), to bring every reading to its aim."""
    marked = np.zeros(cells, dtype=bool)
    for reading in readings:
        aim = READING_SAFETY * tolerance
        if not reading.relative > WORTH_A_MESH * aim:
            continue
        wanted = (1.0 - min(aim / reading.relative, 1.0) ** 2) / READING_GAIN
        order = np.argsort(-reading.squares)
        reached = np.cumsum(reading.squares[order])
        part = float(np.clip(wanted, *READING_SHARES))
        marked[order[: int(np.searchsorted(reached, part * reached[-1])) + 1]] = True
    return marked
