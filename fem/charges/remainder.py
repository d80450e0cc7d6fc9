"""What charges leave to finite elements.

Charges G that are fitted to the true surface violate the boundary condition there by ``r = D dG/dn + G/(2A)``. What is
missing, ``u = phi - G``, obeys the equation without light, and

    ∫ D grad u . grad v + sigma_a u v  +  ∮ u v/(2A)  =  -∮ r v

Nothing else of G enters, so that flat facets do no harm: r is that of the true surface, and is carried to the facets
of a mesh by nearest points. u is small and smooth, since charges carry what is near the light: a coarse mesh will do.

| body | charges | nodes | error alone, with u | median below 1 % of the brightest | `solve` at .005: nodes, both |
|---|---|---|---|---|---|
| ball R 10 | 100 / 300 | 549 | .043, .037 / .002, .001 % | .26, .07 / .02, .01 % | 3,935, .14 %, .9 % |
| torus | 100 / 300 | 476 | .42, .21 / .011, .009 % | 8.6, 2.2 / .21, .13 % | 4,307, .25 %, 2.9 % |
| box | 100 / 300 | 1,144 | .10, .05 / .008, .004 % | 1.2, .26 / .09, .04 % | 1,541, .18 %, 1.8 % |
| hare, back | 100 / 300 | 723 | .61, .40 / .12, .08 % | 7.2, 1.9 / 1.8, 1.1 % | 6,052, .18 %, 1.6 % |
| hare, ear | 100 / 300 | 723 | 4.8, 2.4 / .89, .45 % | 21, 7.8 / 9.1, 4.8 % | 10,527, .39 %, 3.9 % |
| spot | 100 / 300 | 901 | 4.5, 1.4 / 1.3, .48 % | 13, 4.0 / 5.1, 2.4 % | 6,155, .38 %, 2.4 % |

(``python -m tests.benchmarks.charges --remainder``.)
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.charges.adapt import FittedCharges
from tetlux.fem.charges.places import FINER
from tetlux.fem.charges.quadrature import quadrature
from tetlux.fem.linear.solver import solver_for
from tetlux.fem.media.medium import Medium
from tetlux.fem.operators.assembly import system_matrix
from tetlux.meshing.arrays import FloatArray, sum_by_index
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Remainder:
    """Charges and what finite elements add to them.

    Attributes
    ----------
    mesh : TetMesh
    medium : Medium
    fitted : FittedCharges
    nodal : (n,) ndarray
        ``phi - G`` of all lights together at the nodes of `mesh`, W/unit².
    """

    mesh: TetMesh
    medium: Medium
    fitted: FittedCharges
    nodal: FloatArray

    def added_on(self, points: FloatArray) -> FloatArray:
        """Exitance that is added to that of the charges, at points (q, 3) of the surface, (q,), W/unit²."""
        _, face, weights = self.mesh.closest_boundary(points)
        fluence = (weights * self.nodal[self.mesh.boundary_faces[face]]).sum(axis=1)
        return np.asarray(fluence / (2.0 * self.medium.boundary_factor))

    def exitance_on(self, points: FloatArray) -> FloatArray:
        """Exitance at points (q, 3) of the surface, (q,), W/unit²."""
        return np.asarray(self.fitted.field.exitance(points).sum(axis=1) + self.added_on(points))


def solve_remainder(mesh: TetMesh, surface: Surface, medium: Medium, fitted: FittedCharges) -> Remainder:
    """Solve for what fitted charges are off by.

    Parameters
    ----------
    mesh : TetMesh
        Of the body that `surface` bounds.
    surface : Surface
    medium : Medium
        That the charges were fitted for.
    fitted : FittedCharges

    Returns
    -------
    Remainder
    """
    samples = fitted.places.fitted
    tree = cKDTree(samples.points)
    # The residual ripples as finely as charges are spaced, and only what is left of it between ripples counts.
    points = quadrature(surface, lambda places: 0.5 * FINER * samples.spacing[tree.query(places)[1]])
    _, residual = fitted.field.exitance_and_residual(points.points, points.normals)
    missing = points.areas * (fitted.drive.inflow.sum() - residual.sum(axis=1))
    _, face, weights = mesh.closest_boundary(points.points)
    load = sum_by_index(mesh.boundary_faces[face], missing[:, None] * weights, len(mesh.points))
    solver = solver_for(system_matrix(mesh, medium, "consistent"))
    return Remainder(mesh, medium, fitted, solver.solve(load[:, None]).x[:, 0])
