"""How wrong the exitance is, and which tetrahedra make it so.

The dual-weighted residual (Becker & Rannacher 2001): the system is solved once more with the exitance itself as
its load, and that solution z says how much an error made somewhere shows at the surface where the light leaves; a
second one, with an even load, says the same of all the power that leaves. In
a tetrahedron K the error of the gradient is what is left when the gradient is averaged over the nodes and taken off
(Zienkiewicz & Zhu 1987), for the fluence and for z alike::

    eta_K = D ∫_K |grad phi_h - R grad phi_h| |grad z_h - R grad z_h|
          + sigma_a ∫_K (lumping of phi_h z_h)  +  1/(2A) ∮ (lumping of phi_h z_h)

Flat facets instead of a curved boundary, a distance delta away, add the shape derivative of the weak form::

    ∮ |delta| [ D |grad_t phi . grad_t z| + sigma_a phi z + |kappa - 1/zb| J z ]

with J the net flux that leaves and kappa twice the mean curvature; at interfaces between regions, with jumps [.] across
them, it is::

    ∮ |delta| [ |[D]| |grad_t phi . grad_t z| + |[1/D]| |D dphi/dn D dz/dn| + |[sigma_a]| phi z + |[Q0]| z ]

Where light fades within less than the height of the boundary's tetrahedra, neither gradient shows it. What
`tetlux.fem.operators.fitting` leaves over there goes with the steps of fluence across these tetrahedra and x = k h::

    ∮ D k LAYERS x²/(1 + x²)^(3/2) |phi step| z

Layers along interfaces are not fitted; they add ``∮ D k s (s - 1) |phi step| |z step|`` with s = sqrt(1 + (k h/2)²).

Sums of moduli, so errors that cancel are counted.

Where light is deposited all along the boundary, as that of a beam is, the exitance ripples from node to node as the
tetrahedra do. To what leaves in sum that adds nothing, and no dual shows it; it goes with the density q of what is
deposited, and its square is integrated over the boundary::

    ripple² = RIPPLE² ∮ (h² q / (2A D))²
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array

from tetlux.fem.linear.solver import Solver
from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.operators.fitting import Fitting
from tetlux.fem.outcome.solution import Solution
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.blocks import at_once
from tetlux.meshing.surface.surface import Surface, longest_sides, triangle_areas
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.regions import owners

# Facets of a round body err to one side, and partly against the gradients: with half of their sum the estimate is 0.6
# to 3 times the true error on spheres, cylinders and slabs of 3 to 100 mean free paths, sources 0.005 to 10 below the
# surface, indices 1 to 1.5 and albedos 0.5 to 0.9999, and in the corners of boxes.
FACETS = 0.5
# With this the estimate is 0.8 to 2.6 times the true error on spheres of radius 2 to 10 in a beam, at reduced albedos
# of 0.8 to 0.99, for g from 0 to 0.9; without it it would be 0.25 to 1.1 times.
RIPPLE = 1.0 / 30.0
# Under diffuse light, on balls of 3 to 100 mean free paths, reduced albedos .09 to .99 and indices 1 and 1.4, the
# estimate is 1.1 to 3.5 times the error with this where k h is at most 3, and 4 to 11 times where it is more.
LAYERS = 0.25
# Facets whose distance from the surface could add no more than this share of the rest are not measured: a facet's
# distance is at most this share of its longest edge, where the surface is smooth.
NOT_MEASURED, FARTHEST = 0.02, 0.2
# What leaves of this share of the light is what the solver's residual makes of nothing.
ROUNDING = 1e-12
# A facet that is farther than this share of its longest edge from the surface does not just cut a curve short.
BULGE = 0.1
# The mean distance of a paraboloid from a triangle through three of its points, over that at the middle.
MEAN_OVER_MIDDLE = 0.75


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated errors of a solution.

    Attributes
    ----------
    shares, power_shares : (m,) ndarray
        What each tetrahedron adds to the errors.
    """

    shares: FloatArray
    power_shares: FloatArray

    @property
    def error(self) -> float:
        """Relative L2 error of the exitance over the surface."""
        return float(self.shares.sum())

    __repr__ = one_line


