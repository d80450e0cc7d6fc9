"""`Creases`: the sharp edges of a surface, which nodes and edges of a mesh are to lie on."""

from functools import cached_property

import numpy as np

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.search.closest import ClosestPoint


class Creases:
    """Edges at which a surface bends by more than its crease angle.

    Parameters
    ----------
    ends : (c, 2, 3) ndarray
        Of each edge, unit; not empty.
    angle : float
        Where creases turn by more than this, degrees, or more or fewer than two meet, there is a corner.
    """

    def __init__(self, ends: FloatArray, angle: float) -> None:
        self.ends, self._angle = ends, angle
        self._points, numbers = np.unique(ends.reshape(-1, 3), axis=0, return_inverse=True)
        self._edges = numbers.reshape(-1, 2)

    def closest(self, queries: FloatArray) -> FloatArray:
        """The points of creases closest to query points (q, 3), (q, 3)."""
        return self._closest(queries)[0]

    @cached_property
    def _closest(self) -> ClosestPoint:
        # A triangle with two corners in one place is an edge.
        return ClosestPoint(self._points, self._edges[:, [0, 1, 1]])

    @cached_property
    def corners(self) -> FloatArray:
        """Points that creases do not run straight through, (k, 3)."""
        ways = np.diff(self._points[self._edges], axis=1)[:, 0]
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        # Unit vectors along the creases of a point cancel where it has two, one straight on from the other.
        sums = np.zeros_like(self._points)
        np.add.at(sums, self._edges[:, 0], ways)
        np.add.at(sums, self._edges[:, 1], -ways)
        turns = np.linalg.norm(sums, axis=1) > 2.0 * np.sin(0.5 * np.radians(self._angle))
        counts = np.bincount(self._edges.ravel(), minlength=len(self._points))
        return np.asarray(self._points[turns | (counts != 2)])
