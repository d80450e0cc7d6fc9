"""The curved surface that the facets of a mesh stand for: normals and points above facets, as in smooth shading."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.triangles import vertex_normals
from tetlux.meshing.tets.mesh import TetMesh

# A node is at a crease if its normal encloses an angle of less than this cosine with that of any of its facets; there
# facets are flat.
LEAST_COSINE = 0.85


@dataclass(frozen=True, eq=False)
class CurvedFacets:
    """The boundary of a mesh with normals that vary over each facet."""

    mesh: TetMesh

    @cached_property
    def normals(self) -> FloatArray:
        """Normals at the corners of each facet, (f, 3, 3)."""
        corners = self.mesh.boundary_triangles
        at_corners = vertex_normals(self.mesh.boundary_points, corners)[corners]
        flat = np.broadcast_to(self.mesh.surface.normals[:, None], at_corners.shape)
        least = np.ones(len(self.mesh.boundary_nodes))
        np.minimum.at(least, corners, np.einsum("fci,fci->fc", at_corners, flat))
        smooth = least[corners] > LEAST_COSINE
        return np.where(smooth[:, :, None], at_corners, flat)

    def normals_at(self, facets: IntArray, weights: FloatArray) -> FloatArray:
        """Unit normals at barycentric coordinates (q, 3) of facets (q,), (q, 3)."""
        mean = np.einsum("qc,qci->qi", weights, self.normals[facets])
        return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))

    def points_at(self, facets: IntArray, weights: FloatArray) -> FloatArray:
        """Points above facets, (q, 3): where the surface is convex, between the tangent planes at the corners.

        A way to the light from there meets no facet that the curved surface does not hide (Hanika, Hacking the shadow
        terminator, Ray Tracing Gems II, 2021).
        """
        corners = self.mesh.points[self.mesh.boundary_faces[facets]]
        flat = np.einsum("qc,qci->qi", weights, corners)
        below = np.minimum(np.einsum("qci,qci->qc", flat[:, None] - corners, self.normals[facets]), 0.0)
        return np.asarray(flat - np.einsum("qc,qc,qci->qi", weights, below, self.normals[facets]))
