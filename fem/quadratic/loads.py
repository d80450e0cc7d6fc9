"""The right-hand side of lights and patches for quadratic elements: see `tetlux.fem.operators.loads`."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tetlux.fem.ballistic.extinction import cells_of, optical_depths
from tetlux.fem.known.charges import Charges
from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.known.patch import Patch
from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.quadratic.assembly import face_matrices, face_normals, gradients, surface_load, volume_load
from tetlux.fem.quadratic.elements import TRIANGLE_EDGES, shape_derivatives, shape_functions
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.fem.simplex_rules import cut_near_charges, triangle_rule
from tetlux.fem.sources.segments import Segments
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray, sum_by_index
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.march import march
from tetlux.meshing.tets.topology import FACES

# Gauss rule along a beam in each tetrahedron.
BEAM_RULE = np.polynomial.legendre.leggauss(4)
# Degrees of the quadrature rules for the faces of a patch: see `cut_near_charges`.
FACE_DEGREES = ((0.2, 4), (0.6, 6), (2.0, 10))


@dataclass(frozen=True, eq=False)
class LineLoad:
    """Load of attenuated beams.

    Attributes
    ----------
    load : (size,) ndarray
        W.
    points, powers : (p, 3), (p,) ndarray
        What stands for their parts outside the mesh, unit and W.
    """

    load: FloatArray
    points: FloatArray
    powers: FloatArray

    __repr__ = one_line


def quadratic_load(
    space: QuadraticSpace, coefficients: Coefficients, terms: SourceTerms, lines: LineLoad
) -> NumberArray:
    """Load of source terms, as they are on the mesh of a space, and of their beams, (size,)."""
    mesh, load = space.mesh, lines.load.copy()
    points, powers = np.vstack([terms.points, lines.points]), np.concatenate([terms.powers, lines.powers])
    if len(points):
        load += _point_load(space, points, powers)
    if np.any(terms.transmitted_irradiance):
        entering = np.zeros(len(mesh.points))
        entering[mesh.boundary_nodes] = boundary_condition_of(coefficients.outer).inflow(terms.transmitted_irradiance)
        load += surface_load(space, entering)
    if np.any(terms.emission):
        emitted = volume_load(space, np.broadcast_to(terms.emission, len(mesh.tetrahedra)))
        # The power of emission is that of the mesh with flat facets.
        load += emitted * float((mesh.volumes * terms.emission).sum()) / emitted[: len(mesh.points)].sum()
    return np.asarray(load + sum(source.at_dofs for source in terms.volume_sources))


def _point_load(space: QuadraticSpace, points: FloatArray, powers: FloatArray) -> FloatArray:
    """Load of points: in the tetrahedron that holds a point, or else on the nearest boundary triangle, (size,)."""
    mesh, load = space.mesh, np.zeros(space.size)
    cells, weights = mesh.locate(points)
    inside, outside = cells >= 0, np.flatnonzero(cells < 0)
    values = powers[inside, None] * shape_functions(weights[inside])
    load += sum_by_index(space.cells[cells[inside]], values, space.size)
    if len(outside):
        face, weights = space.on_boundary(points[outside])
        values = powers[outside, None] * shape_functions(weights, TRIANGLE_EDGES)
        load += sum_by_index(space.faces(mesh.boundary_faces[face]), values, space.size)
    return load


def line_load(space: QuadraticSpace, coefficients: Coefficients, segments: Segments) -> LineLoad:
    """Integrate attenuated beams by Gauss points in every tetrahedron."""
    mesh, load = space.mesh, np.zeros(space.size)
    points, powers = [np.zeros((0, 3))], [np.zeros(0)]
    for part in march(mesh, segments.starts, segments.directions, segments.lengths, segments.cells):
        cells = cells_of(mesh, coefficients, part, segments.starts, segments.directions)
        extinction = at_cells(coefficients.extinction, cells)
        scattering = at_cells(coefficients.delta_eddington_scattering, cells)
        forward = at_cells(coefficients.delta_eddington_cosine / coefficients.sigma_t_prime, cells)
        arriving = segments.fluxes[part.paths] * np.exp(-optical_depths(part, coefficients.extinction, cells))
        step, outside = part.leave - part.enter, part.cells < 0
        lost = np.zeros(len(step))
        for node, weight in zip(0.5 * (1.0 + BEAM_RULE[0]), 0.5 * BEAM_RULE[1], strict=True):
            at = node * step
            scattered = arriving * scattering * weight * step * np.exp(-extinction * at)
            lost += scattered
            barycentric = (part.weights + at[:, None] * part.slopes)[~outside]
            shape_values = shape_functions(barycentric)
            along = np.einsum("qap,qp->qa", shape_derivatives(barycentric), part.slopes[~outside])
            values = scattered[~outside, None] * (shape_values + forward[~outside, None] * along)
            load += sum_by_index(space.cells[part.cells[~outside]], values, space.size)
        paths, middle = part.paths[outside], 0.5 * (part.enter + part.leave)[outside]
        points.append(segments.starts[paths] + middle[:, None] * segments.directions[paths])
        powers.append(lost[outside])
    return LineLoad(load, np.concatenate(points), np.concatenate(powers))


@dataclass(frozen=True, eq=False)
class QuadraticPatch:
    """A patch in quadratic elements.

    Attributes
    ----------
    patch : Patch
    space : QuadraticSpace
    load : (size,) ndarray
        Contribution to the load vector, W.
    is_whole : bool
        Whether it is the whole body, of one medium: then the load is that of the fluence less that of the charges.
    """

    patch: Patch
    space: QuadraticSpace
    load: NumberArray
    is_whole: bool = False

    @cached_property
    def interpolant(self) -> NumberArray:
        """The quadratic interpolant of its charges' fluence, (size,); linear on edges outside of it."""
        if not self.patch.cells.any():
            return np.zeros(self.space.size)
        mesh, at_nodes = self.space.mesh, self.patch.at_nodes
        edges = np.unique(mesh.tetrahedron_edges[self.patch.cells])
        at_middles = at_nodes[mesh.edges].mean(axis=1)
        at_middles[edges] = self.patch.charges.fluence(self.space.middles[edges])
        return self.space.interpolate(at_nodes, at_middles)

    @property
    def is_fitted(self) -> bool:
        """Whether the charges are fitted to the surface, and subtracted in all of the body where they are accurate."""
        return isinstance(self.patch, FittedPatch)


