"""Tolerances of the exitance and of readings: their range, and which tetrahedra to split to meet them."""

from collections.abc import Iterable, Sequence

import numpy as np

from tetlux.fem.error.estimate import Estimate
from tetlux.fem.quadratic.reading_error import ReadingError
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError

# Share of their error that splitting tetrahedra is assumed to remove.
ERROR_REMOVED_SHARE = 0.4
# Tetrahedra that hold at least this share of the error are split, since each mesh costs a solution.
LEAST_SPLIT_SHARE = 0.3
# Tetrahedra that hold at most this share of the error are split at once.
LARGEST_SPLIT_SHARE = 0.8
# Rounds of splitting before the next solution: with two, meshes are as large as with one, and half as many are solved
# on; three overshoot.
MOST_ROUNDS = 2
# The error of the exitance that refinement aims at, as a share of the tolerance.
AIM_SHARE = 0.65
# The same on meshes with layers, on which the estimate of large bodies is below the error.
LAYERED_AIM_SHARE = 0.55
# The error of the total exited power that refinement aims at, as a share of the tolerance.
POWER_AIM_SHARE = 0.4
# The shares of these errors that the heights of layers may have at most, and that they are given when they are changed.
# They are changed by no more than the last factor at once.
LARGEST_HEIGHT_SHARE, HEIGHT_SHARE, LARGEST_CHANGE = 0.4, 0.3, 0.5
# An error of at most this many times the aim is not refined further.
REFINE_ABOVE = 1.05
# The estimated error of a reading that refinement aims at, as a share of the tolerance; it leaves room for true errors
# above the estimate.
READING_AIM_SHARE = 0.5
# A band of the surface or the volume, whose error is that of its worst points, is refined above the first of these
# shares of the tolerance, to the second: with less between them, the last steps are many.
FIELD_REFINE_SHARE, FIELD_AIM_SHARE = 0.95, 0.6
# Share of the square of a tetrahedron's error in a reading that one split is assumed to leave; squares add up to that
# of the reading.
SQUARE_LEFT_AFTER_SPLIT = 0.15
# A tetrahedron is split at most this often before the next solution.
MOST_SPLITS = 3


def check_tolerance(tolerance: float, name: str = "tolerance") -> None:
    """Refuse a tolerance that is not between 0.0001 and 1.

    Raises
    ------
    InputError
    """
    if not 1e-4 <= tolerance < 1:
        raise InputError(f"{name} is {tolerance:g}; give a relative error between 0.0001 and 1, such as 0.02.")


def cells_to_split(estimates: Sequence[Estimate], tolerance: float, rounds: int = MOST_ROUNDS) -> IntArray:
    """How often to split each tetrahedron, (m,): the fewest that bring the errors of each estimate to their aims.

    Each round splits those with the largest errors that are left.
    """
    splits = np.zeros(len(estimates[0].splits), dtype=np.int64)
    for estimate in estimates:
        each = (estimate.splits, np.ones_like(estimate.splits))
        for (indicators, of_heights, aim), often in zip(_aims(estimate, tolerance), each, strict=True):
            left = aim - min(float(of_heights.sum()), LARGEST_HEIGHT_SHARE * aim)
            splits = np.maximum(splits, np.minimum(often * _rounds(indicators - of_heights, left, rounds), MOST_SPLITS))
    return splits


def height_ratio(estimates: Iterable[Estimate], tolerance: float) -> float:
    """What the heights of layers have to be multiplied by to bring the errors of each estimate to their aims."""
    ratio = 1.0
    for estimate in estimates:
        for indicators, of_heights, aim in _aims(estimate, tolerance):
            if indicators.sum() > REFINE_ABOVE * aim and of_heights.sum() > LARGEST_HEIGHT_SHARE * aim:
                ratio = min(ratio, max(HEIGHT_SHARE * aim / float(of_heights.sum()), LARGEST_CHANGE))
    return ratio


def _aims(estimate: Estimate, tolerance: float) -> list[tuple[FloatArray, FloatArray, float]]:
    """The indicators (m,) of the exitance and of the power, what is due to heights in them, and the aims of both."""
    share = LAYERED_AIM_SHARE if estimate.of_heights.any() else AIM_SHARE
    aims = share * tolerance, POWER_AIM_SHARE * tolerance
    return list(zip((estimate.exitance_indicators, estimate.power_indicators), estimate.of_heights, aims, strict=True))


def _rounds(indicators: FloatArray, aim: float, most: int) -> IntArray:
    """How many rounds split each tetrahedron, (m,), so that the sum of indicators (m,) is expected to be `aim`."""
    left, rounds = np.array(indicators), np.zeros(len(indicators), dtype=np.int64)
    for _ in range(most):
        error = float(left.sum())
        if error <= REFINE_ABOVE * aim:
            break
        part = float(np.clip((1.0 - aim / error) / ERROR_REMOVED_SHARE, LEAST_SPLIT_SHARE, LARGEST_SPLIT_SHARE))
        order = np.argsort(-left)
        reached = np.cumsum(left[order])
        chosen = order[: int(np.searchsorted(reached, part * reached[-1])) + 1]
        left[chosen] *= 1.0 - ERROR_REMOVED_SHARE
        rounds[chosen] += 1
    return rounds


def splits_for_readings(readings: Iterable[ReadingError], tolerance: float, cells: int) -> IntArray:
    """How often to split each of `cells` tetrahedra, (m,), to bring every reading to its aim."""
    return _splits(readings, cells, REFINE_ABOVE * READING_AIM_SHARE * tolerance, READING_AIM_SHARE * tolerance)


def splits_for_fields(bands: Iterable[ReadingError], tolerance: float, cells: int) -> IntArray:
    """The same for bands of the surface or the volume."""
    return _splits(bands, cells, FIELD_REFINE_SHARE * tolerance, FIELD_AIM_SHARE * tolerance)


def _splits(readings: Iterable[ReadingError], cells: int, largest: float, aim: float) -> IntArray:
    """How often to split each of `cells` tetrahedra, (m,), to bring relative errors above the largest to the aim.

    A common level bounds the square of each tetrahedron's error. It is chosen so that the bounded squares sum to
    what the aim leaves of them, and tetrahedra above it are split until they are below.
    """
    splits = np.zeros(cells, dtype=np.int64)
    for reading in readings:
        if not reading.error > largest * abs(reading.value):
            continue
        # Splits are assumed to reduce the sum of signed contributions as they reduce that of squares.
        wanted = float(reading.squares.sum()) * (aim * abs(reading.value) / reading.error) ** 2
        if wanted == 0.0:
            continue
        ascending = np.sort(reading.squares)
        # The sum of the bounded squares for a level equal to each tetrahedron's square in turn.
        sums = np.cumsum(ascending) + ascending * np.arange(cells - 1, -1, -1)
        level = ascending[max(int(np.searchsorted(sums, wanted)) - 1, 0)]
        level = max(float(level), wanted / cells)
        over = np.maximum(reading.squares / level, 1.0)
        splits = np.maximum(splits, np.ceil(np.log(over) / np.log(1.0 / SQUARE_LEFT_AFTER_SPLIT)).astype(np.int64))
    return np.minimum(splits, MOST_SPLITS)
