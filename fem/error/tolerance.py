"""The tolerance of the exitance: its range, and which tetrahedra to split to meet it."""

from collections.abc import Iterable

import numpy as np

from tetlux.fem.error.estimate import Estimate
from tetlux.meshing.arrays import BoolArray
from tetlux.meshing.errors import InputError

# Splitting tetrahedra removes the share GAIN of their error. Split those that hold enough of it to reach the aim, but
# always LEAST_SHARE of all error, since each mesh costs a solution, and at most SPLIT_SHARE.
SPLIT_SHARE, GAIN, LEAST_SHARE = 0.8, 0.4, 0.3
# The aim of refinement, as a share of the tolerance: for the exitance, and for the total power that leaves.
SAFETY, POWER_SAFETY = 0.65, 0.4
# Do not refine again when within 5 % of the aim.
WORTH_A_MESH = 1.05


def check_tolerance(tolerance: float) -> None:
    """Refuse a tolerance that is no sensible relative error.

    Raises
    ------
    InputError
    """
    if not 1e-4 <= tolerance < 1:
        raise InputError(f"tolerance is {tolerance:g}; give a relative error between 0.0001 and 1, such as 0.02.")


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
