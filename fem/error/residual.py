"""The dual-weighted residual within tetrahedra: the error of the gradient, of lumping, and the ripple of the exitance.

In a tetrahedron K the error of the gradient is estimated by the difference between the gradient and its average R over
the nodes (Zienkiewicz & Zhu 1987), for the fluence and for the dual z alike::

    eta_K = D ∫_K |grad phi_h - R grad phi_h| |grad z_h - R grad z_h|
          + sigma_a ∫_K (lumping of phi_h z_h)  +  1/(2A) ∮ (lumping of phi_h z_h)

Where power is deposited along the boundary, as by a broad beam, the exitance ripples from node to node with the size h
of tetrahedra. The ripple does not change the total exited power, and duals do not show it. It is proportional to the
density q of the deposited power, and its square is integrated over the boundary::

    ripple² = RIPPLE_FACTOR² ∮ (h² q / (2A D))²
"""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_array

from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.outcome.solution import Solution
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.tets.layers import are_layered
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.regions import corner_groups

# Factor of the ripple. With it the estimate is 0.8 to 2.6 times the true error on spheres of radius 2 to 10 in a beam,
# at reduced albedos of 0.8 to 0.99, for g from 0 to 0.9; without the ripple it is 0.25 to 1.1 times.
RIPPLE_FACTOR = 1.0 / 30.0
# Over how many mean free paths the ripple of flat tetrahedra reaches along the surface. With it the estimate is 0.85 to
# 1.6 times the true error on meshes with layers, for balls of 7 to 300 mean free paths at reduced albedos of 0.5 to
# 0.9999, and 0.65 to 0.8 times for a torus, a cylinder and the hare.
RIPPLE_REACH = 0.8

# From vectors of tetrahedra (m, 3) to their averages at the corners, (m, 4, 3).
Averaging = Callable[[NumberArray], NumberArray]


def subtract_patches(solution: Solution, mean: Averaging) -> tuple[NumberArray, NumberArray]:
    """Fluence less that of patches at corners, (m, 4), and its `recovered_gradient_difference`, (m, 4, 3)."""
    mesh, fluence = solution.mesh, solution.fluence
    difference = recovered_gradient_difference(mesh, mean, fluence)
    smooth = fluence[mesh.tetrahedra]
    for patch in solution.patches:
        inside = patch.cells[:, None]
        difference -= inside[..., None] * recovered_gradient_difference(mesh, mean, patch.at_nodes)
        smooth = smooth - inside * patch.at_nodes[mesh.tetrahedra]
    return smooth, difference


def nodal_averaging(mesh: TetMesh) -> Averaging:
    """The average of vectors of tetrahedra over those around each corner, weighted by volume.

    At a node between regions, the average is taken over each region separately.
    """
    groups = corner_groups(mesh)
    starts = np.arange(0, groups.size + 1, 4)
    shape = (int(groups.max()) + 1, len(groups))
    around = csc_array((np.repeat(mesh.volumes, 4), groups.reshape(-1), starts), shape=shape)
    volumes: FloatArray = np.asarray(around.sum(axis=1))
    return lambda vectors: (np.asarray(around @ vectors) / volumes[:, None]).take(groups, axis=0)


def recovered_gradient_difference(mesh: TetMesh, mean: Averaging, values: NumberArray) -> NumberArray:
    """The averaged gradient less the gradient, at the corners of each tetrahedron, (m, 4, 3), by values at nodes (n,).

    The gradient is not averaged across an interface, where it jumps.
    """
    slope = np.einsum("mij,mi->mj", mesh.hat_gradients, values[mesh.tetrahedra])
    difference = mean(slope)
    difference -= slope[:, None]
    return difference


def root_mean_square(vectors: NumberArray) -> FloatArray:
    """Root mean square modulus over the corners of vectors (m, 4, 3), (m,)."""
    return np.asarray(np.sqrt(np.einsum("mij,mij->m", vectors, vectors.conj()).real / 4.0))


def lumping_error(first: NumberArray, second: NumberArray) -> FloatArray:
    """Error of the lumped mean product of two linear functions, by their values at corners (m, c), (m,)."""
    corners = first.shape[1]
    # The lumped mean is sum(a b)/n, the exact one (sum(a b) + sum(a) sum(b))/(n (n + 1)).
    sums = np.einsum("mi->m", first) * np.einsum("mi->m", second)
    return np.asarray(np.abs(corners * np.einsum("mi,mi->m", first, second) - sums) / (corners * (corners + 1)))


def density_below_facets(mesh: TetMesh, load: FloatArray) -> FloatArray:
    """Density of the power deposited in the tetrahedron below each boundary triangle, (f,), by the load at nodes (n,).

    It is the least at the four nodes: others may include a point source, or light through the boundary.
    """
    return np.asarray((np.abs(load) / mesh.node_volumes)[mesh.tetrahedra[mesh.boundary_cells]].min(axis=1))


def ripple_indicators(mesh: TetMesh, coefficients: Coefficients, load: FloatArray, norm: float) -> FloatArray:
    """Indicators of the ripple of the exitance, (m,), by the load at the nodes (n,) and the norm of the exitance."""
    cells = mesh.boundary_cells
    # The edge of a regular tetrahedron of the same height. Of flat tetrahedra the ripple is proportional to the height,
    # of others to the square of the edge.
    edge = np.sqrt(1.5) * 3.0 * mesh.volumes[cells] / mesh.boundary_areas
    diffusion = at_cells(coefficients.diffusion, cells)
    along = np.minimum(1.5 * np.sqrt(mesh.boundary_areas), RIPPLE_REACH * 3.0 * diffusion)
    square = edge * np.maximum(edge, along)
    robin = boundary_condition_of(coefficients.outer).robin
    ripple = RIPPLE_FACTOR * square * density_below_facets(mesh, load) * robin / diffusion
    # Layers have the light of prisms, which does not ripple.
    ripple[are_layered(mesh, cells)] = 0.0
    indicators = np.bincount(cells, mesh.boundary_areas * ripple**2, minlength=len(mesh.tetrahedra))
    total = float(np.sqrt(indicators.sum()))
    return np.asarray(indicators / (total * norm if total > 0 else 1.0), dtype=np.float64)