def quadratic_patch(operator: QuadraticOperator, patch: Patch) -> QuadraticPatch:
    """A patch with its load, by the matrices of an operator; one that is the whole body needs none of them."""
    if patch.cells.all() and operator.coefficients.uniform:
        _, leaving, _ = _boundary_terms(operator.space, patch)
        return QuadraticPatch(patch, operator.space, -leaving, is_whole=True)
    return patch_by_elements(operator.space, patch, operator.elements[patch.cells])


def patch_by_elements(
    space: QuadraticSpace, patch: Patch, elements: NumberArray, inner: "InnerFaces | None" = None
) -> QuadraticPatch:
    """A patch with its load, as in `tetlux.fem.known.patch_terms`, by the matrices (c, 10, 10) of its tetrahedra.

    Across inner faces of the patch the fluence jumps by the interpolation error G - I G. The jump changes a reading by
    ``∮ (G - I G) D dz/dn``, with z its dual solution; adding this term to the load cancels the change. The
    `inner_faces` need not be given.
    """
    charges = patch.charges
    if not patch.cells.any():
        count = charges.sources
        load = _point_load(space, charges.positions[:count], charges.strengths[:count].real)
        return QuadraticPatch(patch, space, load)
    leaving_faces, leaving, has_inner = _boundary_terms(space, patch)
    found = QuadraticPatch(patch, space, -leaving)
    load = _product(elements, space.cells[patch.cells], found.interpolant) - leaving
    robin = boundary_condition_of(charges.medium).robin
    load += _product(robin * face_matrices(space, leaving_faces), leaving_faces, found.interpolant)
    if has_inner:
        load += _jump_load(charges, found.interpolant, inner or inner_faces(space, patch))
    return replace(found, load=load)


def _boundary_terms(space: QuadraticSpace, patch: Patch) -> tuple[IntArray, NumberArray, bool]:
    """DOF numbers of a patch's facets of the boundary, (f, 6), what leaves it, (size,), and whether it ends inside."""
    charges = patch.charges
    cell, face, on_boundary = patch.outer
    corners = space.mesh.tetrahedra[cell[:, None], FACES[face]]
    faces = space.faces(corners)
    value, flux = _integrals(space, faces, charges)
    robin = boundary_condition_of(charges.medium).robin
    leaving = sum_by_index(faces, flux + (robin * on_boundary)[:, None] * value, space.size)
    return faces[on_boundary], leaving, not bool(on_boundary.all())


