"""What a patch adds to the load vector and to the ledger: integrals over its faces, less those of the interpolant."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.known.charges import Charges
from tetlux.fem.known.patch import Patch
from tetlux.fem.media.coefficients import coefficients_of
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.operators.assembly import Lumping
from tetlux.fem.operators.loads import load_vector
from tetlux.fem.simplex_rules import cut_near_charges
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import FloatArray, IntArray, Number, NumberArray, sum_by_index
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.triangles import triangle_areas

# Degrees of the quadrature rules for the faces of a patch: see `cut_near_charges`.
_DEGREES = ((0.15, 2), (0.5, 4), (2.0, 8))


@dataclass(frozen=True, eq=False)
class PatchTerms:
    """What a patch adds to the load vector and to the ledger.

    Attributes
    ----------
    load : (n,) ndarray
        ``P v(x0) - a(G - I_h G, v)`` over the patch, W.
    exited, absorbed, stored : float or complex
        Of ``G - I_h G``, W.
    """

    load: NumberArray
    exited: Number
    absorbed: Number
    stored: Number = 0.0

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class BoundaryIntegrals:
    """Integrals of charges over the part of the true surface that bounds a patch.

    Attributes
    ----------
    load : (n,) ndarray
        ``∮ (D dG/dn + G/(2A)) v``, W.
    leaving, through : float or complex
        ``∮ G/(2A)`` and ``∮ D dG/dn``, W.
    """

    load: NumberArray
    leaving: Number
    through: Number

    __repr__ = one_line


def patch_terms(patch: Patch, mass: Lumping, surface: BoundaryIntegrals | None = None) -> PatchTerms:
    """Assemble the terms of a patch.

    Parameters
    ----------
    patch : Patch
    mass : {"lumped", "consistent"}
        Integration of the terms without derivatives, as in the system matrix.
    surface : BoundaryIntegrals, optional
        In place of integrals over the boundary facets of the mesh.

    Returns
    -------
    PatchTerms
    """
    mesh, charges, medium = patch.mesh, patch.charges, patch.charges.medium
    sources = SourceTerms(points=charges.positions[: charges.sources], powers=charges.strengths[: charges.sources].real)
    if not patch.cells.any():
        return PatchTerms(load_vector(mesh, coefficients_of(medium), sources), exited=0.0, absorbed=0.0)
    count = len(mesh.points)
    faces, on_boundary = patch.faces
    robin = boundary_condition_of(medium).robin
    integrated = np.ones(len(faces), dtype=bool) if surface is None else ~on_boundary
    value, through = _integrals(mesh.points[faces[integrated]], charges)
    leaving = robin * value * on_boundary[integrated, None]
    load = -sum_by_index(faces[integrated], through + leaving, count)
    leaves, flows = leaving.sum().item(), through.sum().item()
    if surface is not None:
        load = load - surface.load
        leaves, flows = leaves + surface.leaving, flows + surface.through
    # a(I_h G, v): stiffness, absorption and boundary terms of the patch, times G at the nodes.
    inside = slice(None) if patch.cells.all() else np.flatnonzero(patch.cells)
    cells = mesh.tetrahedra[inside]
    values = patch.at_nodes[cells]
    hats = mesh.hat_gradients[inside]
    volumes = mesh.volumes[inside]
    slope = np.einsum("mij,mi->mj", hats, values)
    stiff = (medium.diffusion * volumes)[:, None] * np.einsum("mij,mj->mi", hats, slope)
    at_corners = volumes[:, None] * _mass(values, mass)
    _, areas = triangle_areas(mesh.points, faces)
    exited = robin * (areas * on_boundary)[:, None] * _mass(patch.at_nodes[faces], mass)
    sigma = medium.sigma_a + charges.shift if charges.shift else medium.sigma_a
    load += sum_by_index(cells, stiff + sigma * at_corners, count) + sum_by_index(faces, exited, count)
    # Gauss: of the power of the sources, the patch takes what does not flow out through its faces.
    absorbed, stored = charges.divide_power(sources.powers.sum().item() + flows)
    held = at_corners.sum().item()
    return PatchTerms(
        load,
        exited=leaves - exited.sum().item(),
        absorbed=absorbed - medium.sigma_a * held,
        stored=stored - charges.shift * held,
    )


def _mass(values: NumberArray, mass: Lumping) -> NumberArray:
    """Mass matrices of simplices of unit size times values at their corners, (m, d + 1)."""
    corners = values.shape[1]
    if mass == "lumped":
        return np.asarray(values / corners)
    return np.asarray((values + values.sum(axis=1, keepdims=True)) / (corners * (corners + 1)))


def _integrals(corners: FloatArray, charges: Charges) -> tuple[NumberArray, NumberArray]:
    """Integrals over triangles (f, 3, 3) of G and of ``D dG/dn`` against their three hat functions, (f, 3) each."""
    value, flux = np.zeros((2, len(corners), 3), charges.equation.dtype)

    def locate(owner: IntArray, places: FloatArray) -> FloatArray:
        return np.asarray(places @ corners[owner])

    for pieces in cut_near_charges(len(corners), locate, charges.positions, _DEGREES):
        owner, parts = pieces.owner, locate(pieces.owner, pieces.corners)
        fluence, gradient = charges.fluence_and_gradient((pieces.rule.points @ parts).reshape(-1, 3))
        normals = 0.5 * np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0])  # as long as the area
        areas = np.linalg.norm(normals, axis=1)[:, None] * pieces.rule.weights
        through = np.einsum("fqi,fi->fq", gradient.reshape(len(parts), -1, 3), normals) * pieces.rule.weights
        hats = pieces.rule.points @ pieces.corners
        np.add.at(value, owner, np.einsum("fq,fqi->fi", fluence.reshape(areas.shape) * areas, hats))
        np.add.at(flux, owner, np.einsum("fq,fqi->fi", charges.medium.diffusion * through, hats))
    return value, flux
