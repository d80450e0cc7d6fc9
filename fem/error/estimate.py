"""The error of the exitance, and an indicator of the contribution of each tetrahedron to it.

The dual-weighted residual (Becker & Rannacher 2001): the system is solved once more with the exitance itself as its
load. This dual solution z is the weight of a local residual in the error of the exitance. A second dual, with a uniform
load, gives the weight in the error of the total exited power. The indicators of either dual are the sum of:

* the residual within tetrahedra (`tetlux.fem.error.residual`),
* layers thinner than their tetrahedra (`tetlux.fem.error.layers`),
* flat facets in place of curved surfaces (`tetlux.fem.error.facets`),
* the part of the residual of fitted charges that the facets do not resolve (`tetlux.fem.known.fitted_patch`), which
  hardly changes the total power.

All terms are absolute values, so that errors do not cancel in the estimate.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.error.facets import boundary_facets, interface_facets
from tetlux.fem.error.layers import boundary_layers, interface_layers
from tetlux.fem.error.residual import (
    density_below_facets,
    lumping_error,
    nodal_averaging,
    recovered_gradient_difference,
    ripple_indicators,
    root_mean_square,
    subtract_patches,
)
from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.linear.solver import Solver
from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.operators.fitting import LayerFitting
from tetlux.fem.outcome.solution import Solution
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import map_in_threads
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.layers import are_layered, tops_of
from tetlux.meshing.tets.mesh import TetMesh

# Weight of the indicators of facets, whose errors partly cancel those of gradients. With it the estimate is 0.6 to 3
# times the true error on spheres, cylinders and slabs of 3 to 100 mean free paths, sources 0.005 to 10 below the
# surface, indices 1 to 1.5 and albedos 0.5 to 0.9999, and in the corners of boxes.
FACET_WEIGHT = 0.5
# Where light is deposited just below facets, it moves with them, and the errors of gradients and facets add up.
LIT_FACET_WEIGHT = 1.0
# In layers light varies with depth alone: the mean square of the difference of gradients from their average is a third
# of that at the corners.
LAYER_GRADIENT_WEIGHT = 0.4
# A bright spot is smaller than facets if its norm, where charges are fitted, is less than this share of that at nodes.
SMALL_SPOT = 0.5
# Exited power below this share of the incident power is rounding error of the linear solver.
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated errors of a solution.

    Attributes
    ----------
    exitance_indicators, power_indicators : (m,) ndarray
        Indicators of the tetrahedra; they sum to the relative errors of the exitance and of the total exited power.
    splits : (m,) ndarray of int
        How often a tetrahedron has to be split at once for its error in the exitance to become less.
    duals : (n, 2) ndarray
        The dual solutions of both; of several parts those of the last.
    of_heights : (2, m) ndarray
        What is due to the heights of layers in the indicators of both, and no split removes.
    """

    exitance_indicators: FloatArray
    power_indicators: FloatArray
    splits: IntArray
    duals: NumberArray
    of_heights: FloatArray

    @property
    def error(self) -> float:
        """Relative L2 error of the exitance over the surface."""
        return float(self.exitance_indicators.sum())

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
        The solution that `solution` is a part of, or `solution` itself: errors are relative to its exitance.
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
    norm, total = _norm_of_exitance(whole), float(areas @ np.abs(whole.exitance))
    if total <= ROUNDING * abs(whole.power.incident):
        # Where no light leaves, the exitance has no error.
        count = len(mesh.tetrahedra)
        no_duals = np.zeros((len(mesh.points), 2))
        nothing = np.zeros((2, count))
        return Estimate(nothing[0], nothing[1], np.ones(count, dtype=np.int64), no_duals, nothing)
    duals = solver.solve_to_low_accuracy(_dual_loads(mesh, coefficients, whole.exitance, norm, total)).x
    (indicators, power_indicators), of_heights = _weigh(solution, coefficients, duals, emission, inner, fitting, load)
    indicators += ripple_indicators(mesh, coefficients, load, norm)
    unresolved = _unresolved_indicators(solution, norm)
    splits = np.where(unresolved > indicators, _splits_to_resolve(solution), 1)
    return Estimate(indicators + unresolved, power_indicators, splits, duals, of_heights)