def _product(matrices: NumberArray, dofs: IntArray, function: NumberArray) -> NumberArray:
    """Element matrices (c, k, k) with DOF numbers (c, k) times a function (size,), (size,)."""
    values = np.einsum("cab,cb->ca", matrices, function[dofs])
    return sum_by_index(dofs, values, len(function))


@dataclass(frozen=True, eq=False)
class InnerFaces:
    """The outer faces of a patch that lie inside the body, with their quadrature points.

    Attributes
    ----------
    faces, cells : (f, 6), (f, 10) ndarray
        DOF numbers of the faces, and of the tetrahedra of the patch.
    points, shape_values : (f, q, 3), (q, 6) ndarray
        Quadrature points, and shape functions there.
    slopes : (f, q, 10) ndarray
        Derivatives of shape functions along the normal times area, unit.
    """

    faces: IntArray
    cells: IntArray
    points: FloatArray
    shape_values: FloatArray
    slopes: FloatArray

    __repr__ = one_line


def inner_faces(space: QuadraticSpace, patch: Patch) -> InnerFaces:
    """The faces at which a patch ends inside the body; they do not depend on its charges."""
    owners, opposite, on_boundary = patch.outer
    cells, local = owners[~on_boundary], opposite[~on_boundary]
    rule = triangle_rule(FACE_DEGREES[-1][1])
    on_face, weights = rule.points, rule.weights
    faces = space.faces(space.mesh.tetrahedra[cells[:, None], FACES[local]])
    shape_values = shape_functions(on_face, TRIANGLE_EDGES)
    normals = weights[:, None] * face_normals(space, faces, on_face)
    barycentric = np.zeros((len(cells), len(weights), 4))
    for corner in range(3):
        np.put_along_axis(barycentric, FACES[local, corner][:, None, None], on_face[None, :, corner, None], axis=2)
    slopes, _ = gradients(space, cells, barycentric, weights)
    along = np.einsum("fqai,fqi->fqa", slopes, normals)
    return InnerFaces(faces, space.cells[cells], shape_values @ space.corners_and_bends(faces), shape_values, along)


def _jump_load(charges: Charges, interpolant: NumberArray, inner: InnerFaces) -> NumberArray:
    """``∮ (G - I G) D dv/dn`` over inner faces, (size,)."""
    fluence = charges.fluence(inner.points.reshape(-1, 3)).reshape(inner.points.shape[:2])
    jumps = fluence - interpolant[inner.faces] @ inner.shape_values.T
    values = charges.medium.diffusion * np.einsum("fq,fqa->fa", jumps, inner.slopes)
    return sum_by_index(inner.cells, values, len(interpolant))


def _integrals(space: QuadraticSpace, faces: IntArray, charges: Charges) -> tuple[NumberArray, NumberArray]:
    """Integrals over triangles (f, 6) of G and of ``D dG/dn`` times their shape functions, (f, 6) each."""
    shapes = space.corners_and_bends(faces)
    value, flux = np.zeros((2, len(faces), 6), charges.equation.dtype)

    def locate(owner: IntArray, places: FloatArray) -> FloatArray:
        return np.asarray(shape_functions(places, TRIANGLE_EDGES) @ shapes[owner])

    for pieces in cut_near_charges(len(faces), locate, charges.positions, FACE_DEGREES):
        owner, places = pieces.owner, pieces.rule.points @ pieces.corners
        shape_values = shape_functions(places, TRIANGLE_EDGES)
        points = shape_values @ shapes[owner]
        slopes = shape_derivatives(places, TRIANGLE_EDGES).swapaxes(-1, -2) @ shapes[owner][:, None]
        normals = 0.5 * np.cross(slopes[:, :, 1] - slopes[:, :, 0], slopes[:, :, 2] - slopes[:, :, 0])
        normals *= pieces.share * pieces.rule.weights[:, None]
        fluence, gradient = charges.fluence_and_gradient(points.reshape(-1, 3))
        through = charges.medium.diffusion * np.einsum("fqi,fqi->fq", gradient.reshape(points.shape), normals)
        amount = fluence.reshape(through.shape) * np.linalg.norm(normals, axis=2)
        np.add.at(value, owner, np.einsum("fq,fqa->fa", amount, shape_values))
        np.add.at(flux, owner, np.einsum("fq,fqa->fa", through, shape_values))
    return value, flux
