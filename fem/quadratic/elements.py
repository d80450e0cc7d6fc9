"""Hierarchical quadratic shape functions of one tetrahedron and of one triangle, and quadrature rules for them.

The shape functions of a tetrahedron are its barycentric coordinates lambda_i, and ``4 lambda_i lambda_j`` for each of
its edges, in the order of `TetMesh.tetrahedron_edges`; those of a triangle likewise, for the edges 01, 12 and 20.
"""

from functools import cache

import numpy as np

from tetlux.fem.simplex_rules import Rule, tetrahedron_rule, triangle_rule
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.tets.topology import EDGES

TRIANGLE_EDGES = np.array([[0, 1], [1, 2], [2, 0]])
# Degree of the quadrature rules: exact for products of two quadratic functions.
DEGREE = 4


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


def cell_rule() -> Rule:
    """The quadrature rule of a tetrahedron."""
    return tetrahedron_rule(DEGREE)


def face_rule() -> Rule:
    """The quadrature rule of a triangle."""
    return triangle_rule(DEGREE)


@cache
def reference_stiffness() -> FloatArray:
    """The map of products of the gradients of the barycentric coordinates, (m, 16), to a stiffness matrix, (16, 100).

    That is, to integrals of products of the gradients of shape functions over a straight tetrahedron of unit volume.
    """
    slopes = shape_derivatives(cell_rule().points)
    return np.asarray(np.einsum("q,qap,qbr->prab", cell_rule().weights, slopes, slopes).reshape(16, 100))


@cache
def reference_mass() -> FloatArray:
    """Integrals of products of shape functions over a straight tetrahedron of unit volume, (100,)."""
    values = shape_functions(cell_rule().points)
    return np.asarray(np.einsum("q,qa,qb->ab", cell_rule().weights, values, values).reshape(100))
