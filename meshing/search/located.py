"""`Located`: closest points that were found before, so that each point of a surface is located once."""

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray

# Points that are remembered; with more, all are forgotten. They take 60 bytes each.
MOST_POINTS = 1_000_000
# Odd factors that mix the bits of the three coordinates of a point.
FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)


Keys = np.ndarray[tuple[int], np.dtype[np.uint64]]
_NOTHING: tuple[Keys, FloatArray, FloatArray, IntArray] = (
    np.zeros(0, np.uint64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, np.int64)
)  # fmt: skip


class Located:
    """Queries, and the closest point and triangle of each, found again by the bits of their coordinates."""

    def __init__(self) -> None:
        # Replaced as a whole, since other threads may be reading: sorted keys, queries, closest points, triangles.
        self._known = _NOTHING

    def find(self, queries: FloatArray) -> tuple[BoolArray, FloatArray, IntArray]:
        """Which queries (q, 3) are known, and their closest points (q, 3) and triangles (q,); others have any."""
        keys, known, nearest, faces = self._known
        if len(keys) == 0:
            return np.zeros(len(queries), dtype=bool), np.zeros((len(queries), 3)), np.zeros(len(queries), np.int64)
        row = np.minimum(np.searchsorted(keys, _keys_of(queries)), len(keys) - 1)
        # Of two points with one key, only the first is found.
        return (known[row] == queries).all(axis=1), nearest[row], faces[row]

    def add(self, queries: FloatArray, nearest: FloatArray, faces: IntArray) -> None:
        """Remember queries (q, 3), their closest points (q, 3) and triangles (q,)."""
        before = self._known if len(self._known[0]) + len(queries) <= MOST_POINTS else _NOTHING
        columns = zip(before, (_keys_of(queries), queries, nearest, faces), strict=True)
        keys, *others = (np.concatenate(pair) for pair in columns)
        order = np.argsort(keys, kind="stable")
        self._known = keys[order], others[0][order], others[1][order], others[2][order]


def _keys_of(points: FloatArray) -> Keys:
    """A number for each point (n, 3), the same for the same coordinates."""
    # Adding 0 makes -0 the same as 0.
    bits = np.ascontiguousarray(points + 0.0).view(np.uint64)
    mixed = bits[:, 0] * FACTORS[0]
    for axis in (1, 2):
        mixed = (mixed ^ (mixed >> np.uint64(29)) ^ bits[:, axis]) * FACTORS[axis]
    return np.asarray(mixed ^ (mixed >> np.uint64(32)))
