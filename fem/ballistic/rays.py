"""`Rays`: thin beams by start, direction and power."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line

NO_CELLS = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Rays:
    """Thin beams.

    Parameters
    ----------
    starts, directions : (r, 3) ndarray
        Start points, unit, and unit vectors.
    powers : (r,) ndarray
        W.
    cells : (r,) ndarray, optional
        Tetrahedron of a mesh in which each ray starts; -1, the default, where unknown.
    """

    starts: FloatArray
    directions: FloatArray
    powers: FloatArray
    cells: IntArray = field(default_factory=lambda: NO_CELLS)

    def __post_init__(self) -> None:
        if self.cells is NO_CELLS:
            object.__setattr__(self, "cells", np.full(len(self.powers), -1))

    def __len__(self) -> int:
        return len(self.powers)

    def __getitem__(self, some: BoolArray | IntArray) -> "Rays":
        return Rays(self.starts[some], self.directions[some], self.powers[some], self.cells[some])

    __repr__ = one_line


def join_rays(parts: Sequence[Rays]) -> Rays:
    """Join the rays of several parts, or of none."""
    return Rays(
        np.vstack([np.zeros((0, 3)), *(part.starts for part in parts)]),
        np.vstack([np.zeros((0, 3)), *(part.directions for part in parts)]),
        np.concatenate([np.zeros(0), *(part.powers for part in parts)]),
        np.concatenate([NO_CELLS, *(part.cells for part in parts)]),
    )
