"""The error of layers in which light decays within one tetrahedron, so that averaged gradients do not show it.

Along the boundary, the error that `tetlux.fem.operators.fitting` leaves depends on the change of the fluence across
these tetrahedra ("step") and on x = k h::

    ∮ D k LAYER_WEIGHT x²/(1 + x²)^(3/2) |phi step| z

Layers along interfaces are not fitted. Linear elements give a flux into them of ``D k s`` times the fluence instead of
``D k``, with s = sqrt(1 + (k h/2)²), and a dual that is too small by the same factor. The indicators are::

    ∮ D k s (s - 1) |phi step| |z step|
"""

import numpy as np

from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.operators.fitting import LayerFitting
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray
from tetlux.meshing.surface.triangles import triangle_areas
from tetlux.meshing.tets.mesh import TetMesh

# Weight of the indicators of boundary layers. With it the estimate is 1.1 to 3.5 times the true error where k h is at
# most 3, and 4 to 11 times where it is more, under diffuse light on balls of 3 to 100 mean free paths, reduced albedos
# .09 to .99 and indices 1 and 1.4.
LAYER_WEIGHT = 0.25


def boundary_layers(
    mesh: TetMesh, coefficients: Coefficients, fitting: LayerFitting, smooth: FloatArray, dual: FloatArray
) -> FloatArray:
    """Indicators of the error of layers along the boundary, (m,).

    `smooth` is the fluence at the corners of the tetrahedra at the boundary, (f, 4); `dual` is given at the nodes,
    (n,).
    """
    cells, faces = mesh.boundary_cells, mesh.boundary_faces
    diffusion, sigma_a = (at_cells(value, cells) for value in (coefficients.diffusion, coefficients.sigma_a))
    across = fitting.kh[faces].mean(axis=1)
    step = _step_across(mesh, cells, faces, smooth)
    indicators = LAYER_WEIGHT * across**2 / (1.0 + across**2) ** 1.5 * np.sqrt(diffusion * sigma_a)
    indicators *= mesh.boundary_areas * step * np.abs(dual[faces].mean(axis=1))
    return np.asarray(np.bincount(cells, indicators, minlength=len(mesh.tetrahedra)), dtype=np.float64)


def interface_layers(mesh: TetMesh, coefficients: Coefficients, smooth: NumberArray, dual: NumberArray) -> FloatArray:
    """Indicators of the error of layers along interfaces, (m,), by fluence and dual at corners, (m, 4) each."""
    total = np.zeros(len(mesh.tetrahedra))
    if not mesh.regions.any():
        return total
    faces, _, cells = mesh.interfaces
    _, areas = triangle_areas(mesh.points, faces)
    for side in cells.T:
        diffusion, k = (at_cells(value, side) for value in (coefficients.diffusion, coefficients.decay))
        over = np.sqrt(1.0 + (0.5 * k * 3.0 * mesh.volumes[side] / areas) ** 2)
        first, second = (_step_across(mesh, side, faces, values[side]) for values in (smooth, dual))
        indicators = diffusion * k * (over - 1.0) * over * areas * first * second
        total += np.bincount(side, indicators, minlength=len(total))
    return total


def _step_across(mesh: TetMesh, cells: IntArray, faces: IntArray, values: NumberArray) -> FloatArray:
    """Change of values at corners of tetrahedra (f, 4) from the mean on a face (f, 3) to the opposite corner, (f,)."""
    on_face = (mesh.tetrahedra[cells][:, :, None] == faces[:, None, :]).any(axis=2)
    return np.asarray(np.abs(np.where(on_face, values / 3.0, -values).sum(axis=1)))
