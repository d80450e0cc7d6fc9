"""Patches of subtracted charges in quadratic elements, as `tetlux.fem.known.patch_terms` has them in linear ones.

Across inner faces of a patch the fluence jumps by the interpolation error G - I G. The jump changes a reading by
``∮ (G - I G) D dz/dn``, with z its dual solution; adding this term to the load cancels the change.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.known.patch import Patch
from tetlux.fem.quadratic.assembly import face_matrices
from tetlux.fem.quadratic.loads import point_load
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.fem.quadratic.patch_faces import Field, InnerFaces, integrate_over_faces
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.meshing.arrays import BoolArray, IntArray, NumberArray, sum_columns
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.topology import FACES


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
        return interpolant_of(self.space, self.patch, self.patch.charges, self.patch.at_nodes)

    @property
    def is_fitted(self) -> bool:
        """Whether the charges are fitted to the surface, and subtracted in all of the body where they are accurate."""
        return isinstance(self.patch, FittedPatch)

    __repr__ = one_line


def interpolant_of(space: QuadraticSpace, patch: Patch, field: Field, at_nodes: NumberArray) -> NumberArray:
    """The quadratic interpolants of fields on a patch, given their values at the nodes (n, ...), (size, ...)."""
    if not patch.cells.any():
        return np.zeros((space.size, *at_nodes.shape[1:]))
    mesh = space.mesh
    marked = np.zeros(len(mesh.edges), dtype=bool)
    marked[mesh.tetrahedron_edges[patch.cells]] = True
    edges = np.flatnonzero(marked)
    at_middles = at_nodes[mesh.edges].mean(axis=1)
    at_middles[edges] = field.fluence(space.middles[edges])
    return space.interpolate(at_nodes, at_middles)


def quadratic_patch(operator: QuadraticOperator, patch: Patch, inner: InnerFaces) -> QuadraticPatch:
    """A patch with its load."""
    space, charges = operator.space, patch.charges
    if not patch.cells.any():
        sources = slice(charges.sources)
        return QuadraticPatch(
            patch, space, point_load(space, charges.positions[sources], charges.strengths[sources].real)
        )
    if patch.cells.all() and operator.coefficients.uniform:
        return QuadraticPatch(patch, space, -_leaving(operator, patch, charges)[:, 0], is_whole=True)
    interpolant = interpolant_of(space, patch, charges, patch.at_nodes)
    function = interpolant[:, None]
    load = field_load(operator, patch, charges, function, charges.equation.diffusion * function, inner)
    found = QuadraticPatch(patch, space, load[:, 0])
    vars(found)["interpolant"] = interpolant
    return found


def field_load(
    operator: QuadraticOperator,
    patch: Patch,
    field: Field,
    interpolant: NumberArray,
    of_potential: NumberArray,
    inner: InnerFaces,
) -> NumberArray:
    """What a field G on a patch adds to the load: ``a(I G, v) - ∮ (D dG/dn + G/(2A)) v + ∮ (D G - I D G) dv/dn``.

    There are k of them: one of charges, or their derivatives.

    Parameters
    ----------
    operator : QuadraticOperator
    patch : Patch
        Not empty.
    field : Charges or ChargeDerivatives
    interpolant, of_potential : (size, k) ndarray
        Interpolants of G and of D G.
    inner : InnerFaces
        Among them those at which the patch ends.

    Returns
    -------
    (size, k) ndarray
    """
    load = _product(operator, patch, interpolant) - _leaving(operator, patch, field)
    return load + inner.jump_load(patch, field, of_potential)


def _leaving(operator: QuadraticOperator, patch: Patch, field: Field) -> NumberArray:
    """``∮ (D dG/dn + G/(2A)) v`` over the faces of a patch, the second term at the surface of the body, (size, k)."""
    space = operator.space
    cell, face, on_boundary = patch.outer
    faces = space.faces(space.mesh.tetrahedra[cell[:, None], FACES[face]])
    value, flux = integrate_over_faces(space, faces, patch.charges.positions, field)
    return sum_columns(faces, flux + (operator.robin * on_boundary)[:, None, None] * value, space.size)


def _product(operator: QuadraticOperator, patch: Patch, functions: NumberArray) -> NumberArray:
    """The matrix of the tetrahedra of a patch and their boundary triangles times functions (size, k), (size, k).

    That is the matrix of the body less the tetrahedra around the patch, which are fewer.
    """
    space, cells = operator.space, patch.cells
    if cells.all():
        return np.asarray(operator.matrix @ functions)
    within = np.zeros(space.size, dtype=bool)
    within[space.cells[cells]] = True
    values = np.where(within[:, None], functions, 0.0)
    around = np.flatnonzero(_touch(within, space.cells) & ~cells)
    faces = space.boundary_faces[~cells[space.mesh.boundary_cells]]
    faces = faces[_touch(within, faces)]
    product = operator.matrix @ values
    for matrices, dofs in (
        (operator.elements_of(around), space.cells[around]),
        (operator.robin * face_matrices(space, faces), faces),
    ):
        product -= sum_columns(dofs, matrices @ values[dofs], space.size)
    return np.asarray(product)


def _touch(within: BoolArray, dofs: IntArray) -> BoolArray:
    """Whether any of the DOFs of tetrahedra or triangles (c, k) is marked (size,), (c,)."""
    found = within[dofs[:, 0]]
    for column in dofs.T[1:]:
        found |= within[column]
    return np.asarray(found)
