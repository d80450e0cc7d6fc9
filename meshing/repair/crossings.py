"""Count the self-intersections of a closed surface."""

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.search.proximity import cross_segments, overlapping_boxes

# An edge that ends within this share of its length of a triangle touches it and does not pierce it.
TOUCH = 1e-6
# Largest number of pairs with overlapping boxes that are tested: per triangle, plus a constant. A surface of even
# triangles has ten pairs per triangle; n needles that meet in one vertex have n squared.
PAIRS = (30, 40_000_000)


def count_self_intersections(points: FloatArray, faces: IntArray) -> int | None:
    """How many triangles are pierced by an edge of a triangle that shares no vertex with that edge.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
        A closed surface, consistently oriented.

    Returns
    -------
    int or None
        None if there are too many pairs to test, and the tested ones do not intersect.
    """
    left = PAIRS[0] * len(faces) + PAIRS[1]
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    heights = np.einsum("ij,ij->i", normals, corners[:, 0])
    folded: BoolArray = np.asarray((~_flat_fans(points, faces, normals)[faces]).any(axis=1))
    pierced = np.zeros(len(faces), dtype=bool)
    for i, j in overlapping_boxes(corners.min(axis=1), corners.max(axis=1)):
        left -= len(i)
        if left < 0:
            return int(pierced.sum()) or None
        shared = np.zeros(len(i), dtype=np.int8)
        for a in faces.T:
            for b in faces.T:
                shared += a[i] == b[j]
        # The boxes of neighbours always overlap, but triangles of a flat fan meet only at their vertex.
        suspect = (shared == 0) | ((shared == 1) & folded[i] & folded[j])
        first, second = i[suspect], j[suspect]
        for face, other in ((first, second), (second, first)):
            side = np.einsum("ij,ikj->ik", normals[face], corners[other]) - heights[face][:, None]
            for a, b in ((0, 1), (1, 2), (2, 0)):
                start, end = faces[other, a], faces[other, b]
                # Each edge is tested once: from the triangle that traverses it in ascending order of vertices.
                crosses = (start < end) & (side[:, a] * side[:, b] < 0)
                target, start, end = face[crosses], start[crosses], end[crosses]
                apart = (faces[target] != start[:, None]).all(axis=1) & (faces[target] != end[:, None]).all(axis=1)
                target, start, end = target[apart], points[start[apart]], points[end[apart]]
                t, _ = cross_segments(start, end - start, corners[target], slack=1e-9)
                # An edge that ends on a triangle only touches it; one that passes through its rim crosses the surface.
                pierced[target[(t > TOUCH) & (t < 1.0 - TOUCH)]] = True
    return int(pierced.sum())


def _flat_fans(points: FloatArray, faces: IntArray, normals: FloatArray) -> BoolArray:
    """Whether the triangles round each vertex project onto its tangent plane without overlap, (n,).

    Then no two of them meet elsewhere (Volino & Magnenat-Thalmann 1994). They do if all face the same side of
    the plane and go round the vertex once; `normals` need no length.
    """
    axis = np.empty_like(points)
    for k in range(3):
        axis[:, k] = np.bincount(faces.ravel(), np.repeat(normals[:, k], 3), minlength=len(points))
    length = np.linalg.norm(axis, axis=1)
    axis /= np.where(length > 0, length, 1.0)[:, None]
    turn = np.zeros(len(points))
    flat = length > 0
    for k in range(3):
        vertex = faces[:, k]
        up = axis[vertex]
        u, v = (points[faces[:, (k + i) % 3]] - points[vertex] for i in (1, 2))
        facing = np.einsum("ij,ij->i", normals, up)
        flat[vertex[facing <= 0]] = False
        along = np.einsum("ij,ij->i", u, v) - np.einsum("ij,ij->i", u, up) * np.einsum("ij,ij->i", v, up)
        turn += np.bincount(vertex, np.arctan2(facing, along), minlength=len(points))
    return np.asarray(flat & (np.abs(turn - 2.0 * np.pi) < 1e-6))
