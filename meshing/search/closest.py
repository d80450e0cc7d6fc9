"""Closest points of triangles, for thousands of queries at once."""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.host.corners import cross, dot
from tetlux.meshing.search.box_tree import BoxTree
from tetlux.meshing.search.located import Located

# Queries farther away than this many times the extent of the triangles are moved nearer, along their direction, so that
# squares of distances keep their digits. What is closest to them does not change by more than the inverse of this.
FARTHEST = 1e6
# Rounding of distances, relative to them and to the extent of the triangles.
ROUNDING, ROUNDING_OF_EXTENT = 1e-9, 1e-14


class ClosestPoint:
    """Closest points of a set of triangles: 4 to 8 µs for each that is near to them.

    A first guess is the triangle with the nearest centre. All triangles whose boxes are no farther than that are then
    compared. What was found is remembered: whatever is asked of the points of a surface, they are located once.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
    """

    def __init__(self, points: FloatArray, faces: IntArray) -> None:
        self._triangles, self._located = (points, faces), Located()
        low, high = points[faces].min(axis=(0, 1)), points[faces].max(axis=(0, 1))
        self._middle, self._extent = 0.5 * (low + high), float(np.linalg.norm(high - low))
        # By corner, coordinate and triangle, relative to the middle.
        self._corners = np.ascontiguousarray((points[faces] - self._middle).transpose(1, 2, 0))
        self._centres = cKDTree(self._corners.mean(axis=0).T)
        self._boxes = BoxTree(self._corners.min(axis=0), self._corners.max(axis=0))

    def __reduce__(self) -> tuple[type["ClosestPoint"], tuple[FloatArray, IntArray]]:
        """The trees take more space than the triangles; they are built anew."""
        return ClosestPoint, self._triangles

    def __call__(self, queries: FloatArray) -> tuple[FloatArray, IntArray]:
        """Closest points (q, 3) of the triangles to queries (q, 3), and the triangle of each, (q,)."""
        queries = np.asarray(queries, dtype=float)
        known, nearest, faces = self._located.find(queries)
        new = np.flatnonzero(~known)
        if len(new):
            nearest[new], faces[new] = self._find(queries[new])
            self._located.add(queries[new], nearest[new], faces[new])
        return nearest, faces

    def _find(self, queries: FloatArray) -> tuple[FloatArray, IntArray]:
        places = self._place(queries)
        faces = np.asarray(self._centres.query(places)[1], dtype=np.int64)
        reach = np.sqrt(self._squares(places, faces))
        for rows, candidates in self._candidates(places, reach):
            if len(rows) == 0:
                continue
            squares = self._squares(places[rows], candidates)
            # Of triangles that are equally close, as above a vertex, the first is taken: rounding does not decide.
            first = np.flatnonzero(np.diff(rows, prepend=-1))
            least = np.sqrt(np.minimum.reduceat(squares, first))
            equal = (least * (1.0 + ROUNDING) + ROUNDING_OF_EXTENT * self._extent) ** 2
            counts = np.diff(first, append=len(rows))
            tied = np.where(squares <= np.repeat(equal, counts), candidates, len(self._triangles[1]))
            faces[rows[first]] = np.minimum.reduceat(tied, first)
        offsets = _offsets_from_triangles(places.T, self._corners[:, :, faces])
        return places - offsets.T + self._middle, faces

    def within(self, queries: FloatArray, distance: float) -> BoolArray:
        """Whether each query (q, 3) is within a distance of the triangles; fast for short distances."""
        places = self._place(queries)
        found = np.zeros(len(places), dtype=bool)
        if len(places) == 0:
            return found
        found[:] = self._squares(places, np.asarray(self._centres.query(places)[1])) <= distance**2
        rest = np.flatnonzero(~found)
        for rows, candidates in self._candidates(places[rest], np.full(len(rest), distance)):
            hit = self._squares(places[rest[rows]], candidates) <= distance**2
            found[rest[rows[hit]]] = True
        return found

    def _place(self, queries: FloatArray) -> FloatArray:
        """Queries (q, 3) relative to the middle of the triangles, and not too far from it."""
        places = np.nan_to_num(np.asarray(queries, dtype=float) - self._middle, posinf=1e300, neginf=-1e300)
        size = np.abs(places).max(axis=1, initial=0.0)
        limit = FARTHEST * self._extent
        far = size > limit
        places[far] *= (limit / size[far])[:, None]
        return np.asarray(places)

    def _candidates(self, places: FloatArray, reach: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
        """Pairs of a query and a triangle whose box is within reach."""
        bound = (reach * (1.0 + ROUNDING) + ROUNDING_OF_EXTENT * self._extent) ** 2

        def meets(queries: IntArray, boxes: FloatArray) -> BoolArray:
            squares = np.zeros((len(queries), boxes.shape[2]))
            for axis in range(3):
                gap = np.abs(boxes[:, axis] - places[queries, axis, None]) - boxes[:, 3 + axis]
                squares += np.square(np.maximum(gap, 0.0))
            return np.asarray(squares <= bound[queries, None])

        return ((queries, boxes) for _, queries, boxes in self._boxes.pairs(len(places), meets))

    def _squares(self, places: FloatArray, faces: IntArray) -> FloatArray:
        """Squared distances (k,) of points (k, 3) from triangles (k,), pair by pair."""
        offsets = _offsets_from_triangles(places.T, self._corners[:, :, faces])
        return dot(offsets, offsets)


def _offsets_from_triangles(places: FloatArray, corners: FloatArray) -> FloatArray:
    """Vectors (3, k) to points (3, k) from the closest points of triangles (3, 3, k), pair by pair."""
    sides = [corners[(i + 1) % 3] - corners[i] for i in range(3)]
    reaches = [places - corner for corner in corners]
    normal = cross(sides[0], sides[1])
    size = dot(normal, normal)
    above = size > 0
    offset, least = reaches[0], np.full(places.shape[1], np.inf)
    for side, reach in zip(sides, reaches, strict=True):
        length = dot(side, side)
        share = np.clip(dot(reach, side) / np.where(length > 0, length, 1.0), 0.0, 1.0)
        from_side = reach - share * side
        square = dot(from_side, from_side)
        nearer = square < least
        offset, least = np.where(nearer, from_side, offset), np.where(nearer, square, least)
        above &= dot(cross(side, reach), normal) >= 0
    height = dot(reaches[0], normal) / np.where(above, size, 1.0)
    return np.where(above, height * normal, offset)
