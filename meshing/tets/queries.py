"""Closest points of the boundary of a mesh, and distances of its facets from a surface."""

from functools import cached_property

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.search.closest import ClosestPoint
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import barycentric_on_triangles

# Arrays of queries whose answers are kept.
MOST_ANSWERS = 32
_Closest = tuple[FloatArray, IntArray, FloatArray]


class BoundaryQueries:
    """The boundary of a mesh, prepared for closest points and distances.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (f, 3) ndarray
        Node numbers of the boundary triangles.
    """

    def __init__(self, points: FloatArray, faces: IntArray) -> None:
        self._points, self._faces = points, faces
        self._distances: dict[Surface, FloatArray] = {}
        self._answers: dict[int, tuple[FloatArray, _Closest]] = {}

    @cached_property
    def _closest(self) -> ClosestPoint:
        return ClosestPoint(self._points, self._faces)

    def closest(self, queries: FloatArray) -> _Closest:
        """Closest boundary points of queries (q, 3), as `TetMesh.closest_boundary` returns them.

        Answers for the last few arrays that cannot be written to are kept.
        """
        known = self._answers.pop(id(queries), None)
        if known is None:
            nearest, face = self._closest(queries)
            known = queries, (nearest, face, barycentric_on_triangles(nearest, self._points[self._faces[face]]))
        if not queries.flags.writeable and queries.base is None:
            self._answers[id(queries)] = known
            while len(self._answers) > MOST_ANSWERS:
                del self._answers[next(iter(self._answers))]
        return known[1]

    def distances(self, surface: Surface, faces: IntArray) -> FloatArray:
        """Distance of the centroids of boundary triangles (q,) from a surface, (q,); each is computed once."""
        cached = self._distances.setdefault(surface, np.full(len(self._faces), np.nan))
        missing = faces[np.isnan(cached[faces])]
        middles = self._points[self._faces[missing]].mean(axis=1)
        cached[missing] = heights(surface, middles)
        return np.asarray(cached[faces])


def heights(surface: Surface, points: FloatArray) -> FloatArray:
    """Distances of points (q, 3) near a surface from its tangent planes where they project on it, (q,).

    Where triangles bend much, even points of the smooth surface project beside themselves. As distances of facets from
    it such errors are all that is left on fine meshes: the facets of a hare seemed to need a million tetrahedra.
    """
    places, normals = surface.project(points)
    return np.asarray(np.abs(np.einsum("ij,ij->i", points - places, normals)))
