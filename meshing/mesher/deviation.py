"""Sampled distances between two surfaces, and between a mesh's boundary and a surface."""

import numpy as np

from tetlux.meshing.arrays import FloatArray, spread_indices
from tetlux.meshing.host.by_pair import ByPair
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Sample points per surface, at 4 µs each. A surface with more vertices is far finer than the other surface, so a subset
# of its vertices gives the same distance.
DISTANCE_SAMPLES = 6_000


def two_sided_distance(first: Surface, second: Surface, samples: int = DISTANCE_SAMPLES) -> float:
    """The largest distance from either surface to the other, unit: the Hausdorff distance at sample points.

    Parameters
    ----------
    first, second : Surface
    samples : int
        Largest number of sample points per surface: vertices first, then midpoints of edges and centroids of
        triangles, evenly chosen.
    """
    return max(_farthest(first, second, samples), _farthest(second, first, samples))


# Many runs may be solved on one mesh.
_DEVIATIONS: ByPair[TetMesh, Surface, float] = ByPair()


def surface_deviation(mesh: TetMesh, surface: Surface) -> float:
    """Two-sided distance between a mesh's boundary and a surface, unit; it is computed once."""
    return _DEVIATIONS.get(mesh, surface, lambda: two_sided_distance(mesh.surface, surface))


def _farthest(source: Surface, target: Surface, samples: int) -> float:
    queries = _sample_points(source, samples)
    return float(np.linalg.norm(target.closest(queries)[0] - queries, axis=1).max())


def _sample_points(surface: Surface, count: int) -> FloatArray:
    corners = surface.points[surface.faces]
    between = np.vstack([corners.mean(axis=1), *(0.5 * (corners[:, i] + corners[:, i - 1]) for i in range(3))])
    vertices = surface.points[spread_indices(len(surface.points), count)]
    return np.vstack([vertices, between[spread_indices(len(between), count - len(vertices))]])
