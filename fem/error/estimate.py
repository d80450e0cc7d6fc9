"""The error of the exitance, and the share of each tetrahedron in it.

The dual-weighted residual (Becker & Rannacher 2001): the system is solved once more with the exitance itself as its
load. This dual solution z is the weight of a local error in the exitance. A second dual, with an even load, gives the
weight of a local error in the total power that leaves. For either of them these add up:

* the residual within tetrahedra (`tetlux.fem.error.residual`),
* layers thinner than their tetrahedra (`tetlux.fem.error.layers`),
* flat facets in place of curved surfaces (`tetlux.fem.error.facets`),
* ripples of what fitted charges violate at the boundary that are finer than facets (`tetlux.fem.known.fitted_patch`),
  which hardly change the total.

All terms are moduli, so that errors that cancel are counted.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.error.facets import boundary_facets, interface_facets
from tetlux.fem.error.layers import boundary_layers, interface_layers
from tetlux.fem.error.residual import averaging, lumping_error, ripple, root_mean_square, roughness, without_patches
from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.linear.solver import Solver
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.operators.fitting import LayerFitting
from tetlux.fem.outcome.solution import Solution
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import map_in_threads
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Facets of a round body err to one side, and partly against the gradients. With half of their sum the estimate is 0.6
# to 3 times the true error on spheres, cylinders and slabs of 3 to 100 mean free paths, sources 0.005 to 10 below the
# surface, indices 1 to 1.5 and albedos 0.5 to 0.9999, and in the corners of boxes.
FACETS = 0.5
# Exited power below this share of the incident power is the residual of the linear solver.
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated errors of a solution.

    Attributes
    ----------
    shares, power_shares : (m,) ndarray
        Shares of the tetrahedra in the relative errors of the exitance and of the total power that leaves.
    """

    shares: FloatArray
    power_shares: FloatArray

    @property
    def error(self) -> float:
        """Relative L2 error of the exitance over the surface."""
        return float(self.shares.sum())

    __repr__ = one_line


def estimate_error(
    solution: Solution,
    whole: Solution,
    coefficients: Coefficients,
    solver: Solver,
    load: FloatArray,
    emission: float | FloatArray = 0.0,
    inner: Sequence[Surface] = (),
    fitting: LayerFitting | None = None,
) -> Estimate:
    """Estimate the error of a solution, or of a part of one.

    Parameters
    ----------
    solution : Solution
    whole : Solution
        The solution that it is part of, or itself: errors are relative to its exitance.
    coefficients : Coefficients
        Of the mesh of the solution.
    solver : Solver
        Of the system matrix.
    load : (n,) ndarray
        Power that the lights deposit at the nodes, W.
    emission : float or (m,) ndarray
        Of the volume, W/unit³.
    inner : sequence of Surface
        Of the regions of the mesh.
    fitting : LayerFitting, optional
        Of the matrix.

    Returns
    -------
    Estimate
    """
    mesh, areas = solution.mesh, solution.mesh.boundary_node_areas
    norm, total = float(np.sqrt(areas @ whole.exitance**2)), float(areas @ np.abs(whole.exitance))
    if total <= ROUNDING * whole.power.incident:
        # Where no light leaves, the exitance has no error.
        return Estimate(np.zeros(len(mesh.tetrahedra)), np.zeros(len(mesh.tetrahedra)))
    duals = solver.solve_to_low_accuracy(_dual_loads(mesh, coefficients, whole.exitance, norm, total)).x
    mean = averaging(mesh)
    smooth, rough = without_patches(solution, mean)
    slope_error = root_mean_square(rough)
    beyond, leaving = _beyond_fitted(solution)
    diffusion, scale = coefficients.diffusion, 1.0
    if fitting is not None:
        diffusion, scale = fitting.diffusion, fitting.absorption_scale[mesh.tetrahedra].min(axis=1) ** 2

    def shares_by(dual: FloatArray) -> FloatArray:
        at_corners = dual[mesh.tetrahedra]
        shares = diffusion * mesh.volumes * slope_error * root_mean_square(roughness(mesh, mean, dual))
        shares += scale * coefficients.sigma_a * mesh.volumes * lumping_error(smooth, at_corners)
        shares += _boundary_lumping(mesh, coefficients, smooth, dual)
        if fitting is not None:
            shares += boundary_layers(mesh, coefficients, fitting, smooth[mesh.boundary_cells], dual)
        values = beyond, leaving, dual
        shares += FACETS * boundary_facets(mesh, coefficients, solution.surface, values, float(shares.sum()), scale)
        shares += interface_layers(mesh, coefficients, smooth, at_corners)
        return shares + FACETS * interface_facets(mesh, coefficients, inner, emission, (solution.fluence, dual))

    shares, power_shares = map_in_threads(shares_by, list(duals.T))
    shares += ripple(mesh, coefficients, load, norm) + _unseen(solution, norm)
    return Estimate(shares, power_shares)


def _dual_loads(
    mesh: TetMesh, coefficients: Coefficients, exitance: FloatArray, norm: float, total: float
) -> FloatArray:
    """Loads of the two duals (n, 2): of the exitance, by its L2 norm, and of all that leaves, by its integral."""
    loads = np.zeros((len(mesh.points), 2))
    robin, areas = boundary_condition_of(coefficients.outer).robin, mesh.boundary_node_areas
    loads[mesh.boundary_nodes, 0] = robin * areas * exitance / norm**2
    loads[mesh.boundary_nodes, 1] = robin * areas / total
    return loads


def _beyond_fitted(solution: Solution) -> tuple[FloatArray, FloatArray]:
    """What the mesh adds to fitted charges: its fluence, and the net flux of that which leaves, at the nodes (n,)."""
    mesh, beyond = solution.mesh, solution.fluence
    leaving = np.zeros(len(mesh.points))
    leaving[mesh.boundary_nodes] = solution.exitance - solution.transmitted_irradiance
    for patch in solution.patches:
        if isinstance(patch, FittedPatch):
            beyond = beyond - patch.at_nodes
            robin = boundary_condition_of(patch.charges.medium).robin
            leaving[mesh.boundary_nodes] -= robin * patch.at_nodes[mesh.boundary_nodes]
            leaving += patch.residual_at_nodes
    return beyond, leaving


def _unseen(solution: Solution, norm: float) -> FloatArray:
    """Shares in what the mesh misses of the residuals of fitted charges, (m,), by the norm of the exitance."""
    mesh = solution.mesh
    square = np.zeros(len(mesh.boundary_faces))
    for patch in solution.patches:
        if isinstance(patch, FittedPatch):
            square += patch.unseen()
    shares = np.bincount(mesh.boundary_cells, square, minlength=len(mesh.tetrahedra))
    total = float(np.sqrt(shares.sum()))
    return np.asarray(shares / (total * norm if total > 0 else 1.0), dtype=np.float64)


def _boundary_lumping(mesh: TetMesh, coefficients: Coefficients, smooth: FloatArray, dual: FloatArray) -> FloatArray:
    """Shares in the error of lumping the boundary term, (m,)."""
    cells, faces = mesh.boundary_cells, mesh.boundary_faces
    corners = (mesh.tetrahedra[cells][:, None, :] == faces[:, :, None]).argmax(axis=2)
    on_faces = lumping_error(np.take_along_axis(smooth[cells], corners, axis=1), dual[faces])
    weights = boundary_condition_of(coefficients.outer).robin * mesh.boundary_areas * on_faces
    return np.asarray(np.bincount(cells, weights, minlength=len(mesh.tetrahedra)), dtype=np.float64)
