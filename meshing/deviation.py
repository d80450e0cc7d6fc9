"""How far a mesh's boundary is from the surface it stands for."""

import numpy as np

from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh


def surface_deviation(mesh: TetMesh, surface: Surface) -> float:
    """Two-sided distance between a mesh's boundary and a surface, unit.

    The largest of the distances from the boundary's nodes and the middles of its triangles to the
    surface, and from the surface's vertices to the boundary: the Hausdorff distance, sampled there.
    """
    middles = mesh.points[mesh.boundary_faces].mean(axis=1)
    samples = np.vstack([mesh.boundary_points, middles])
    to_surface = np.linalg.norm(surface.closest(samples)[0] - samples, axis=1).max()
    to_mesh = np.linalg.norm(mesh.closest_boundary(surface.points)[0] - surface.points, axis=1).max()
    return float(max(to_surface, to_mesh))
