"""The error of layers, in which light fades within less than the height of a tetrahedron, so that no gradient shows it.

Along the boundary, what `tetlux.fem.operators.fitting` leaves of the error goes with the step of the fluence across
these tetrahedra and x = k h::

    ∮ D k LAYERS x²/(1 + x²)^(3/2) |phi step| z

Layers along interfaces are not fitted. Linear elements give a flux into them of ``D k s`` times the fluence instead of
``D k``, with s = sqrt(1 + (k h/2)²), which makes the dual there too faint by the same factor. They add::

    ∮ D k s (s - 1) |phi step| |z step|
"""

import numpy as np

from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.operators.fitting import LayerFitting
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.triangles import triangle_areas
from tetlux.meshing.tets.mesh import TetMesh

# Under diffuse light, on balls of 3 to 100 mean free paths, reduced albedos .09 to .99 and indices 1 and 1.4, the
# estimate with this is 1.1 to 3.5 times the true error where k h is at most 3, and 4 to 11 times where it is more.
LAYERS = 0.25


def boundary_layers(
    mesh: TetMesh, coefficients: Coefficients, fitting: LayerFitting, smooth: FloatArray, dual: FloatArray
) -> FloatArray:
    """Shares in the error of layers along the boundary, (m,).

    By the fluence at the corners of the tetrahedra at the boundary, (f, 4), and the dual at the nodes, (n,).
    """
    cells, faces = mesh.boundary_cells, mesh.boundary_faces
    diffusion, sigma_a = (at_cells(value, cells) for value in (coefficients.diffusion, coefficients.sigma_a))
    across = fitting.kh[faces].mean(axis=1)
    step = _step_across(mesh, cells, faces, smooth)
    shares = LAYERS * across**2 / (1.0 + across**2) ** 1.5 * np.sqrt(diffusion * sigma_a)
    shares *= mesh.boundary_areas * step * np.abs(dual[faces].mean(axis=1))
    return np.asarray(np.bincount(cells, shares, minlength=len(mesh.tetrahedra)), dtype=np.float64)


def interface_layers(mesh: TetMesh, coefficients: Coefficients, smooth: FloatArray, dual: FloatArray) -> FloatArray:
    """Shares in the error of layers along interfaces, (m,), by fluence and dual at corners of tetrahedra, (m, 4)."""
    total = np.zeros(len(mesh.tetrahedra))
    if not mesh.regions.any():
        return total
    faces, _, cells = mesh.interfaces
    _, areas = triangle_areas(mesh.points, faces)
    for side in cells.T:
        diffusion, sigma_a = (at_cells(value, side) for value in (coefficients.diffusion, coefficients.sigma_a))
        k = np.sqrt(sigma_a / diffusion)
        over = np.sqrt(1.0 + (0.5 * k * 3.0 * mesh.volumes[side] / areas) ** 2)
        first, second = (_step_across(mesh, side, faces, values[side]) for values in (smooth, dual))
        shares = diffusion * k * (over - 1.0) * over * areas * first * second
        total += np.bincount(side, shares, minlength=len(total))
    return total


def _step_across(mesh: TetMesh, cells: IntArray, faces: IntArray, values: FloatArray) -> FloatArray:
    """Change of the values at corners of tetrahedra (f, 4) from the mean on a face of each (f, 3) to its apex, (f,)."""
    on_face = (mesh.tetrahedra[cells][:, :, None] == faces[:, None, :]).any(axis=2)
    return np.asarray(np.abs(np.where(on_face, values / 3.0, -values).sum(axis=1)))
