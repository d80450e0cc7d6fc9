"""What quadratic elements miss of charges between nodes: integrals of ``G - I G`` near the sources.

Around a source G grows like 1/r and its gradient like 1/r². A tetrahedron is the signed sum of four with the source as
a common corner, and in coordinates from there the squared distance of the volume element cancels the pole (Duffy 1982).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.charges.field import ChargeField
from tetlux.fem.quadratic.elements import cell_rule, shape_derivatives, shape_functions
from tetlux.fem.quadratic.patches import QuadraticPatch
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.fem.simplex_rules import triangle_rule
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.topology import EDGES, FACES

# Tetrahedra within so many of their own sizes of a source are integrated, and within the second number from there.
REACH, FROM_SOURCE = 8.0, 2.0
# Gauss points of the distance from a source, and degree of the rule on the face opposite.
ALONG, ACROSS = np.polynomial.legendre.leggauss(5), 6
# Tetrahedra that are integrated at once.
BLOCK = 256


@dataclass(frozen=True, eq=False)
class MissingCharges:
    """Integrals of ``G - I G`` with the shape functions of tetrahedra.

    Attributes
    ----------
    cells : (c,) ndarray
        Numbers of the tetrahedra.
    mass, stiffness : (c, 10) ndarray
        ``∫ (G - I G) v`` and ``∫ grad (G - I G) . grad v``.
    """

    cells: IntArray
    mass: NumberArray
    stiffness: NumberArray

    __repr__ = one_line


def missing_charges(space: QuadraticSpace, patch: QuadraticPatch) -> MissingCharges:
    """Integrate what the interpolant of a patch misses of its sources, near these.

    The other charges lie outside the body, where the interpolant hardly misses any of them.
    """
    mesh, charges = space.mesh, patch.patch.charges
    inside = np.flatnonzero(patch.patch.cells)
    middles = mesh.points[mesh.tetrahedra[inside]].mean(axis=1)
    count = charges.sources
    sources = charges.positions[:count]
    field = ChargeField(charges.equation, sources, charges.strengths[:count], charges.closest)
    distances, nearest = (np.asarray(found) for found in cKDTree(sources).query(middles))
    relative = distances / np.cbrt(6.0 * np.sqrt(2.0) * mesh.volumes[inside])
    closest, close = relative <= FROM_SOURCE, (relative > FROM_SOURCE) & (relative <= REACH)
    parts = [
        _integrate(space, field, inside[closest], *_rule_from(space, inside[closest], sources[nearest[closest]])),
        _integrate(space, field, inside[close], *_plain_rule(int(close.sum()))),
    ]
    return MissingCharges(
        np.concatenate([inside[closest], inside[close]]),
        np.concatenate([mass for mass, _ in parts]),
        np.concatenate([stiffness for _, stiffness in parts]),
    )


def _plain_rule(count: int) -> tuple[FloatArray, FloatArray]:
    rule = cell_rule()
    points, weights = rule.points, rule.weights
    return np.broadcast_to(points, (count, *points.shape)), np.broadcast_to(weights, (count, len(weights)))


def _rule_from(space: QuadraticSpace, cells: IntArray, sources: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Barycentric points (c, q, 4) and weights (c, q) of tetrahedra, as seen from a source (c, 3) each."""
    apex = space.mesh.barycentric(sources, cells)
    along, across = 0.5 * (1.0 + ALONG[0]), triangle_rule(ACROSS)
    points, weights = [], []
    for corner in range(4):
        on_face = np.zeros((len(across.weights), 4))
        on_face[:, FACES[corner]] = across.points
        ways = on_face - apex[:, None]
        points.append(apex[:, None, None] + along[:, None, None] * ways[:, None])
        # The part has the barycentric coordinate of the source as its share of the volume.
        share = 3.0 * along**2 * 0.5 * ALONG[1]
        weights.append(apex[:, corner, None, None] * share[:, None] * across.weights)
    shape = len(cells), 4 * len(along) * len(across.weights)
    return np.stack(points, axis=1).reshape(*shape, 4), np.stack(weights, axis=1).reshape(shape)


def _integrate(
    space: QuadraticSpace, field: ChargeField, cells: IntArray, barycentric: FloatArray, weights: FloatArray
) -> tuple[NumberArray, NumberArray]:
    """Integrals over tetrahedra (c,) by barycentric points (c, q, 4) and weights (c, q), two (c, 10)."""
    mesh = space.mesh
    mass, stiffness = np.zeros((2, len(cells), 10), field.equation.dtype)
    for start in range(0, len(cells), BLOCK):
        some = slice(start, start + BLOCK)
        own, at = cells[some], barycentric[some]
        places = at @ mesh.points[mesh.tetrahedra[own]]
        values, slopes = shape_functions(at), shape_derivatives(at) @ mesh.hat_gradients[own][:, None]
        fluence, gradient = _exactly(field, places)
        known = _interpolant(space, field, own)
        fluence = fluence - np.einsum("cqa,ca->cq", values, known)
        gradient = gradient - np.einsum("cqai,ca->cqi", slopes, known)
        volumes = mesh.volumes[own, None] * weights[some]
        mass[some] = np.einsum("cq,cqa->ca", volumes * fluence, values)
        stiffness[some] = np.einsum("cqi,cqai->ca", volumes[..., None] * gradient, slopes)
    return mass, stiffness


def _interpolant(space: QuadraticSpace, field: ChargeField, cells: IntArray) -> NumberArray:
    """Coefficients of the quadratic interpolant of charges in tetrahedra (c,), (c, 10)."""
    mesh = space.mesh
    at_nodes = field.fluence(mesh.points[mesh.tetrahedra[cells]].reshape(-1, 3)).reshape(-1, 4)
    at_middles = field.fluence(space.middles[mesh.tetrahedron_edges[cells]].reshape(-1, 3)).reshape(-1, 6)
    return np.hstack([at_nodes, at_middles - at_nodes[:, EDGES].mean(axis=2)])


def _exactly(field: ChargeField, places: FloatArray) -> tuple[NumberArray, NumberArray]:
    """Fluence (...) and gradient (..., 3) of charges, however near."""
    found = field.equation.fluence_and_gradient(places.reshape(-1, 3), field.positions, field.strengths)
    return found[0].reshape(places.shape[:-1]), found[1].reshape(places.shape)
