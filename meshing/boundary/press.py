"""Press the nodes of a mesh inwards with those of its boundary, without flattening tetrahedra."""

import numpy as np
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import cg

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.tets.geometry import tetrahedron_volumes
from tetlux.meshing.tets.mesh import TetMesh

# Displacements of nodes inside are shortened where a tetrahedron would keep less than this share of its volume, or get
# a quality below the second value and below the third share of what it had.
LEAST_VOLUME, LEAST_QUALITY, LEAST_QUALITY_SHARE = 0.1, 0.04, 0.3
# Shortened displacements differ along an edge by at most this share of its length more than they did.
SHORTENING = 0.3
# Shortenings by half before displacements are given up, and after that.
HALVINGS, MOST_SHORTENINGS = 6, 60
# The displacements within the body are smooth, and need no accuracy.
SMOOTHING_ERROR, SMOOTHING_STEPS = 1e-2, 100


def level_off(values: FloatArray, edges: IntArray, steps: FloatArray) -> FloatArray:
    """Lower values at nodes (n,) until they differ by at most the steps (e,) along edges (e, 2)."""
    values = values.copy()
    while True:
        before = values.copy()
        for first, second in (edges.T, edges.T[::-1]):
            np.minimum.at(values, first, before[second] + steps)
        if np.array_equal(values, before):
            return values


def spread(mesh: TetMesh, steps: FloatArray, fixed: BoolArray) -> FloatArray:
    """Displacements of all nodes (n, 3): given ones where fixed (n,), elsewhere means of those around."""
    first, second = mesh.edges.T
    count, weights = len(mesh.points), mesh.edge_lengths**-2.0
    ends = np.concatenate([first, second]), np.concatenate([second, first])
    joined = coo_array((np.concatenate([weights, weights]), ends), shape=(count, count)).tocsr()
    total = np.asarray(joined.sum(axis=1)).ravel()
    free = np.flatnonzero(~fixed)
    result = np.where(fixed[:, None], steps, 0.0)
    if len(free) == 0:
        return result
    load = joined[free] @ result
    matrix = (diags_array(total[free]) - joined[free][:, free]).tocsr()
    precondition = diags_array(1.0 / total[free])
    for axis in range(3):
        result[free, axis] = cg(matrix, load[:, axis], rtol=SMOOTHING_ERROR, maxiter=SMOOTHING_STEPS, M=precondition)[0]
    return result


def shorten(mesh: TetMesh, steps: FloatArray) -> FloatArray:
    """Shorten displacements (n, 3) where they would flatten tetrahedra, and less and less around these places."""
    size = np.linalg.norm(steps, axis=1)
    if not size.any():
        return steps
    larger = size[mesh.edges].max(axis=1)
    slack = SHORTENING * mesh.edge_lengths / np.where(larger > 0, larger, 1.0)
    lowest = np.minimum(LEAST_QUALITY, LEAST_QUALITY_SHARE * mesh.quality)
    share = np.ones(len(steps))
    for attempt in range(MOST_SHORTENINGS):
        moved = mesh.points + share[:, None] * steps
        flat = tetrahedron_volumes(moved, mesh.tetrahedra) < LEAST_VOLUME * mesh.volumes
        sound = np.flatnonzero(~flat)
        if len(sound) > 0:
            flat[sound] = TetMesh(moved, mesh.tetrahedra[sound]).quality < lowest[sound]
        if not flat.any():
            return share[:, None] * steps
        share[np.unique(mesh.tetrahedra[flat])] *= 0.5 if attempt < HALVINGS else 0.0
        share = level_off(share, mesh.edges, slack)
    return np.zeros(steps.shape)
