"""The error of flat facets in place of a curved boundary or interface.

A boundary that lies a distance delta away adds the shape derivative of the weak form::

    ∮ |delta| [ D |grad_t phi . grad_t z| + sigma_a phi z + |kappa - 1/zb| J z ]

with J the net outward flux and kappa twice the mean curvature. An interface between regions adds, with jumps [.]
across it::

    ∮ |delta| [ |[D]| |grad_t phi . grad_t z| + |[1/D]| |D dphi/dn D dz/dn| + |[sigma_a]| phi z + |[Q0]| z ]
"""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides, triangle_areas
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.queries import heights
from tetlux.meshing.tets.regions import owners

# Facets are not measured if together they can add at most this share of all other indicators.
NEGLIGIBLE_SHARE = 0.02
# Largest distance of a facet from a smooth surface, over its longest edge.
LARGEST_DISTANCE_RATIO = 0.2
# A facet farther from the surface than this, over its longest edge, is no chord of a smooth surface.
LARGEST_CHORD_RATIO = 0.1
# Mean distance of a paraboloid from a triangle through three of its points, over the distance at the triangle's middle.
MEAN_DISTANCE_RATIO = 0.75


def boundary_facets(
    mesh: TetMesh,
    coefficients: Coefficients,
    surface: Surface,
    values: tuple[NumberArray, NumberArray, NumberArray],
    others: float,
    absorption_scale: float | FloatArray,
) -> FloatArray:
    """Indicators of the error of flat facets of the boundary, (m,).

    Parameters
    ----------
    values : tuple of three (n,) ndarray
        At the nodes: the fluence, the net outward flux, and the dual.
    others : float
        The sum of all other indicators; facets that can add little to it are not measured.
    absorption_scale : float or (m,) ndarray
        Scale of the terms other than curvature: a fitted layer moves with the facets, and depends on their curvature
        only.
    """
    fluence, outward_flux, dual = values
    faces, cells = mesh.boundary_faces, mesh.boundary_cells
    hats, nodes = mesh.hat_gradients[cells], mesh.tetrahedra[cells]
    slopes = [np.einsum("mij,mi->mj", hats, at_nodes[nodes]) for at_nodes in (fluence, dual)]
    normals, areas = mesh.surface.normals, mesh.boundary_areas
    tangential = [s - np.einsum("ij,ij->i", s, normals)[:, None] * normals for s in slopes]
    product = np.abs(fluence[faces].mean(axis=1) * dual[faces].mean(axis=1))
    outflow = np.abs(outward_flux[faces].mean(axis=1) * dual[faces].mean(axis=1))
    diffusion, sigma = (at_cells(value, cells) for value in (coefficients.diffusion, np.abs(coefficients.sigma)))
    extrapolation = diffusion / boundary_condition_of(coefficients.outer).robin
    scale = at_cells(absorption_scale, cells)
    along = diffusion * np.abs(np.einsum("ij,ij->i", *tangential)) + scale * sigma * product
    corners = mesh.points[faces]
    length = longest_sides(corners)
    most = LARGEST_DISTANCE_RATIO * length * areas * (along + scale * outflow / extrapolation)
    order = np.argsort(most)
    measured = order[np.cumsum(most[order]) > NEGLIGIBLE_SHARE * others]
    distance = mesh.boundary_distances(surface, measured)
    # A sphere through the corners of an equilateral triangle is h²/6R above its middle. A facet farther away has a
    # node that could not be moved onto the surface, and its distance does not depend on the curvature.
    curvature = np.where(
        distance < LARGEST_CHORD_RATIO * length[measured], 2.0 * 6.0 * distance / length[measured] ** 2, 0.0
    )
    bent = np.abs(curvature - (scale / extrapolation)[measured]) * outflow[measured]
    indicators = MEAN_DISTANCE_RATIO * distance * areas[measured] * (along[measured] + bent)
    return np.asarray(np.bincount(cells[measured], indicators, minlength=len(mesh.tetrahedra)), dtype=np.float64)


def interface_facets(
    mesh: TetMesh,
    coefficients: Coefficients,
    inner: Sequence[Surface],
    emission: float | FloatArray,
    values: tuple[NumberArray, NumberArray],
) -> FloatArray:
    """Indicators of the error of flat facets between regions, (m,), by the fluence and the dual at the nodes."""
    total = np.zeros(len(mesh.tetrahedra))
    if len(inner) == 0:
        return total
    faces, pairs, cells = mesh.interfaces
    distance = _interface_distances(mesh.points[faces].mean(axis=1), owners(pairs, inner), inner)
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
    indicators = 0.5 * MEAN_DISTANCE_RATIO * distance * areas * bent
    for side in cells.T:
        total += np.bincount(side, indicators, minlength=len(total))
    return total


def _interface_distances(middles: FloatArray, owner: IntArray, inner: Sequence[Surface]) -> FloatArray:
    """Distances of points (f, 3) from the surfaces of the regions (f,) that own them, (f,)."""
    distances = np.zeros(len(middles))
    for region in np.unique(owner):
        own = owner == region
        distances[own] = heights(inner[region - 1], middles[own])
    return distances