def estimated(
    solution: Solution,
    whole: Solution,
    coefficients: Coefficients,
    solver: Solver,
    load: FloatArray,
    emission: float | FloatArray = 0.0,
    inner: Sequence[Surface] = (),
    fitting: Fitting | None = None,
) -> Estimate:
    """Estimate the error of a solution, or of a part of one.

    Parameters
    ----------
    solution : Solution
    whole : Solution
        That which it is part of, or itself: its exitance is what errors are errors of.
    coefficients : Coefficients
        Of its mesh.
    solver : Solver
        Of its system matrix.
    load : (n,) ndarray
        What the lights put on the nodes, W.
    emission : float or (m,) ndarray
        Of the volume, W/unit³.
    inner : sequence of Surface
        Of the mesh's regions, if there are any.
    fitting : Fitting, optional
        Of the matrix.

    Returns
    -------
    Estimate
    """
    mesh, surface = solution.mesh, solution.surface
    fluence, exitance, patches = solution.fluence, whole.exitance, solution.patches
    areas = mesh.boundary_node_areas
    size, total = float(np.sqrt(areas @ exitance**2)), float(areas @ np.abs(exitance))
    if total <= ROUNDING * whole.power.incident:
        # Where no light leaves, there is nothing to be wrong about.
        return Estimate(np.zeros(len(mesh.tetrahedra)), np.zeros(len(mesh.tetrahedra)))
    loads = np.zeros((len(mesh.points), 2))
    robin = coefficients.escape
    loads[mesh.boundary_nodes, 0] = robin * areas * exitance / size**2
    loads[mesh.boundary_nodes, 1] = robin * areas / total
    duals = solver.roughly(loads).x

    diffusion, kept = coefficients.diffusion, 1.0
    if fitting is not None:
        diffusion, kept = fitting.diffusion, fitting.kept[mesh.tetrahedra].min(axis=1) ** 2
    mean = _averaging(mesh)
    rough = _roughness(mesh, mean, fluence)
    smooth = fluence[mesh.tetrahedra]
    for patch in patches:
        inside = patch.cells[:, None]
        rough -= inside[..., None] * _roughness(mesh, mean, patch.at_nodes)
        smooth = smooth - inside * patch.at_nodes[mesh.tetrahedra]
    slope_gap = _size(rough)
    corners = (mesh.tetrahedra[mesh.boundary_cells][:, None, :] == mesh.boundary_faces[:, :, None]).argmax(axis=2)
    leaving = np.zeros(len(mesh.points))
    leaving[mesh.boundary_nodes] = solution.exitance - solution.transmitted_irradiance

    def shares_by(dual: FloatArray) -> FloatArray:
        shares = diffusion * mesh.volumes * slope_gap * _size(_roughness(mesh, mean, dual))
        shares += kept * coefficients.sigma_a * mesh.volumes * _lumping(smooth, dual[mesh.tetrahedra])
        of_faces = _lumping(np.take_along_axis(smooth[mesh.boundary_cells], corners, axis=1), dual[mesh.boundary_faces])
        shares += np.bincount(mesh.boundary_cells, robin * mesh.boundary_areas * of_faces, minlength=len(shares))
        if fitting is not None:
            shares += _of_layers(mesh, coefficients, fitting, smooth[mesh.boundary_cells], dual)
        shares += FACETS * _of_facets(mesh, coefficients, surface, (fluence, leaving, dual), float(shares.sum()), kept)
        shares += _of_inner_layers(mesh, coefficients, smooth, dual[mesh.tetrahedra])
        return shares + FACETS * _of_interfaces(mesh, coefficients, inner, emission, (fluence, dual))

    shares, power_shares = at_once(shares_by, list(duals.T))
    return Estimate(shares + _ripple(mesh, coefficients, load, size), power_shares)


def _ripple(mesh: TetMesh, coefficients: Coefficients, load: FloatArray, size: float) -> FloatArray:
    """What the ripple of the exitance adds to its error, (m,), by what is deposited and the norm of the exitance."""
    cells = mesh.boundary_cells
    # Of a cell's nodes that with the least: at the others may be a point, or what entered through the boundary.
    density = (np.abs(load) / mesh.node_volumes)[mesh.tetrahedra[cells]].min(axis=1)
    # The edge of a regular tetrahedron of this volume, squared.
    square = (6.0 * np.sqrt(2.0) * mesh.volumes[cells]) ** (2.0 / 3.0)
    height = RIPPLE * square * density * coefficients.escape / at_cells(coefficients.diffusion, cells)
    shares = np.bincount(cells, mesh.boundary_areas * height**2, minlength=len(mesh.tetrahedra))
    total = float(np.sqrt(shares.sum()))
    return np.asarray(shares / (total * size if total > 0 else 1.0), dtype=np.float64)


def _size(rough: FloatArray) -> FloatArray:
    """Root mean square over the corners of vectors (m, 4, 3), (m,)."""
    return np.asarray(np.sqrt(np.einsum("mij,mij->m", rough, rough) / 4.0))


