"""Volumes, hat gradients, edge lengths and shape quality of tetrahedra, in blocks on all cores."""

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.host.corners import cross, dot, face_normals, run_on_corners
from tetlux.meshing.tets.topology import EDGES


def tetrahedron_volumes(points: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """Signed volumes (m,) of tetrahedra (m, 4)."""
    result = np.empty(len(tetrahedra))

    def fill(block: slice, corners: FloatArray) -> None:
        u, v, w = corners[1:] - corners[0]
        result[block] = dot(u, cross(v, w)) / 6.0

    run_on_corners(fill, points, tetrahedra)
    return result


def hat_gradients(points: FloatArray, tetrahedra: IntArray, volumes: FloatArray) -> FloatArray:
    """Gradients (m, 4, 3) of the barycentric coordinates in tetrahedra (m, 4) of known volumes (m,)."""
    result = np.empty((len(tetrahedra), 4, 3))

    def fill(block: slice, corners: FloatArray) -> None:
        three = np.stack(face_normals(*(corners[1:] - corners[0]))) / (6.0 * volumes[block])
        result[block, 1:] = three.transpose(2, 0, 1)
        result[block, 0] = -three.sum(axis=0).T

    run_on_corners(fill, points, tetrahedra)
    return result


def longest_edges(points: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """Length of the longest edge (m,) of tetrahedra (m, 4)."""
    result = np.empty(len(tetrahedra))

    def fill(block: slice, corners: FloatArray) -> None:
        squares = [dot(side, side) for side in (corners[j] - corners[i] for i, j in EDGES)]
        result[block] = np.sqrt(np.maximum.reduce(squares))

    run_on_corners(fill, points, tetrahedra)
    return result


def quality(points: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """Three inradii over the circumradius (m,) of tetrahedra (m, 4): 1 for a regular one, 0 for a flat one."""
    result = np.empty(len(tetrahedra))

    def fill(block: slice, corners: FloatArray) -> None:
        u, v, w = corners[1:] - corners[0]
        vw, wu, uv = face_normals(u, v, w)
        volume = dot(u, vw) / 6.0
        moment = dot(u, u) * vw + dot(v, v) * wu + dot(w, w) * uv
        circumradius = np.sqrt(dot(moment, moment)) / (12.0 * volume)
        area = 0.5 * sum(np.sqrt(dot(n, n)) for n in (vw, wu, uv, vw + wu + uv))
        result[block] = 9.0 * volume / area / circumradius

    run_on_corners(fill, points, tetrahedra)
    return result


def barycentric_coordinates(corners: FloatArray, queries: FloatArray) -> FloatArray:
    """Barycentric coordinates (q, 4) of each query (q, 3) in the tetrahedron with the corners (q, 4, 3)."""
    matrix = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    three = np.linalg.solve(matrix, (queries - corners[:, 0])[..., None])[..., 0]
    return np.column_stack([1.0 - three.sum(axis=1), three])


def distribute(shares: FloatArray, nodes: IntArray, count: int) -> FloatArray:
    """Distribute integrals over tetrahedra (m,) evenly to nodes of each, (m, k), which may be repeated: (count,)."""
    sums = np.zeros(count)
    for corner in nodes.T:
        sums += np.bincount(corner, shares / nodes.shape[1], minlength=count)
    return sums
