"""Local thickness of a body at each facet of its boundary."""

import numpy as np

from tetlux.meshing.arrays import FloatArray, perpendicular_axes
from tetlux.meshing.search.rays import RayCaster
from tetlux.meshing.tets.mesh import TetMesh

# Number of rays at 45 degrees around the inward normal.
SLANTED_RAYS = 6


def thickness(mesh: TetMesh) -> FloatArray:
    """Local thickness of a body under each facet of its boundary, (f,), unit: see `thickness_below`."""
    return thickness_below(mesh.rays, mesh.points[mesh.boundary_faces].mean(axis=1), mesh.surface.normals)


def thickness_below(rays: RayCaster, points: FloatArray, normals: FloatArray) -> FloatArray:
    """Local thickness of a body below points of its boundary.

    The diameter of a ball that touches the facet from inside and fits between the hits of two kinds of rays: the one
    along the inward normal, and the median of those at 45 degrees, which is shorter where the surface is strongly
    curved. The result is the thickness of a plate and the diameter of a ball or a rod. Edges of a large body do not
    count as thin; its corners do.

    Parameters
    ----------
    rays : RayCaster
        Of the boundary.
    points, normals : (f, 3) ndarray
        Points of facets, and the outward unit normals of these.

    Returns
    -------
    (f,) ndarray
        Thickness, unit.
    """
    inward = -normals
    first, second = perpendicular_axes(inward)
    turns = 2.0 * np.pi * np.arange(SLANTED_RAYS) / SLANTED_RAYS
    slanted = inward + np.cos(turns)[:, None, None] * first + np.sin(turns)[:, None, None] * second
    directions = np.concatenate([inward[None], slanted / np.sqrt(2.0)])
    starts = np.broadcast_to(points, directions.shape)
    lengths = rays.first(starts.reshape(-1, 3), directions.reshape(-1, 3))[0].reshape(len(directions), -1)
    # Near an edge, up to three of the six rays are short.
    around = np.sort(lengths[1:], axis=0)[SLANTED_RAYS // 2]
    return np.asarray(np.minimum(lengths[0], np.sqrt(2.0) * around))