def _averaging(mesh: TetMesh) -> Callable[[FloatArray], FloatArray]:
    """From vectors of tetrahedra (m, 3) to their means by volume around each of the corners, (m, 4, 3).

    At a node between regions each of these has a mean of its own.
    """
    groups = mesh.tetrahedra
    if mesh.regions.any():
        first = int(mesh.regions.min())
        keys = groups * (int(mesh.regions.max()) - first + 1) + (mesh.regions[:, None] - first)
        groups = np.unique(keys, return_inverse=True)[1].reshape(keys.shape)
    starts = np.arange(0, groups.size + 1, 4)
    shape = (int(groups.max()) + 1, len(groups))
    around = csc_array((np.repeat(mesh.volumes, 4), groups.reshape(-1), starts), shape=shape)
    volumes: FloatArray = np.asarray(around.sum(axis=1))
    return lambda vectors: (np.asarray(around @ vectors) / volumes[:, None]).take(groups, axis=0)


def _roughness(mesh: TetMesh, mean: Callable[[FloatArray], FloatArray], values: FloatArray) -> FloatArray:
    """What averaging over the nodes takes off a gradient, at the corners of each tetrahedron, (m, 4, 3).

    Across an interface, where the gradient jumps, it is not averaged.
    """
    slope = np.einsum("mij,mi->mj", mesh.hat_gradients, values[mesh.tetrahedra])
    rough = mean(slope)
    rough -= slope[:, None]
    return rough


def _lumping(first: FloatArray, second: FloatArray) -> FloatArray:
    """What lumping changes of the mean product of two linear functions, by their values at the corners, (m,)."""
    corners = first.shape[1]
    # The one is sum(a b)/n, and the other (sum(a b) + sum(a) sum(b))/(n (n + 1)).
    sums = np.einsum("mi->m", first) * np.einsum("mi->m", second)
    return np.asarray(np.abs(corners * np.einsum("mi,mi->m", first, second) - sums) / (corners * (corners + 1)))


def _step_across(mesh: TetMesh, cells: IntArray, faces: IntArray, values: FloatArray) -> FloatArray:
    """How far values at the corners of tetrahedra (f, 4) go from a face of each (f, 3) to the node opposite, (f,)."""
    on_face = (mesh.tetrahedra[cells][:, :, None] == faces[:, None, :]).any(axis=2)
    return np.asarray(np.abs(np.where(on_face, values / 3.0, -values).sum(axis=1)))


def _of_layers(
    mesh: TetMesh, coefficients: Coefficients, fitting: Fitting, smooth: FloatArray, dual: FloatArray
) -> FloatArray:
    """What is left of the error of a layer along the boundary that is thinner than its tetrahedra, (m,).

    By the fluence at the corners of the boundary's tetrahedra, (f, 4), and the dual at the nodes.
    """
    cells, faces = mesh.boundary_cells, mesh.boundary_faces
    diffusion, sigma_a = (at_cells(value, cells) for value in (coefficients.diffusion, coefficients.sigma_a))
    across = fitting.across[faces].mean(axis=1)
    step = _step_across(mesh, cells, faces, smooth)
    added = LAYERS * across**2 / (1.0 + across**2) ** 1.5 * np.sqrt(diffusion * sigma_a)
    added *= mesh.boundary_areas * step * np.abs(dual[faces].mean(axis=1))
    return np.asarray(np.bincount(cells, added, minlength=len(mesh.tetrahedra)), dtype=np.float64)


def _of_inner_layers(mesh: TetMesh, coefficients: Coefficients, smooth: FloatArray, dual: FloatArray) -> FloatArray:
    """What layers along interfaces add that are thinner than their tetrahedra, (m,), by values at all corners (m, 4).

    They are not fitted, and draw ``D k sqrt(1 + (k h/2)²)`` times the fluence from the interface instead of ``D k``,
    which makes the dual there too faint by as much.
    """
    added = np.zeros(len(mesh.tetrahedra))
    if not mesh.regions.any():
        return added
    faces, _, cells = mesh.interfaces
    _, areas = triangle_areas(mesh.points, faces)
    for side in cells.T:
        diffusion, sigma_a = (at_cells(value, side) for value in (coefficients.diffusion, coefficients.sigma_a))
        k = np.sqrt(sigma_a / diffusion)
        over = np.sqrt(1.0 + (0.5 * k * 3.0 * mesh.volumes[side] / areas) ** 2)
        first, second = (_step_across(mesh, side, faces, values[side]) for values in (smooth, dual))
        shares = diffusion * k * (over - 1.0) * over * areas * first * second
        added += np.bincount(side, shares, minlength=len(added))
    return added


