"""How far two surfaces are from each other, and a mesh's boundary from the surface it stands for."""

import numpy as np

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Places of a surface at which the distance to another is measured, at 4 µs each. Surfaces that have more
# vertices than this are far finer than what they are compared with, and a part of them tells as much.
SAMPLES = 6_000


def two_sided_distance(first: Surface, second: Surface, samples: int = SAMPLES) -> float:
    """Largest distance from either surface to the other, unit: the Hausdorff distance, sampled.

    Parameters
    ----------
    first, second : Surface
    samples : int
        How many places of each surface are looked at, at most: vertices first, then the middles of edges and
        of triangles; evenly chosen where there are more.
    """
    return max(_farthest(first, second, samples), _farthest(second, first, samples))


def surface_deviation(mesh: TetMesh, surface: Surface, samples: int = SAMPLES) -> float:
    """Two-sided distance between a mesh's boundary and a surface, unit."""
    return two_sided_distance(mesh.surface, surface, samples)


def _farthest(source: Surface, target: Surface, samples: int) -> float:
    queries = _places(source, samples)
    return float(np.linalg.norm(target.closest(queries)[0] - queries, axis=1).max())


def _places(surface: Surface, count: int) -> FloatArray:
    corners = surface.points[surface.faces]
    between = np.vstack([corners.mean(axis=1), *(0.5 * (corners[:, i] + corners[:, i - 1]) for i in range(3))])
    vertices = _evenly(surface.points, count)
    return np.vstack([vertices, _evenly(between, count - len(vertices))])


def _evenly(points: FloatArray, count: int) -> FloatArray:
    """`count` of the points at even steps of their numbers, or all if there are no more."""
    if len(points) <= count:
        return points
    return points[np.arange(count) * len(points) // max(count, 1)]
