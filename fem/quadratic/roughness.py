"""How much the gradient of a quadratic function jumps between tetrahedra, which shows what it does not resolve."""

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.topology import EDGES


def roughness(space: QuadraticSpace, function: FloatArray) -> FloatArray:
    """The averaged gradient less the gradient at the corners of each tetrahedron, (m, 4, 3), of a function (size,).

    Gradients are averaged over the tetrahedra of one region around a node, weighted by volume; across an interface they
    jump.
    """
    mesh = space.mesh
    values, hats = function[space.cells], mesh.hat_gradients
    slopes = np.repeat(np.einsum("mij,mi->mj", hats, values[:, :4])[:, None], 4, axis=1)
    for edge, (i, j) in enumerate(EDGES, 4):
        steepness = 4.0 * values[:, edge, None]
        slopes[:, i] += steepness * hats[:, j]
        slopes[:, j] += steepness * hats[:, i]
    curved = space.curved
    if len(curved):
        slopes[curved] = (slopes[curved, :, None] @ np.linalg.inv(space.bending(curved, np.eye(4))))[:, :, 0]
    groups = corner_groups(mesh)
    around = csr_array(
        (np.repeat(mesh.volumes, 4), (groups.ravel(), np.arange(groups.size))),
        shape=(int(groups.max()) + 1, groups.size),
    )
    means = (around @ slopes.reshape(-1, 3)) / np.asarray(around.sum(axis=1))[:, None]
    return np.asarray(means[groups] - slopes)


def corner_groups(mesh: TetMesh) -> IntArray:
    """Numbers (m, 4) of the corners of tetrahedra, the same at one node in one region."""
    groups = mesh.tetrahedra
    if not mesh.regions.any():
        return groups
    first = int(mesh.regions.min())
    keys = groups * (int(mesh.regions.max()) - first + 1) + (mesh.regions[:, None] - first)
    return np.asarray(np.unique(keys, return_inverse=True)[1].reshape(keys.shape))
