"""The error that a reading has because facets lie beside the true surfaces.

Bent facets follow a surface to the third order of their size, and those whose bending would invert a tetrahedron stay
flat. Let g be the gap from a facet to the true surface, positive outward. With fluence phi and dual solution z, which
obey the boundary condition ``D dphi/dn = q - beta phi`` with ``beta = 1/(2A)``, moving the facet by g changes the
reading to first order by::

    - ∮ g (D grad_t phi . grad_t z + sigma phi z + (beta/D - H) z (q - beta phi))

and moving a facet between media, with [] for the value inside less that beyond and the normal fluxes
``f = D dphi/dn`` and ``f_z = D dz/dn``, which do not jump, by::

    - ∮ g ([D] grad_t phi . grad_t z - [1/D] f f_z + [sigma] phi z)

(shape derivatives, Sokolowski & Zolesio 1992; grad_t is along the facet, H is the sum of both principal curvatures,
2/R of a ball). On fifteen readings of long cylinders that were off by .05 to 1.3 % because
edges stayed straight, this was .6 to 2 times the true error.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tetlux.fem.media.coefficients import at_cells
from tetlux.fem.quadratic.assembly import face_normals, gradients
from tetlux.fem.quadratic.elements import TRIANGLE_EDGES, shape_derivatives, shape_functions
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.fem.simplex_rules import Rule, triangle_rule
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.regions import owners


def gap_rule() -> Rule:
    """The quadrature rule of a facet. Its points are none of the six at which bent facets touch the surface."""
    return triangle_rule(4)


@dataclass(frozen=True, eq=False)
class Gaps:
    """Facets of one kind, and how far true surfaces lie from them.

    Attributes
    ----------
    space : QuadraticSpace
    corners : (f, 3) ndarray
        Node numbers of the facets.
    inside : (f,) ndarray
        The tetrahedra inside the surface.
    beyond : (f,) ndarray or None
        Those beyond; None at the boundary of the body.
    volumes : (f, q) ndarray
        Gap at quadrature points times their area, unit³; positive where the surface lies beyond the facet.
    normals : (f, q, 3) ndarray
        Outward unit normals of the true surface there.
    """

    space: QuadraticSpace
    corners: IntArray
    inside: IntArray
    beyond: IntArray | None
    volumes: FloatArray
    normals: FloatArray

    @cached_property
    def dofs(self) -> IntArray:
        """DOF numbers of the facets, (f, 6)."""
        return self.space.faces(self.corners)

    @cached_property
    def inverse_metric(self) -> FloatArray:
        """Inverse of the metric of facets, (f, q, 2, 2), 1/unit²."""
        return np.asarray(np.linalg.inv(self._tangents @ self._tangents.swapaxes(2, 3)))

    @cached_property
    def curvature(self) -> FloatArray:
        """The divergence of the normals along facets, by their linear fit to each, (f, q), 1/unit."""
        steps = np.linalg.pinv(np.column_stack([np.ones(len(gap_rule().points)), gap_rule().points[:, 1:]]))[1:]
        slopes = np.einsum("pq,fqi->fpi", steps, self.normals)
        products = np.einsum("fpi,fqri->fqpr", slopes, self._tangents)
        return np.asarray(np.einsum("fqpr,fqpr->fq", products, self.inverse_metric))

    @cached_property
    def _tangents(self) -> FloatArray:
        """Derivatives of places along the two edges from the first corner, (f, q, 2, 3)."""
        derivatives = shape_derivatives(gap_rule().points, TRIANGLE_EDGES)
        slopes = np.einsum("qap,fai->fqpi", derivatives, self.space.corners_and_bends(self.dofs))
        return np.asarray(slopes[:, :, 1:] - slopes[:, :, :1])

    def values(self, function: NumberArray) -> NumberArray:
        """A function (size,) at the quadrature points, (f, q)."""
        return np.asarray(function[self.dofs] @ shape_functions(gap_rule().points, TRIANGLE_EDGES).T)

    def tangential_slopes(self, function: NumberArray) -> NumberArray:
        """Derivatives along the two edges from the first corner, (f, q, 2)."""
        derivatives = shape_derivatives(gap_rule().points, TRIANGLE_EDGES)
        differences = derivatives[:, :, 1:] - derivatives[:, :, :1]
        return np.asarray(np.einsum("fa,qap->fqp", function[self.dofs], differences))

    @cached_property
    def _normals(self) -> FloatArray:
        normals = face_normals(self.space, self.dofs, gap_rule().points)
        return np.asarray(normals / np.linalg.norm(normals, axis=2, keepdims=True))

    def _normal_slopes(self, cells: IntArray) -> FloatArray:
        """Derivatives of the shape functions of tetrahedra (f,) at facets along the normals, (f, q, 10)."""
        rule = gap_rule()
        places = (self.space.mesh.tetrahedra[cells][:, :, None] == self.corners[:, None, :]).argmax(axis=1)
        barycentric = np.zeros((len(cells), len(rule.weights), 4))
        for corner in range(3):
            np.put_along_axis(barycentric, places[:, corner, None, None], rule.points[None, :, corner, None], axis=2)
        slopes = gradients(self.space, cells, barycentric, rule.weights)[0]
        return np.asarray(np.einsum("fqai,fqi->fqa", slopes, self._normals))

    @cached_property
    def _slopes_of_sides(self) -> list[FloatArray]:
        return [self._normal_slopes(cells) for cells in (self.inside, self.beyond) if cells is not None]

    def normal_flux(
        self, function: NumberArray, sides: Sequence[IntArray], diffusion: Sequence[FloatArray]
    ) -> NumberArray:
        """The mean of ``D df/dn`` in the tetrahedra (f,) on both sides, of which D (f,) are given, (f, q)."""
        fluxes = [
            each[:, None] * np.einsum("fqa,fa->fq", slopes, function[self.space.cells[cells]])
            for each, slopes, cells in zip(diffusion, self._slopes_of_sides, sides, strict=True)
        ]
        return np.asarray(0.5 * sum(fluxes))

    __repr__ = one_line


def gaps_of(operator: QuadraticOperator) -> list[Gaps]:
    """The facets of an operator's mesh and their gaps, of the boundary and between regions; found once for a mesh."""
    mesh, surface, inner = operator.mesh, operator.surface, operator.inner
    return mesh.cache.get((Gaps, surface, tuple(inner)), lambda: find_gaps(operator.space, surface, inner))


