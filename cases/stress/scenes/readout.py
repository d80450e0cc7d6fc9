"""`Readout`: values that are held against a closed form, with their error bars."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.outcome.reading import Reading
from tetlux.meshing.arrays import FloatArray, NumberArray

# Limit of the adaptive runs, low since the map shows failures and not how fine a mesh can get.
MOST_TETRAHEDRA = 30_000


@dataclass(frozen=True, eq=False)
class Readout:
    """Values (n,) that are held against a closed form, their relative error bars (n,), and how they were found."""

    values: NumberArray
    bars: FloatArray
    nodes: int
    warnings: tuple[str, ...]


def bars_of(readings: Sequence[Reading]) -> FloatArray:
    """The relative errors of readings (d,), (d,); a missing one allows any error."""
    return np.array([math.inf if each.relative_error is None else each.relative_error for each in readings])
