"""How thick a body is, seen from each facet of its boundary."""

import numpy as np

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.tets.mesh import TetMesh

# Rays at 45 degrees round the one straight inwards.
AROUND = 6


def thickness(mesh: TetMesh) -> FloatArray:
    """How thick the body is under each facet of its boundary.

    The diameter of a ball that touches the facet from inside and fits between what rays meet: the one straight inwards,
    and the median of those at 45 degrees, which is shorter where the surface itself bends in little space. A plate is
    as thick as it is, a ball and a rod have their diameter, and the edge of a large body is no thin part of it; its
    corners are.

    Returns
    -------
    (f,) ndarray
        Unit.
    """
    inward = -mesh.surface.normals
    first = np.cross(inward, np.eye(3)[np.abs(inward).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(inward, first)
    turns = 2.0 * np.pi * np.arange(AROUND) / AROUND
    slanted = inward + np.cos(turns)[:, None, None] * first + np.sin(turns)[:, None, None] * second
    rays = np.concatenate([inward[None], slanted / np.sqrt(2.0)])
    starts = np.broadcast_to(mesh.points[mesh.boundary_faces].mean(axis=1), rays.shape)
    lengths = mesh.rays.first(starts.reshape(-1, 3), rays.reshape(-1, 3))[0].reshape(len(rays), -1)
    # Beside an edge up to three of six are short.
    round_it = np.sort(lengths[1:], axis=0)[AROUND // 2]
    return np.asarray(np.minimum(lengths[0], np.sqrt(2.0) * round_it))
