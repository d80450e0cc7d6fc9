"""Triangulate the polygons of a file."""

from collections.abc import Sequence

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.repair.caps import triangulate_polygon


def triangulate(points: FloatArray, corners: IntArray, counts: IntArray) -> IntArray:
    """Triangles (t, 3) of polygons; those of fewer than three corners are dropped.

    Parameters
    ----------
    points : (n, 3) ndarray
    corners : (c,) ndarray
        The concatenated vertices of all polygons.
    counts : (p,) ndarray
        The number of corners of each.
    """
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    if corners.min() < 0 or corners.max() >= len(points):
        raise ValueError("a polygon names a vertex that does not exist")
    start = np.cumsum(counts) - counts
    place, triangles = [], []
    for count in np.unique(counts[counts >= 3]):
        which = np.flatnonzero(counts == count)
        polygons = corners[start[which, None] + np.arange(count)]
        fans = np.stack([polygons[:, [0, i, i + 1]] for i in range(1, count - 1)], axis=1)
        for i in _concave(points, fans):
            fans[i] = polygons[i][triangulate_polygon(points[polygons[i]])]
        triangles.append(fans.reshape(-1, 3))
        place.append(np.repeat(start[which], count - 2))
    if not triangles:
        return np.zeros((0, 3), dtype=np.int64)
    return np.concatenate(triangles)[np.argsort(np.concatenate(place), kind="stable")]


def _concave(points: FloatArray, fans: IntArray) -> IntArray:
    """Indices of concave polygons: fans (p, k - 2, 3) whose triangles face different ways."""
    if fans.shape[1] < 2:
        return np.zeros(0, dtype=np.int64)
    corners = points[fans]
    normals = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    along = np.einsum("pki,pi->pk", normals, normals.sum(axis=1))
    return np.flatnonzero((along < 0).any(axis=1))


def flatten(rows: Sequence[Sequence[object]]) -> tuple[list[object], IntArray]:
    """The concatenated items of the rows, and the number of items of each."""
    counts = np.fromiter(map(len, rows), dtype=np.int64, count=len(rows))
    return [value for row in rows for value in row], counts
