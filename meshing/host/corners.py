"""Vector arithmetic on the corners of many tetrahedra, in blocks, by coordinate."""

from collections.abc import Callable

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.host.blocks import run_in_blocks


def run_on_corners(work: Callable[[slice, FloatArray], object], points: FloatArray, tetrahedra: IntArray) -> None:
    """Call ``work(block, corners)`` for blocks of tetrahedra, on all cores.

    Parameters
    ----------
    work : callable
        Takes a slice of ``range(m)`` and its corners, (4, 3, b): corner, coordinate, tetrahedron.
    points : (n, 3) ndarray
    tetrahedra : (m, 4) ndarray
    """
    coordinates = np.ascontiguousarray(points.T)

    def work_on(block: slice) -> None:
        nodes = np.ascontiguousarray(tetrahedra[block].T)
        work(block, np.stack([[axis[corner] for axis in coordinates] for corner in nodes]))

    run_in_blocks(work_on, len(tetrahedra))


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products (3, b) of vectors (3, b); `numpy.cross` is several times slower."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Dot products (b,) of vectors (3, b)."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def face_normals(u: FloatArray, v: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normals of the faces opposite corners 1, 2 and 3 of tetrahedra whose edges from corner 0 are u, v, w (3, b).

    Each points into the tetrahedron and is twice as long as the area of its face; divided by six volumes it is the
    gradient of the barycentric coordinate of its corner.
    """
    return cross(v, w), cross(w, u), cross(u, v)
