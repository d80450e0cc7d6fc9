"""Hierarchical quadratic shape functions of one tetrahedron and of one triangle, and quadrature rules for them.

The shape functions of a tetrahedron are its barycentric coordinates lambda_i, and ``4 lambda_i lambda_j`` for each of
its edges, in the order of `TetMesh.tetrahedron_edges`; those of a triangle likewise, for the edges 01, 12 and 20.
"""

import numpy as np
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet, RefTri

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.tets.topology import EDGES

TRIANGLE_EDGES = np.array([[0, 1], [1, 2], [2, 0]])
# Degree of the quadrature rules: exact for products of two quadratic functions.
_DEGREE = 4


def shape_functions(weights: FloatArray, edges: IntArray = EDGES) -> FloatArray:
    """Values of the shape functions (..., c + e) at barycentric coordinates (..., c)."""
    bubbles = 4.0 * weights[..., edges[:, 0]] * weights[..., edges[:, 1]]
    return np.concatenate([weights, bubbles], axis=-1)


def shape_derivatives(weights: FloatArray, edges: IntArray = EDGES) -> FloatArray:
    """Derivatives of the shape functions by the barycentric coordinates, (..., c + e, c), at (..., c)."""
    corners = weights.shape[-1]
    found = np.zeros((*weights.shape[:-1], corners + len(edges), corners))
    found[..., np.arange(corners), np.arange(corners)] = 1.0
    for edge, (i, j) in enumerate(edges, corners):
        found[..., edge, i] = 4.0 * weights[..., j]
        found[..., edge, j] = 4.0 * weights[..., i]
    return found


def _rule(element: type, degree: int) -> tuple[FloatArray, FloatArray]:
    points, weights = get_quadrature(element, degree)
    return np.column_stack([1.0 - points.sum(axis=0), points.T]), weights / weights.sum()


# Barycentric coordinates (q, 4) or (q, 3) of points, and their weights (q,), which sum to 1.
TETRAHEDRON_RULE = _rule(RefTet, _DEGREE)
TRIANGLE_RULE = _rule(RefTri, _DEGREE)


def _stiffness() -> FloatArray:
    slopes = shape_derivatives(TETRAHEDRON_RULE[0])
    return np.asarray(np.einsum("q,qap,qbr->prab", TETRAHEDRON_RULE[1], slopes, slopes).reshape(16, 100))


def _mass() -> FloatArray:
    values = shape_functions(TETRAHEDRON_RULE[0])
    return np.asarray(np.einsum("q,qa,qb->ab", TETRAHEDRON_RULE[1], values, values).reshape(100))


# REFERENCE_STIFFNESS (16, 100) maps products of the gradients of the barycentric coordinates, (m, 16), to integrals of
# products of the gradients of shape functions over a straight tetrahedron of unit volume, (m, 100). REFERENCE_MASS
# (100,) are the integrals of products of shape functions over it.
REFERENCE_STIFFNESS, REFERENCE_MASS = _stiffness(), _mass()
