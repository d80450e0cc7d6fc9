"""`FittedPatch`: fitted charges on one mesh, their residual as a load, and the part that the mesh does not resolve."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.charges.check import exitance_error
from tetlux.fem.charges.samples import Samples, Spacing
from tetlux.fem.known.boundary_residual import BoundaryResidual, residual_at
from tetlux.fem.known.fitted import FittedLight
from tetlux.fem.known.patch import Patch, holds_sources
from tetlux.fem.known.patch_terms import BoundaryIntegrals, PatchTerms, patch_terms
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.operators.assembly import Lumping
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, NumberArray, sum_by_index
from tetlux.meshing.host.by_pair import ByPair
from tetlux.meshing.tets.mesh import TetMesh

# Ripples that a mesh misses are shorter than those that charges leave, by this factor.
SHORTER = 0.65
# Facets shorter than this times the distance of the points at which the residual is integrated have more points.
FINE = 0.7
# Largest size of a group of triangles that has one of these points, over the lengths of facets, which may then be split
# once.
FINER = 0.5
# Points are chosen anew if more facets than this share of the small ones have too few, and more than this number: a
# detector has dozens of small facets around it.
MOST_SMALL, FEWEST_SMALL = 0.1, 10
# A part of the surface is as fine as the smallest of so many facets around its middle asks for.
BESIDE = 4


@dataclass(frozen=True, eq=False, repr=False)
class FittedPatch(Patch):
    """The tetrahedra of a mesh where charges that are fitted to the true surface are accurate: mostly all.

    Parameters
    ----------
    residual : BoundaryResidual
        Of the boundary condition, on the true surface.
    facets : (q,) ndarray
        The boundary triangle nearest to each of its points.
    weights : (q, 3) ndarray
        Barycentric coordinates of the points there.
    """

    residual: BoundaryResidual
    facets: IntArray
    weights: FloatArray

    @cached_property
    def is_whole(self) -> bool:
        """Whether it is all tetrahedra of the mesh."""
        return bool(self.cells.all())

    def extend(self) -> "FittedPatch":
        """The same on all tetrahedra of the mesh."""
        return self if self.is_whole else replace(self, cells=np.ones(len(self.cells), dtype=bool))

    @cached_property
    def areas(self) -> FloatArray:
        """The areas that points of the surface stand for, (q,), unit²; 0 where they are not of the patch."""
        areas = self.residual.points.areas
        return areas if self.is_whole else areas * self.cells[self.mesh.boundary_cells[self.facets]]

    @cached_property
    def load(self) -> NumberArray:
        """``-∮ r v`` over the surface of the patch, (n,), W."""
        return self._at_nodes(-self.areas * self.residual.values)

    @cached_property
    def residual_at_nodes(self) -> NumberArray:
        """The residual that the mesh sees, averaged around each node, (n,), W/unit²; 0 at nodes inside."""
        area = self._at_nodes(self.areas)
        return np.divide(-self.load, area, out=np.zeros_like(self.load), where=area > 0)

    def unseen(self) -> FloatArray:
        """Integral of the square of the exitance that the mesh misses of each boundary triangle, (f,), W²/unit².

        Of the residual it sees averages around its nodes. What is left has ripples as long as charges are apart, or
        those that fit into a triangle, of which only a part reaches the exitance: see `tetlux.fem.charges.check`.
        """
        corners = self.mesh.boundary_faces[self.facets]
        seen = (self.residual_at_nodes[corners] * self.weights).sum(axis=1)
        sides = self.mesh.boundary_sides
        length = SHORTER * np.minimum(self.residual.points.spacing, sides[self.facets])
        missed = exitance_error(self.charges.equation, self.residual.values - seen, length)
        square = self.areas * np.abs(missed) ** 2
        return np.asarray(np.bincount(self.facets, square, minlength=len(sides)), dtype=np.float64)

    def splits_to_see(self) -> IntArray:
        """How often each boundary triangle has to be halved until it is as short as charges are apart, (f,)."""
        sides = self.mesh.boundary_sides
        apart = np.full(len(sides), np.inf)
        np.minimum.at(apart, self.facets, self.residual.points.spacing)
        # Two halve its sides.
        return np.asarray(np.ceil(2.0 * np.log2(np.maximum(sides / apart, 1.0))), dtype=np.int64)

    def _at_nodes(self, values: NumberArray) -> NumberArray:
        """Values (q,) shared out to the nodes of the triangles they belong to, (n,)."""
        corners = self.mesh.boundary_faces[self.facets]
        return sum_by_index(corners, values[:, None] * self.weights, len(self.mesh.points))


def fitted_patch(mesh: TetMesh, light: FittedLight, coarse: FittedPatch | None = None) -> FittedPatch:
    """A light's charges on a mesh; `coarse` is the same on one that this is a refinement of."""
    if coarse is None:
        at_nodes = light.charges.fluence(mesh.points)
    else:
        # Nodes of the coarse mesh come first.
        new = light.charges.fluence(mesh.points[len(coarse.at_nodes) :])
        at_nodes = np.concatenate([coarse.at_nodes, new])
    residual = light.residual if coarse is None else coarse.residual
    small = _are_small(mesh, light.points)
    lacking = int((small & _are_small(mesh, residual.points)).sum())
    anew = lacking > max(MOST_SMALL * int(small.sum()), FEWEST_SMALL)
    if anew:
        residual = residual_at(_finer_points(mesh, light, small), light.charges, light.residual)
    if coarse is None or anew:
        _, facets, weights = mesh.closest_boundary(residual.points.points)
    else:
        facets, weights = _unchanged(coarse.mesh, mesh)[coarse.facets], coarse.weights.copy()
        others = np.flatnonzero(facets < 0)
        _, facets[others], weights[others] = mesh.closest_boundary(residual.points.points[others])
    cells: BoolArray = np.asarray(light.accurate_on(mesh)[mesh.tetrahedra].all(axis=1))
    patch = FittedPatch(mesh, light.charges, cells, at_nodes, residual, facets, weights)
    return patch if patch.is_whole or holds_sources(patch) else patch.extend()


