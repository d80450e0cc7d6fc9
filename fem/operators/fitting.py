"""Exponential fitting: coefficients for layers along the boundary that are thinner than their tetrahedra.

Under diffuse light, and where a body emits light, the fluence falls off from the boundary like ``e^{-k d}``. Let h be
the spacing of the nodes along the normal. Linear elements give a flux of ``D k sqrt(1 + (k h/2)²)`` times the fluence
at the boundary instead of ``D k``, which is any number of times too much where k h is large. In one dimension, ::

    D k h / sinh(k h)    and    sigma_a tanh(k h/2) / (k h/2)

in place of D and sigma_a make the values at the nodes exact (exponential fitting: Roos, Stynes & Tobiska, Robust
Numerical Methods for Singularly Perturbed Differential Equations, 2nd ed., I.2.1.3). Here tetrahedra that touch the
boundary have the first, and nodes on the boundary have the second in their lumped mass. As k h goes to zero both differ
from D and sigma_a by its square, like the error of linear elements itself.

Under diffuse light, on balls of radius 3 to 100 mean free paths with 550 nodes, reduced albedos .09 to .99, the mean
exitance is within 1 % of the light that falls on them and its L2 error within 4 %; without it, up to all of it.
"""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh

# Layers of smaller k h are not fitted: on balls the error of the exitance is then the same without.
SMALLEST_FITTED_KH = 0.5
# k h is clipped to this range: at the lower end the quotients are 1 to rounding, at the upper one sinh would overflow.
SMALLEST_KH, LARGEST_KH = 1e-6, 600.0


@dataclass(frozen=True, eq=False)
class LayerFitting:
    """Coefficients of the matrix where they are not the medium's own.

    Attributes
    ----------
    diffusion : (m,) ndarray
        D of each tetrahedron, unit.
    absorption_scale : (n,) ndarray
        The factor on the absorption in the lumped mass of each node.
    kh : (n,) ndarray
        k h at nodes on the boundary, and 0 at others.
    """

    diffusion: FloatArray
    absorption_scale: FloatArray
    kh: FloatArray

    __repr__ = one_line


def fitting_of(mesh: TetMesh, coefficients: Coefficients) -> LayerFitting | None:
    """Coefficients that fit layers along the boundary; None if k h is small everywhere on it."""
    cells = mesh.boundary_cells
    diffusion, sigma_a = (at_cells(value, cells) for value in (coefficients.diffusion, coefficients.sigma_a))
    areas, nodes = mesh.boundary_node_areas, mesh.boundary_nodes
    # Nodes on the boundary have half of h times their area as their volume.
    spacing = 2.0 * mesh.node_volumes[nodes] / areas
    decay = mesh.to_boundary_nodes(np.sqrt(sigma_a / diffusion) * mesh.boundary_areas) / areas
    at_boundary = decay * spacing
    if at_boundary.max() <= SMALLEST_FITTED_KH:
        return None
    kh, scale = np.zeros(len(mesh.points)), np.ones(len(mesh.points))
    kh[nodes] = np.maximum(at_boundary, SMALLEST_KH)
    scale[nodes] = np.tanh(0.5 * kh[nodes]) / (0.5 * kh[nodes])
    corners = kh[mesh.tetrahedra]
    touching = np.count_nonzero(corners, axis=1)
    mean = np.minimum(corners.sum(axis=1) / np.maximum(touching, 1), LARGEST_KH)
    share = np.divide(mean, np.sinh(mean), out=np.ones(len(mean)), where=touching > 0)
    return LayerFitting(coefficients.diffusion * share, scale, kh)
