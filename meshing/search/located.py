"""`Located`: closest points that were found before, so that each point of a surface is located once."""

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray

# Points that are remembered; with more, all are forgotten. They take 60 bytes each.
MOST_POINTS = 1_000_000
# Odd factors that mix the bits of the three coordinates of a point.
FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)


# A table is merged with the one before it unless that is so many times as long: so few points are copied often.
GROWTH = 8

Keys = np.ndarray[tuple[int], np.dtype[np.uint64]]
# Sorted keys, queries, closest points, triangles.
_Table = tuple[Keys, FloatArray, FloatArray, IntArray]


class Located:
    """Queries, and the closest point and triangle of each, found again by the bits of their coordinates."""

    def __init__(self) -> None:
        # From long to short; replaced as a whole, since other threads may be reading.
        self._tables: tuple[_Table, ...] = ()

    def find(self, queries: FloatArray) -> tuple[BoolArray, FloatArray, IntArray]:
        """Which queries (q, 3) are known, and their closest points (q, 3) and triangles (q,); others have any."""
        count = len(queries)
        known, nearest, faces = np.zeros(count, dtype=bool), np.zeros((count, 3)), np.zeros(count, np.int64)
        wanted = _keys_of(queries) if self._tables else np.zeros(count, np.uint64)
        for keys, points, closest, triangles in self._tables:
            row = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
            # Of two points with one key, only the first is found.
            here = (points[row] == queries).all(axis=1)
            known |= here
            nearest[here], faces[here] = closest[row[here]], triangles[row[here]]
        return known, nearest, faces

    def add(self, queries: FloatArray, nearest: FloatArray, faces: IntArray) -> None:
        """Remember queries (q, 3), their closest points (q, 3) and triangles (q,)."""
        if len(queries) == 0:
            return
        before = self._tables
        if sum(len(keys) for keys, *_ in before) + len(queries) > MOST_POINTS:
            before = ()
        merged = [(_keys_of(queries), queries, nearest, faces)]
        length = len(queries)
        while before and len(before[-1][0]) < GROWTH * length:
            length += len(before[-1][0])
            merged.append(before[-1])
            before = before[:-1]
        self._tables = (*before, _merge(merged))


def _merge(tables: list[_Table]) -> _Table:
    """One table of several."""
    keys, queries, nearest, faces = (np.concatenate(columns) for columns in zip(*tables, strict=True))
    order = np.argsort(keys, kind="stable")
    return keys[order], queries[order], nearest[order], faces[order]


def _keys_of(points: FloatArray) -> Keys:
    """A number for each point (n, 3), the same for the same coordinates."""
    # Adding 0 makes -0 the same as 0.
    bits = np.ascontiguousarray(points + 0.0).view(np.uint64)
    mixed = bits[:, 0] * FACTORS[0]
    for axis in (1, 2):
        mixed = (mixed ^ (mixed >> np.uint64(29)) ^ bits[:, axis]) * FACTORS[axis]
    return np.asarray(mixed ^ (mixed >> np.uint64(32)))
