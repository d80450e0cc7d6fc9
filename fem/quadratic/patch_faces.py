"""Integrals over the faces of patches in quadratic elements."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tetlux.fem.charges.derivative import ChargeDerivatives
from tetlux.fem.known.charges import Charges
from tetlux.fem.known.patch import Patch
from tetlux.fem.quadratic.assembly import face_normals
from tetlux.fem.quadratic.elements import TRIANGLE_EDGES, shape_derivatives, shape_functions
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.fem.simplex_rules import cut_near_charges, triangle_rule
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray, sum_columns
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.topology import FACES

# Degrees of the quadrature rules for the faces of a patch: see `cut_near_charges`. Readings jump where a charge moves
# past a limit, by less than 1e-11; with twice these limits by 1e-7.
FACE_DEGREES = ((0.1, 4), (0.4, 6), (1.0, 10))
# Degree of the rule for jumps at inner faces: of 4, 6, 10 readings are off by 1e-6, 1e-8 and 1e-11 (ball in a ball).
JUMP_DEGREE = 6
# What is integrated: charges, or their derivatives.
Field = Charges | ChargeDerivatives


@dataclass(frozen=True, eq=False)
class InnerFaces:
    """Faces of tetrahedra inside the body, with quadrature points: those at which some patches end.

    Attributes
    ----------
    keys : (f,) ndarray
        Four times the tetrahedron plus the corner opposite, ascending.
    faces, cells : (f, 6), (f, 10) ndarray
        DOF numbers of the faces, and of the tetrahedra of the patch.
    points, shape_values : (f, q, 3), (q, 6) ndarray
        Quadrature points, and shape functions there.
    slopes : (f, q, 10) ndarray
        Derivatives of shape functions along the normal times area, unit.
    """

    keys: IntArray
    faces: IntArray
    cells: IntArray
    points: FloatArray
    shape_values: FloatArray
    slopes: FloatArray

    def jump_load(self, patch: Patch, field: Field, interpolant: NumberArray) -> NumberArray:
        """``∮ (D G - I D G) dv/dn`` over the inner faces of a patch, by interpolants (size, k) of D G, (size, k)."""
        some = np.searchsorted(self.keys, inner_keys(patch))
        points = self.points[some]
        potential = field.potential(points.reshape(-1, 3)).reshape(*points.shape[:2], interpolant.shape[1])
        jumps = potential - self.shape_values @ interpolant[self.faces[some]]
        values = np.swapaxes(self.slopes[some], 1, 2) @ jumps
        return sum_columns(self.cells[some], values, len(interpolant))

    __repr__ = one_line


def inner_keys(patch: Patch) -> IntArray:
    """The `InnerFaces.keys` of the faces at which a patch ends inside the body, (f,)."""
    cells, opposite, on_boundary = patch.outer
    return np.asarray(4 * cells + opposite)[~on_boundary]


def inner_faces(space: QuadraticSpace, patches: Iterable[Patch]) -> InnerFaces:
    """The faces at which patches end inside the body; they do not depend on charges."""
    keys = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(inner_keys(patch) for patch in patches)]))
    cells, local = np.divmod(keys, 4)
    rule = triangle_rule(JUMP_DEGREE)
    on_face, weights = rule.points, rule.weights
    faces = space.faces(space.mesh.tetrahedra[cells[:, None], FACES[local]])
    shape_values = shape_functions(on_face, TRIANGLE_EDGES)
    normals = weights[:, None] * face_normals(space, faces, on_face)
    along = np.empty((len(cells), len(weights), 10))
    for corner in range(4):
        some = np.flatnonzero(local == corner)
        barycentric = np.zeros((len(weights), 4))
        barycentric[:, FACES[corner]] = on_face
        # The gradient of a shape function is J^-T of that by straight coordinates.
        ways = np.linalg.solve(space.jacobians(cells[some], barycentric), normals[some][..., None])
        rates = np.swapaxes(space.mesh.hat_gradients[cells[some]][:, None] @ ways, -1, -2)[..., 0, :]
        along[some] = np.einsum("qap,fqp->fqa", shape_derivatives(barycentric), rates)
    points = shape_values @ space.corners_and_bends(faces)
    return InnerFaces(keys, faces, space.cells[cells], points, shape_values, along)


def integrate_over_faces(
    space: QuadraticSpace, faces: IntArray, positions: FloatArray, field: Field
) -> tuple[NumberArray, NumberArray]:
    """Integrals over triangles (f, 6) of G and of ``D dG/dn`` times their shape functions, (f, 6, k) each.

    There are k fields G: one of charges, or their derivatives. Triangles are cut near charges at positions (c, 3).
    """
    shapes = space.corners_and_bends(faces)
    count = len(field.positions) if isinstance(field, ChargeDerivatives) else 1
    value, flux = np.zeros((2, len(faces), 6, count), np.complex128 if field.is_complex else np.float64)

    def locate(owner: IntArray, places: FloatArray) -> FloatArray:
        return np.asarray(shape_functions(places, TRIANGLE_EDGES) @ shapes[owner])

    for pieces in cut_near_charges(len(faces), locate, positions, FACE_DEGREES):
        owner, places = pieces.owner, pieces.rule.points @ pieces.corners
        shape_values = shape_functions(places, TRIANGLE_EDGES)
        points = shape_values @ shapes[owner]
        slopes = shape_derivatives(places, TRIANGLE_EDGES).swapaxes(-1, -2) @ shapes[owner][:, None]
        normals = 0.5 * np.cross(slopes[:, :, 1] - slopes[:, :, 0], slopes[:, :, 2] - slopes[:, :, 0])
        normals *= pieces.share * pieces.rule.weights[:, None]
        fluence, gradient = field.fluence_and_flux(points.reshape(-1, 3))
        through = (normals[:, :, None] @ gradient.reshape(*points.shape, count))[:, :, 0]
        amount = fluence.reshape(through.shape) * np.linalg.norm(normals, axis=2)[..., None]
        functions = np.swapaxes(shape_values, -1, -2)
        for target, values in ((value, functions @ amount), (flux, functions @ through)):
            if pieces.share == 1.0:
                target[owner] += values
            else:
                np.add.at(target, owner, values)
    return value, flux
