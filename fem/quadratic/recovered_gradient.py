"""The difference between averaged and own gradients: an estimate of their error (Zienkiewicz & Zhu 1987)."""

import numpy as np

from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.meshing.arrays import NumberArray
from tetlux.meshing.tets.topology import EDGES


def recovered_gradient_difference(space: QuadraticSpace, function: NumberArray) -> NumberArray:
    """The averaged gradient less the gradient at the corners of each tetrahedron, (m, 4, 3), of a function (size,).

    Gradients are averaged over the tetrahedra of one region around a node, weighted by volume. They are not averaged
    across an interface, where they jump.
    """
    values = function[space.cells]
    # At corner i the bubble 4 lambda_i lambda_j has the gradient of 4 lambda_j.
    factors = np.repeat(values[:, None, :4], 4, axis=1)
    for edge, (i, j) in enumerate(EDGES, 4):
        factors[:, i, j] += 4.0 * values[:, edge]
        factors[:, j, i] += 4.0 * values[:, edge]
    slopes = factors @ space.mesh.hat_gradients
    curved = space.curved
    if len(curved):
        slopes[curved] = (slopes[curved, :, None] @ space.inverse_jacobians)[:, :, 0]
    groups, average = space.nodal_averaging
    return np.asarray((average @ slopes.reshape(-1, 3))[groups] - slopes)