def _of_facets(
    mesh: TetMesh,
    coefficients: Coefficients,
    surface: Surface,
    values: tuple[FloatArray, FloatArray, FloatArray],
    rest: float,
    kept: float | FloatArray,
) -> FloatArray:
    """What flat facets add, (m,), by the fluence, the net flux that leaves, and the dual at the nodes.

    A layer as thin as fitting has it moves with the facets, and only their bending matters to it: so much of the rest
    is kept.
    """
    fluence, leaving, dual = values
    faces, cells = mesh.boundary_faces, mesh.boundary_cells
    hats, nodes = mesh.hat_gradients[cells], mesh.tetrahedra[cells]
    slopes = [np.einsum("mij,mi->mj", hats, at_nodes[nodes]) for at_nodes in (fluence, dual)]
    normals, areas = mesh.surface.normals, mesh.boundary_areas
    tangential = [s - np.einsum("ij,ij->i", s, normals)[:, None] * normals for s in slopes]
    product = np.abs(fluence[faces].mean(axis=1) * dual[faces].mean(axis=1))
    outflow = np.abs(leaving[faces].mean(axis=1) * dual[faces].mean(axis=1))
    diffusion, sigma_a = (at_cells(value, cells) for value in (coefficients.diffusion, coefficients.sigma_a))
    extrapolation = diffusion / coefficients.escape
    thick = at_cells(kept, cells)
    along = diffusion * np.abs(np.einsum("ij,ij->i", *tangential)) + thick * sigma_a * product
    corners = mesh.points[faces]
    length = longest_sides(corners)
    most = FARTHEST * length * areas * (along + thick * outflow / extrapolation)
    order = np.argsort(most)
    measured = order[np.cumsum(most[order]) > NOT_MEASURED * rest]
    distance = mesh.boundary_distances(surface, measured)
    # A sphere through the corners of an equilateral triangle stands h²/6R above its middle. What is farther is a node
    # that could not be moved onto the surface, and tells nothing of its curvature.
    curvature = np.where(distance < BULGE * length[measured], 2.0 * 6.0 * distance / length[measured] ** 2, 0.0)
    bent = np.abs(curvature - (thick / extrapolation)[measured]) * outflow[measured]
    added = MEAN_OVER_MIDDLE * distance * areas[measured] * (along[measured] + bent)
    return np.asarray(np.bincount(cells[measured], added, minlength=len(mesh.tetrahedra)), dtype=np.float64)


def _of_interfaces(
    mesh: TetMesh,
    coefficients: Coefficients,
    inner: Sequence[Surface],
    emission: float | FloatArray,
    values: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """What flat facets between regions add, (m,), by the fluence and the dual at the nodes."""
    added = np.zeros(len(mesh.tetrahedra))
    if len(inner) == 0:
        return added
    faces, pairs, cells = mesh.interfaces
    corners = mesh.points[faces]
    middles, owner = corners.mean(axis=1), owners(pairs, inner)
    distance = np.zeros(len(faces))
    for region in np.unique(owner):
        mine = owner == region
        distance[mine] = np.linalg.norm(inner[region - 1].project(middles[mine])[0] - middles[mine], axis=1)
    normals, areas = triangle_areas(mesh.points, faces)
    diffusion, sigma_a, density = (
        np.column_stack([at_cells(value, side) for side in cells.T])
        for value in (coefficients.diffusion, coefficients.sigma_a, emission)
    )
    means, flows, tangents = [], [], []
    for at_nodes in values:
        slopes = np.einsum("fsij,fsi->fsj", mesh.hat_gradients[cells], at_nodes[mesh.tetrahedra[cells]])
        across = np.einsum("fsj,fj->fs", slopes, normals)
        means.append(at_nodes[faces].mean(axis=1))
        flows.append((diffusion * across).mean(axis=1))
        tangents.append((slopes - across[..., None] * normals[:, None]).mean(axis=1))
    jumps = [np.abs(np.diff(each, axis=1)[:, 0]) for each in (diffusion, 1.0 / diffusion, sigma_a, density)]
    bent = jumps[0] * np.abs(np.einsum("fj,fj->f", *tangents)) + jumps[1] * np.abs(flows[0] * flows[1])
    bent += jumps[2] * np.abs(means[0] * means[1]) + jumps[3] * np.abs(means[1])
    shares = 0.5 * MEAN_OVER_MIDDLE * distance * areas * bent
    for side in cells.T:
        added += np.bincount(side, shares, minlength=len(added))
    return added
