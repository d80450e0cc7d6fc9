"""Extinction of beams along paths through the tetrahedra of a mesh (Beer-Lambert)."""

import numpy as np

from tetlux.fem.ballistic.rays import Rays
from tetlux.fem.body.optical_paths import depths_before
from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.search.cell_tree import PathSegments
from tetlux.meshing.tets.march import march
from tetlux.meshing.tets.mesh import TetMesh


def optical_depths(part: PathSegments, extinction: float | FloatArray, cells: IntArray) -> FloatArray:
    """Optical depth from the start of each path to the start of each of its segments.

    Parameters
    ----------
    part : PathSegments
        Segments (s,) of complete paths.
    extinction : float or (m,) ndarray
        Of all tetrahedra or of each, 1/unit.
    cells : (s,) ndarray
        Tetrahedra whose extinction the segments have, see `cells_of`.

    Returns
    -------
    (s,) ndarray
    """
    if np.ndim(extinction) == 0:
        return np.asarray(extinction * part.enter)
    depth = at_cells(extinction, cells) * (part.leave - part.enter)
    order = np.lexsort((part.enter, part.paths))
    result = np.empty(len(depth))
    result[order] = depths_before(part.paths[order], depth[order])
    return result


def cells_of(
    mesh: TetMesh, coefficients: Coefficients, part: PathSegments, starts: FloatArray, directions: FloatArray
) -> IntArray:
    """Tetrahedra whose coefficients the segments of paths have.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients
    part : PathSegments
        Segments (s,).
    starts, directions : (r, 3) ndarray
        Of the paths.

    Returns
    -------
    (s,) ndarray
        Where a segment is outside the mesh, the boundary tetrahedron nearest to its middle; if coefficients are the
        same everywhere it may stay -1.
    """
    if coefficients.uniform:
        return part.cells
    cells = part.cells.copy()
    outside = np.flatnonzero(cells < 0)
    if len(outside):
        paths, middle = part.paths[outside], 0.5 * (part.enter + part.leave)[outside]
        places = starts[paths] + middle[:, None] * directions[paths]
        cells[outside] = mesh.boundary_cells[mesh.closest_boundary(places)[1]]
    return cells


def attenuate(
    mesh: TetMesh, coefficients: Coefficients, rays: Rays, lengths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Attenuate rays along straight paths.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients
    rays : Rays
    lengths : (r,) ndarray
        Of the paths, unit.

    Returns
    -------
    ends : (r,) ndarray
        Power that each ray has left, W.
    absorbed : (r,) ndarray
        Power that is absorbed on its way, W; the rest is scattered.
    """
    extinction, sigma_a = coefficients.extinction, coefficients.sigma_a
    if coefficients.uniform:
        ends = rays.powers * np.exp(-extinction * lengths)
        return ends, (rays.powers - ends) * sigma_a / extinction
    depth, absorbed = np.zeros((2, len(lengths)))
    for part in march(mesh, rays.starts, rays.directions, lengths, rays.cells):
        cells = cells_of(mesh, coefficients, part, rays.starts, rays.directions)
        local, step = at_cells(extinction, cells), part.leave - part.enter
        carried = rays.powers[part.paths] * np.exp(-optical_depths(part, extinction, cells))
        lost = carried * -np.expm1(-local * step) * at_cells(sigma_a, cells) / local
        absorbed += np.bincount(part.paths, lost, minlength=len(depth))
        depth += np.bincount(part.paths, local * step, minlength=len(depth))
    return rays.powers * np.exp(-depth), absorbed
