"""What a patch adds to the load vector and to the ledger: integrals over its faces, less those of the interpolant."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.known.charges import Charges
from tetlux.fem.known.patch import Patch
from tetlux.fem.media.coefficients import coefficients_of
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.operators.assembly import Lumping
from tetlux.fem.operators.loads import load_vector
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import FloatArray, IntArray, sum_by_index
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.subdivide import quarter_triangles
from tetlux.meshing.surface.triangles import longest_sides, triangle_areas

# Degrees of the quadrature rules for the faces of a patch, by the largest ratio of the longest edge to the distance of
# the nearest charge. A face above the last limit is cut in four, at most _CUTS times.
_DEGREES = ((0.15, 2), (0.5, 4), (2.0, 8))
_CUTS = 12


@dataclass(frozen=True, eq=False)
class PatchTerms:
    """What a patch adds to the load vector and to the ledger.

    Attributes
    ----------
    load : (n,) ndarray
        ``P v(x0) - a(G - I_h G, v)`` over the patch, W.
    exited, absorbed : float
        Of ``G - I_h G``, W.
    """

    load: FloatArray
    exited: float
    absorbed: float

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class BoundaryIntegrals:
    """Integrals of charges over the part of the true surface that bounds a patch.

    Attributes
    ----------
    load : (n,) ndarray
        ``∮ (D dG/dn + G/(2A)) v``, W.
    leaving, through : float
        ``∮ G/(2A)`` and ``∮ D dG/dn``, W.
    """

    load: FloatArray
    leaving: float
    through: float

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
    sources = SourceTerms(points=charges.positions[: charges.sources], powers=charges.strengths[: charges.sources])
    if not patch.cells.any():
        return PatchTerms(load_vector(mesh, coefficients_of(medium), sources), exited=0.0, absorbed=0.0)
    count = len(mesh.points)
    faces, on_boundary = patch.faces
    robin = boundary_condition_of(medium).robin
    integrated = np.ones(len(faces), dtype=bool) if surface is None else ~on_boundary
    value, through = _integrals(mesh.points[faces[integrated]], charges)
    leaving = robin * value * on_boundary[integrated, None]
    load = -sum_by_index(faces[integrated], through + leaving, count)
    leaves, flows = float(leaving.sum()), float(through.sum())
    if surface is not None:
        load -= surface.load
        leaves, flows = leaves + surface.leaving, flows + surface.through
    # a(I_h G, v): stiffness, absorption and boundary terms of the patch, times G at the nodes.
    inside = slice(None) if patch.cells.all() else np.flatnonzero(patch.cells)
    cells = mesh.tetrahedra[inside]
    values = patch.at_nodes[cells]
    hats = mesh.hat_gradients[inside]
    volumes = mesh.volumes[inside]
    slope = np.einsum("mij,mi->mj", hats, values)
    stiff = (medium.diffusion * volumes)[:, None] * np.einsum("mij,mj->mi", hats, slope)
    absorbed = medium.sigma_a * volumes[:, None] * _mass(values, mass)
    _, areas = triangle_areas(mesh.points, faces)
    exited = robin * (areas * on_boundary)[:, None] * _mass(patch.at_nodes[faces], mass)
    load += sum_by_index(cells, stiff + absorbed, count) + sum_by_index(faces, exited, count)
    return PatchTerms(
        load,
        exited=leaves - float(exited.sum()),
        # Gauss: of the power of the sources, the patch absorbs what does not flow out through its faces.
        absorbed=float(sources.powers.sum() + flows - absorbed.sum()),
    )


def _mass(values: FloatArray, mass: Lumping) -> FloatArray:
    """Lumping matrices of simplices of unit size times values at their corners, (m, d + 1)."""
    corners = values.shape[1]
    if mass == "lumped":
        return np.asarray(values / corners)
    return np.asarray((values + values.sum(axis=1, keepdims=True)) / (corners * (corners + 1)))


@lru_cache(maxsize=1)
def _rules() -> list[tuple[float, FloatArray, FloatArray]]:
    """The limit, nodes (2, q) and weights (q,) of each quadrature rule of the unit triangle."""
    # Imported here, since scikit-fem takes a sixth of the time that tetlux.fem takes to import.
    from skfem.quadrature import get_quadrature  # noqa: PLC0415
    from skfem.refdom import RefTri  # noqa: PLC0415

    return [(limit, *get_quadrature(RefTri, degree)) for limit, degree in _DEGREES]


def _integrals(corners: FloatArray, charges: Charges) -> tuple[FloatArray, FloatArray]:
    """Integrals over triangles (f, 3, 3) of G and of ``D dG/dn`` against their three hat functions, (f, 3) each."""
    value, flux = np.zeros((len(corners), 3)), np.zeros((len(corners), 3))
    tree = cKDTree(charges.positions)
    # Triangles left to integrate: the face they belong to, and the barycentric coordinates of their corners in it.
    owner, place = np.arange(len(corners)), np.broadcast_to(np.eye(3), (len(corners), 3, 3))
    for cut in range(_CUTS + 1):
        part = place @ corners[owner]
        size = longest_sides(part)
        near = size / np.maximum(tree.query(part.mean(axis=1))[0], 1e-12 * size) if len(part) else size
        done = np.zeros(len(part), dtype=bool)
        for limit, nodes, weights in _rules():
            last = limit == _DEGREES[-1][0] and cut == _CUTS
            now = ~done & ((near < limit) | last)
            done |= now
            _add_rule(value, flux, owner[now], place[now], part[now], nodes, weights, charges)
        if done.all():
            break
        owner, place = np.repeat(owner[~done], 4), quarter_triangles(place[~done])
    return value, flux


def _add_rule(
    value: FloatArray,
    flux: FloatArray,
    owner: IntArray,
    place: FloatArray,
    part: FloatArray,
    nodes: FloatArray,
    weights: FloatArray,
    charges: Charges,
) -> None:
    """Add a quadrature rule's integrals over parts of faces to `value` and `flux` (f, 3) of their owners."""
    if len(owner) == 0:
        return
    hats = np.column_stack([1.0 - nodes[0] - nodes[1], nodes[0], nodes[1]])
    fluence, gradient = charges.fluence_and_gradient((hats @ part).reshape(-1, 3))
    normal = np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0])  # as long as twice the area
    area = np.linalg.norm(normal, axis=1)
    through = charges.medium.diffusion * np.einsum("fqi,fi->fq", gradient.reshape(len(part), -1, 3), normal)
    tests = hats @ place
    np.add.at(value, owner, np.einsum("fq,fqi->fi", fluence.reshape(len(part), -1) * area[:, None] * weights, tests))
    np.add.at(flux, owner, np.einsum("fq,fqi->fi", through * weights, tests))
