"""Empty arrays for the defaults of fields, and numbers of tetrahedra that may be unknown."""

from collections.abc import Sequence

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray


def no_vectors() -> FloatArray:
    """No points or directions, (0, 3)."""
    return np.zeros((0, 3))


def no_values() -> FloatArray:
    """No numbers, (0,)."""
    return np.zeros(0)


def join_cells(parts: Sequence[tuple[IntArray | None, int]]) -> IntArray | None:
    """Join numbers of tetrahedra.

    Parameters
    ----------
    parts : sequence of (ndarray or None, int)
        Numbers (k,) and their count k; None where all k are unknown.

    Returns
    -------
    ndarray or None
        -1 where unknown; None if all are.
    """
    if all(cells is None for cells, _ in parts):
        return None
    return np.concatenate([np.full(count, -1) if cells is None else cells for cells, count in parts])