def find_gaps(space: QuadraticSpace, surface: Surface, inner: Sequence[Surface]) -> list[Gaps]:
    """The gaps of the boundary of a mesh to a surface, and of its facets between regions to inner surfaces."""
    mesh, found = space.mesh, []
    if surface is not mesh.surface:
        corners, cells = mesh.boundary_faces, mesh.boundary_cells
        found.append(Gaps(space, corners, cells, None, *_measure(space, corners, surface)))
    if inner and len(mesh.interfaces[0]):
        corners, pairs, cells = mesh.interfaces
        owner = owners(pairs, inner)
        volumes, normals = (np.zeros((len(corners), len(gap_rule().weights), *more)) for more in ((), (3,)))
        for number, each in enumerate(inner, 1):
            own = owner == number
            volumes[own], normals[own] = _measure(space, corners[own], each)
        first = pairs[:, 0] == owner
        inside, beyond = np.where(first, cells[:, 0], cells[:, 1]), np.where(first, cells[:, 1], cells[:, 0])
        found.append(Gaps(space, corners, inside, beyond, volumes, normals))
    return found


def _measure(space: QuadraticSpace, corners: IntArray, surface: Surface) -> tuple[FloatArray, FloatArray]:
    """Volumes of the gaps of facets, (f, q), and normals of the surface, (f, q, 3): see `Gaps`."""
    rule, dofs = gap_rule(), space.faces(corners)
    points = shape_functions(rule.points, TRIANGLE_EDGES) @ space.corners_and_bends(dofs)
    on_surface, normals = surface.project(points.reshape(-1, 3))
    gaps = np.einsum("qi,qi->q", on_surface - points.reshape(-1, 3), normals).reshape(points.shape[:2])
    areas = rule.weights * np.linalg.norm(face_normals(space, dofs, rule.points), axis=2)
    return np.asarray(gaps * areas), normals.reshape(points.shape)


def gap_contributions(
    operator: QuadraticOperator, fluence: NumberArray, dual: NumberArray, inflow: FloatArray
) -> NumberArray:
    """Contribution of the facets of each tetrahedron to the error of a linear function of the fluence, (m,).

    Parameters
    ----------
    operator : QuadraticOperator
    fluence, dual : (size,) ndarray
        The fluence and the dual solution of the function.
    inflow : (n,) ndarray
        Inflow through the boundary at the nodes, W/unit².
    """
    found = np.zeros(len(operator.mesh.tetrahedra), dtype=np.result_type(fluence, dual))
    for gaps in gaps_of(operator):
        if gaps.beyond is None:
            change = _at_boundary(gaps, operator, fluence, dual, inflow)
        else:
            change = _between_media(gaps, gaps.beyond, operator, fluence, dual)
        np.add.at(found, gaps.inside, (gaps.volumes * change).sum(axis=1))
    return found


def _at_boundary(
    gaps: Gaps, operator: QuadraticOperator, fluence: NumberArray, dual: NumberArray, inflow: FloatArray
) -> NumberArray:
    """What the gaps of the boundary are multiplied by, (f, q)."""
    coefficients, robin = operator.coefficients, operator.robin
    diffusion, sigma = (at_cells(each, gaps.inside)[:, None] for each in (coefficients.diffusion, coefficients.sigma))
    phi, z = gaps.values(fluence), gaps.values(dual)
    entering = inflow[gaps.corners] @ gap_rule().points.T
    return np.asarray(
        diffusion * _tangential_product(gaps, fluence, dual)
        + sigma * phi * z
        + (robin / diffusion - gaps.curvature) * z * (entering - robin * phi)
    )


def _between_media(
    gaps: Gaps, cells_beyond: IntArray, operator: QuadraticOperator, fluence: NumberArray, dual: NumberArray
) -> NumberArray:
    """What the gaps between regions are multiplied by, (f, q)."""
    coefficients, sides = operator.coefficients, (gaps.inside, cells_beyond)
    inside, beyond = (at_cells(coefficients.diffusion, cells) for cells in sides)
    jump = np.subtract(*(at_cells(coefficients.sigma, cells) for cells in sides))
    fluxes = gaps.normal_flux(fluence, sides, (inside, beyond)) * gaps.normal_flux(dual, sides, (inside, beyond))
    return np.asarray(
        (inside - beyond)[:, None] * _tangential_product(gaps, fluence, dual)
        - (1.0 / inside - 1.0 / beyond)[:, None] * fluxes
        + jump[:, None] * gaps.values(fluence) * gaps.values(dual)
    )


def _tangential_product(gaps: Gaps, first: NumberArray, second: NumberArray) -> NumberArray:
    """Products of the gradients of two functions along facets, (f, q)."""
    slopes = gaps.tangential_slopes(first), gaps.tangential_slopes(second)
    return np.asarray(np.einsum("fqp,fqpr,fqr->fq", slopes[0], gaps.inverse_metric, slopes[1]))
