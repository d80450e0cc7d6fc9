"""`FittedPatch`: fitted charges on one mesh, what they leave to it, and what of that it does not see."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tetlux.fem.charges.check import damped
from tetlux.fem.charges.kernel import equation_of
from tetlux.fem.known.fitted import FittedLight, Violation
from tetlux.fem.known.patch import Patch
from tetlux.fem.known.patch_terms import PatchTerms
from tetlux.meshing.arrays import FloatArray, IntArray, summed
from tetlux.meshing.surface.surface import longest_sides
from tetlux.meshing.tets.mesh import TetMesh

# Ripples that a mesh misses are shorter than those that charges leave, by this factor.
SHORTER = 0.65


@dataclass(frozen=True, eq=False, repr=False)
class FittedPatch(Patch):
    """All tetrahedra of a mesh, with charges that are fitted to the true surface.

    Parameters
    ----------
    violation : Violation
        Of the charges, on the true surface.
    facets : (q,) ndarray
        The boundary triangle nearest to each of its points.
    weights : (q, 3) ndarray
        Barycentric coordinates of the points there.
    """

    violation: Violation
    facets: IntArray
    weights: FloatArray

    @cached_property
    def load(self) -> FloatArray:
        """``-∮ r v`` (n,), W."""
        missing = -self.violation.points.areas * self.violation.residual
        return self._at_nodes(missing)

    @cached_property
    def residual_at_nodes(self) -> FloatArray:
        """The residual that the mesh sees, averaged around each node, (n,), W/unit²; 0 at nodes inside."""
        area = self._at_nodes(self.violation.points.areas)
        return np.divide(-self.load, area, out=np.zeros(len(area)), where=area > 0)

    def unseen(self) -> FloatArray:
        """Integral of the square of the exitance that the mesh misses of each boundary triangle, (f,), W²/unit².

        Of the residual it sees averages around its nodes. What is left has ripples as long as charges are apart, or
        those that fit into a triangle, of which only a part reaches the exitance: see `tetlux.fem.charges.check`.
        """
        corners = self.mesh.boundary_faces[self.facets]
        seen = (self.residual_at_nodes[corners] * self.weights).sum(axis=1)
        sides = longest_sides(self.mesh.points[self.mesh.boundary_faces])
        length = SHORTER * np.minimum(self.violation.points.spacing, sides[self.facets])
        missed = damped(equation_of(self.charges.medium), self.violation.residual - seen, length)
        square = self.violation.points.areas * missed**2
        return np.asarray(np.bincount(self.facets, square, minlength=len(sides)), dtype=np.float64)

    def _at_nodes(self, values: FloatArray) -> FloatArray:
        """Values (q,) shared out to the nodes of the triangles they belong to, (n,)."""
        corners = self.mesh.boundary_faces[self.facets]
        return summed(corners, values[:, None] * self.weights, len(self.mesh.points))


def fitted_patch(mesh: TetMesh, light: FittedLight) -> FittedPatch:
    """A light's charges on a mesh."""
    everywhere = np.ones(len(mesh.tetrahedra), dtype=bool)
    at_nodes = light.charges.fluence(mesh.points)
    _, facets, weights = mesh.closest_boundary(light.violation.points.points)
    return FittedPatch(mesh, light.charges, everywhere, at_nodes, light.violation, facets, weights)


def fitted_terms(patch: FittedPatch, absorbing: FloatArray) -> PatchTerms:
    """The load of what is missing, and the ledger of the charges less that of their values at the nodes.

    Parameters
    ----------
    patch : FittedPatch
    absorbing : (n,) ndarray
        Power absorbed for a fluence of 1 at each node, unit².

    Returns
    -------
    PatchTerms
        Its load is that of ``u = phi - G``, not of the fluence itself.
    """
    mesh, charges, violation = patch.mesh, patch.charges, patch.violation
    areas = violation.points.areas
    exited, inflow = float(areas @ violation.exitance), float(areas @ (violation.residual - violation.exitance))
    robin = 0.5 / charges.medium.boundary_factor
    at_boundary = robin * float(mesh.boundary_node_areas @ patch.at_nodes[mesh.boundary_nodes])
    # Gauss: of the power of the sources, the body absorbs what does not flow out through its surface.
    absorbed = float(charges.strengths[: charges.sources].sum()) + inflow
    return PatchTerms(patch.load, exited - at_boundary, absorbed - float(absorbing @ patch.at_nodes))