# On one mesh these are the same for all coefficients: which boundary triangles are small beside the distance of the
# points of a residual, and the finer points that replace those of the residual there.
_SMALL: ByPair[TetMesh, Samples, BoolArray] = ByPair()
_FINER: ByPair[TetMesh, Samples, Samples] = ByPair()


def _are_small(mesh: TetMesh, points: Samples) -> BoolArray:
    """Whether boundary triangles are smaller than the points of a residual are apart there, (f,)."""

    def compare() -> BoolArray:
        middles = mesh.points[mesh.boundary_faces].mean(axis=1)
        apart = np.sqrt(2.0 * points.areas)[points.tree.query(middles)[1]]
        return np.asarray(mesh.boundary_sides < FINE * apart)

    return _SMALL.get(mesh, points, compare)


def _spacing_of(mesh: TetMesh, small: BoolArray) -> Spacing:
    """The spacing of points that small boundary triangles need, of a mask (f,)."""
    corners = mesh.points[mesh.boundary_faces]
    limits, tree = np.where(small, FINER * mesh.boundary_sides, np.inf), cKDTree(corners.mean(axis=1))
    near = min(BESIDE, len(limits))
    return lambda queries: limits[tree.query(queries, k=near)[1].reshape(len(queries), near)].min(axis=1)


def _finer_points(mesh: TetMesh, light: FittedLight, small: BoolArray) -> Samples:
    """Points that are as close together as small boundary triangles need, of a mask (f,)."""
    return _FINER.get(mesh, light.points, lambda: light.points_within(_spacing_of(mesh, small)))


def _unchanged(coarse: TetMesh, fine: TetMesh) -> IntArray:
    """The boundary triangle of a refined mesh that each of the coarse mesh still is, -1 if it was split, (f,)."""
    count = len(fine.points)
    before, after = (
        (faces[:, 0] * count + faces[:, 1]) * count + faces[:, 2]
        for faces in (coarse.boundary_faces.astype(np.int64), fine.boundary_faces.astype(np.int64))
    )
    order = np.argsort(after)
    found = order[np.minimum(np.searchsorted(after, before, sorter=order), len(order) - 1)]
    return np.where(after[found] == before, found, -1)


def fitted_terms(patch: FittedPatch, absorbing: FloatArray, mass: Lumping) -> PatchTerms:
    """The load of what is missing, and the ledger of the charges less that of their values at the nodes.

    Parameters
    ----------
    patch : FittedPatch
    absorbing : (n,) ndarray
        Power absorbed for a fluence of 1 at each node, unit².
    mass : {"lumped", "consistent"}
        As in the system matrix.

    Returns
    -------
    PatchTerms
        Where the patch is whole, its load is that of ``u = phi - G``, not of the fluence itself.
    """
    mesh, charges, residual = patch.mesh, patch.charges, patch.residual
    areas = patch.areas
    if not patch.is_whole:
        # Sums over points miss power near the light, which is in the patch.
        leaving = (areas @ residual.exitance).item() + residual.missed
        through = (areas @ (residual.values - residual.exitance)).item() - residual.missed
        return patch_terms(patch, mass, BoundaryIntegrals(-patch.load, leaving, through))
    exited = (areas @ residual.exitance).item() + residual.missed
    inflow = (areas @ (residual.values - residual.exitance)).item() - residual.missed
    robin = boundary_condition_of(charges.medium).robin
    at_boundary = robin * (mesh.boundary_node_areas @ patch.at_nodes[mesh.boundary_nodes]).item()
    # Gauss: of the power of the sources, the body takes what does not flow out through its surface.
    taken = charges.strengths[: charges.sources].sum().item() + inflow
    absorbed, stored = charges.divide_power(taken)
    at_nodes = patch.at_nodes
    return PatchTerms(
        patch.load,
        exited - at_boundary,
        absorbed - (absorbing @ at_nodes).item(),
        stored - charges.shift * (mesh.node_volumes @ at_nodes).item(),
    )
