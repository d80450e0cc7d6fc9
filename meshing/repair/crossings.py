"""Where does a closed surface cross itself? Counted, for a warning."""

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.search.proximity import cross_segments, overlapping_boxes

# An edge whose end is this share of its length from a triangle touches it and does not pierce it.
TOUCH = 1e-6
# Pairs of triangles whose boxes overlap that are looked at: of each triangle, and besides. An even surface has ten of
# each; needles side by side, such as ten thousand that meet in one vertex, have as many as their number squared.
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
        None if there are too many triangles side by side for all to be looked at, and none was found among the first.
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
        # Neighbours overlap as boxes, and round a flat fan they meet at their vertex only.
        suspect = (shared == 0) | ((shared == 1) & folded[i] & folded[j])
        first, second = i[suspect], j[suspect]
        for face, other in ((first, second), (second, first)):
            side = np.einsum("ij,ikj->ik", normals[face], corners[other]) - heights[face][:, None]
            for a, b in ((0, 1), (1, 2), (2, 0)):
                start, end = faces[other, a], faces[other, b]
                # Of the two triangles at an edge one walks it up the vertex numbers: once is enough.
                crosses = (start < end) & (side[:, a] * side[:, b] < 0)
                target, start, end = face[crosses], start[crosses], end[crosses]
                apart = (faces[target] != start[:, None]).all(axis=1) & (faces[target] != end[:, None]).all(axis=1)
                target, start, end = target[apart], points[start[apart]], points[end[apart]]
                t, _ = cross_segments(start, end - start, corners[target], slack=1e-9)
                # An edge that ends on a triangle touches it; one that passes through its rim crosses the surface.
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