def weigh_residual(
    solution: Solution,
    coefficients: Coefficients,
    duals: NumberArray,
    emission: float | FloatArray = 0.0,
    inner: Sequence[Surface] = (),
) -> FloatArray:
    """Indicators of the tetrahedra, (k, m), by each of several dual solutions (n, k): see `estimate_error`."""
    return _weigh(solution, coefficients, duals, emission, inner)[0]


def _weigh(
    solution: Solution,
    coefficients: Coefficients,
    duals: NumberArray,
    emission: float | FloatArray = 0.0,
    inner: Sequence[Surface] = (),
    fitting: LayerFitting | None = None,
    load: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Indicators of the tetrahedra, (k, m), by each of several dual solutions (n, k), and what is due to heights."""
    mesh, mean = solution.mesh, nodal_averaging(solution.mesh)
    smooth, difference = subtract_patches(solution, mean)
    gradient_error = root_mean_square(difference)
    remainder, outward_flux = _remainder(solution)
    diffusion, scale = coefficients.diffusion, 1.0
    if fitting is not None:
        diffusion, scale = fitting.diffusion, fitting.absorption_scale[mesh.tetrahedra].min(axis=1) ** 2
    afar = 1.0 if load is None else _share_from_afar(mesh, coefficients, load, outward_flux)
    facet_weight = afar * FACET_WEIGHT + (1.0 - afar) * LIT_FACET_WEIGHT

    layered = are_layered(mesh, np.arange(len(mesh.tetrahedra)))
    gradient_error[layered] *= LAYER_GRADIENT_WEIGHT

    def indicators_for_dual(dual: NumberArray) -> tuple[FloatArray, FloatArray]:
        at_corners = dual[mesh.tetrahedra]
        indicators = (
            diffusion
            * mesh.volumes
            * gradient_error
            * root_mean_square(recovered_gradient_difference(mesh, mean, dual))
        )
        indicators += scale * np.abs(coefficients.sigma) * mesh.volumes * lumping_error(smooth, at_corners)
        of_heights = np.where(layered, indicators, 0.0)
        indicators += _boundary_lumping(mesh, coefficients, smooth, dual)
        if fitting is not None:
            indicators += boundary_layers(mesh, coefficients, fitting, smooth[mesh.boundary_cells], dual)
        values = remainder, outward_flux, dual
        indicators += facet_weight * boundary_facets(
            mesh, coefficients, solution.surface, values, float(indicators.sum()), scale * afar
        )
        indicators += interface_layers(mesh, coefficients, smooth, at_corners)
        indicators += FACET_WEIGHT * interface_facets(mesh, coefficients, inner, emission, (solution.fluence, dual))
        return indicators, of_heights

    found = np.array(map_in_threads(indicators_for_dual, list(duals.T)))
    return found[:, 0], found[:, 1]


def _share_from_afar(
    mesh: TetMesh, coefficients: Coefficients, load: FloatArray, outward_flux: NumberArray
) -> FloatArray:
    """At boundary cells, the share of the outward flux that does not come from light deposited just below, (m,)."""
    cells = mesh.boundary_cells
    # Below an area, light that decays over a mean free path leaves that much times its density at the surface.
    entering = density_below_facets(mesh, load) * 3.0 * at_cells(coefficients.diffusion, cells)
    if mesh.columns is not None:
        # Below layers all of it is known, however thick they are.
        columns = np.bincount(tops_of(mesh), load, minlength=len(load))[mesh.boundary_nodes]
        entering = np.maximum(entering, (columns / mesh.boundary_node_areas)[mesh.boundary_triangles].mean(axis=1))
    flux = np.abs(outward_flux[mesh.boundary_faces].mean(axis=1))
    share = np.ones(len(mesh.tetrahedra))
    np.minimum.at(share, cells, np.clip(1.0 - entering / np.maximum(flux, np.finfo(float).tiny), 0.0, 1.0))
    return share


def _dual_loads(
    mesh: TetMesh, coefficients: Coefficients, exitance: NumberArray, norm: float, total: float
) -> NumberArray:
    """Loads of the two duals, (n, 2): for the L2 error of the exitance, and for the error of the exited power."""
    loads = np.zeros((len(mesh.points), 2), exitance.dtype)
    robin, areas = boundary_condition_of(coefficients.outer).robin, mesh.boundary_node_areas
    loads[mesh.boundary_nodes, 0] = robin * areas * exitance.conj() / norm**2
    loads[mesh.boundary_nodes, 1] = robin * areas / total
    return loads


def _remainder(solution: Solution) -> tuple[NumberArray, NumberArray]:
    """Fluence less that of fitted charges, and its net flux out of the body, at the nodes, (n,) each."""
    mesh, remainder = solution.mesh, solution.fluence
    outward_flux = np.zeros_like(remainder)
    outward_flux[mesh.boundary_nodes] = solution.exitance - solution.transmitted_irradiance
    for patch in solution.patches:
        if isinstance(patch, FittedPatch):
            # At the border of the patch the mesh holds all of the fluence.
            subtracted, residual = patch.at_nodes, patch.residual_at_nodes
            if not patch.is_whole:
                subtracted, residual = subtracted.copy(), residual.copy()
                border = mesh.tetrahedra[~patch.cells]
                subtracted[border] = residual[border] = 0.0
            remainder = remainder - subtracted
            robin = boundary_condition_of(patch.charges.medium).robin
            outward_flux[mesh.boundary_nodes] -= robin * subtracted[mesh.boundary_nodes]
            outward_flux += residual
    return remainder, outward_flux


def _norm_of_exitance(solution: Solution) -> float:
    """L2 norm over the surface, W/unit.

    A bright spot that is smaller than the facets around it has several times too large a norm at the nodes, and errors
    relative to that would be too small. Where fitted charges are all that is subtracted, the norm is at most the sum of
    those of the charges of each light, at the points of their residual, and that of what they lack, at the nodes.
    """
    areas, nodes = solution.mesh.boundary_node_areas, solution.mesh.boundary_nodes
    at_nodes = float(np.sqrt(areas @ np.abs(solution.exitance) ** 2))
    fitted = [patch for patch in solution.patches if isinstance(patch, FittedPatch)]
    if not fitted or len(fitted) < len(solution.patches):
        return at_nodes
    remainder = solution.fluence[nodes] - sum(each.at_nodes[nodes] for each in fitted)
    lacking = solution.boundary_condition.exitance(remainder, solution.transmitted_irradiance)
    residuals = [each.residual for each in fitted]
    squares = [each.points.areas @ np.abs(each.exitance) ** 2 for each in residuals]
    resolved = float(np.sqrt(squares).sum() + np.sqrt(areas @ np.abs(lacking) ** 2))
    return resolved if resolved < SMALL_SPOT * at_nodes else at_nodes


def _unresolved_indicators(solution: Solution, norm: float) -> FloatArray:
    """Indicators of the residuals of fitted charges that facets do not resolve, (m,), over the norm of the exitance."""
    mesh = solution.mesh
    square = np.zeros(len(mesh.boundary_faces))
    for patch in solution.patches:
        if isinstance(patch, FittedPatch):
            square += patch.unseen()
    indicators = np.bincount(mesh.boundary_cells, square, minlength=len(mesh.tetrahedra))
    total = float(np.sqrt(indicators.sum()))
    return np.asarray(indicators / (total * norm if total > 0 else 1.0), dtype=np.float64)


def _splits_to_resolve(solution: Solution) -> IntArray:
    """How often tetrahedra have to be split until their facets resolve the residuals of fitted charges, (m,)."""
    mesh = solution.mesh
    splits = np.ones(len(mesh.tetrahedra), dtype=np.int64)
    for patch in solution.patches:
        if isinstance(patch, FittedPatch):
            np.maximum.at(splits, mesh.boundary_cells, patch.splits_to_see())
    return splits


def _boundary_lumping(mesh: TetMesh, coefficients: Coefficients, smooth: NumberArray, dual: NumberArray) -> FloatArray:
    """Indicators of the error of lumping the boundary term, (m,)."""
    cells, faces = mesh.boundary_cells, mesh.boundary_faces
    corners = (mesh.tetrahedra[cells][:, None, :] == faces[:, :, None]).argmax(axis=2)
    on_faces = lumping_error(np.take_along_axis(smooth[cells], corners, axis=1), dual[faces])
    weights = boundary_condition_of(coefficients.outer).robin * mesh.boundary_areas * on_faces
    return np.asarray(np.bincount(cells, weights, minlength=len(mesh.tetrahedra)), dtype=np.float64)
