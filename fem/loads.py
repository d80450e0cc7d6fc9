"""The right-hand side: what deposits put on the nodes, ``∫ Q0 v + (1/sigma_t') ∫ Q1 . grad v``.

Diffuse light adds ``∮ 2 E_t v / (1 + 3 C2)``, with E_t the irradiance that passes to the inside; emission adds
``∫ Q0 v`` by the corners.
"""

import numpy as np

from tetlux.fem.coefficients import Coefficients, at_cells
from tetlux.fem.fresnel import moments
from tetlux.fem.lights.deposit import Deposit
from tetlux.fem.paths import cells_of, optical_depths
from tetlux.meshing.arrays import FloatArray, IntArray, summed
from tetlux.meshing.march import march
from tetlux.meshing.tetmesh import TetMesh


def load_vector(mesh: TetMesh, coefficients: Coefficients, deposit: Deposit) -> FloatArray:
    """Load of a deposit on the nodes of a mesh.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients
    deposit : Deposit
        As it is on this mesh, see `Deposit.on`.

    Returns
    -------
    (n,) ndarray
        Sums to the scattered power that its points and segments hold and its volume emits, W, to rounding.
    """
    load = np.zeros(len(mesh.points))
    if len(deposit.points) or len(deposit.starts):
        line, points, powers = _line_load(mesh, coefficients, deposit)
        load += line
        # Points go with what is left of the lines.
        points, powers = np.vstack([deposit.points, points]), np.concatenate([deposit.powers, powers])
        homes = np.full(len(points), -1)
        if deposit.homes is not None:
            homes[: len(deposit.homes)] = deposit.homes
        load += _point_load(mesh, points, powers, homes)
    if np.any(deposit.transmitted_irradiance):
        _, c2 = moments(coefficients.outer.eta)
        load[mesh.boundary_nodes] += mesh.boundary_node_areas * 2.0 * deposit.transmitted_irradiance / (1.0 + 3.0 * c2)
    if np.any(deposit.emission):
        load += mesh.to_nodes(deposit.emission * mesh.volumes)
    return load


def _point_load(mesh: TetMesh, points: FloatArray, powers: FloatArray, homes: IntArray) -> FloatArray:
    """Points by their barycentric coordinates, in tetrahedra that are known or have to be found."""
    if len(points) == 0:
        return np.zeros(len(mesh.points))
    known, lost = np.flatnonzero(homes >= 0), np.flatnonzero(homes < 0)
    cells, weights = homes.copy(), np.empty((len(points), 4))
    weights[known] = mesh.barycentric(points[known], homes[known])
    if len(lost):
        cells[lost], weights[lost] = mesh.locate(points[lost])
    inside = cells >= 0
    load = summed(mesh.tetrahedra[cells[inside]], powers[inside, None] * weights[inside], len(mesh.points))
    if not inside.all():
        # Between the surface and the mesh's facets, a hair outside the mesh.
        _, faces, corner = mesh.closest_boundary(points[~inside])
        load += summed(mesh.boundary_faces[faces], powers[~inside, None] * corner, len(mesh.points))
    return load


def _line_load(
    mesh: TetMesh, coefficients: Coefficients, deposit: Deposit
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fading beams, integrated in closed form over every tetrahedron that they pass.

    Between the surface and the mesh's facets they may lie outside the mesh: of each such stretch the middle and its
    power are returned besides the load, as points.
    """
    load = np.zeros(len(mesh.points))
    points, powers = [np.zeros((0, 3))], [np.zeros(0)]
    for part in march(mesh, deposit.starts, deposit.directions, deposit.lengths, deposit.cells):
        cells = cells_of(mesh, coefficients, part, deposit.starts, deposit.directions)
        extinction = at_cells(coefficients.extinction, cells)
        step = part.leave - part.enter
        x = extinction * step
        carried = deposit.fluxes[part.paths] * at_cells(coefficients.scattering, cells)
        carried *= np.exp(-optical_depths(part, coefficients.extinction, cells))
        mean = carried * step * _phi1(x)
        q0 = mean[:, None] * part.weights + (carried * step**2 * _phi2(x))[:, None] * part.slopes
        forward = at_cells(coefficients.cosine, cells) / at_cells(coefficients.sigma_t_prime, cells)
        q1 = (forward * mean)[:, None] * part.slopes
        inside = part.cells >= 0
        load += summed(mesh.tetrahedra[part.cells[inside]], (q0 + q1)[inside], len(load))
        outside, middle = part.paths[~inside], 0.5 * (part.enter + part.leave)[~inside]
        points.append(deposit.starts[outside] + middle[:, None] * deposit.directions[outside])
        powers.append(mean[~inside])
    return load, np.concatenate(points), np.concatenate(powers)


def _phi1(x: FloatArray) -> FloatArray:
    """``∫0..1 exp(-x u) du``."""
    small = np.abs(x) < 1e-8
    safe = np.where(small, 1.0, x)
    return np.where(small, 1.0 - 0.5 * x, -np.expm1(-safe) / safe)


def _phi2(x: FloatArray) -> FloatArray:
    """``∫0..1 u exp(-x u) du``."""
    small = np.abs(x) < 1e-2
    safe = np.where(small, 1.0, x)
    series = 1 / 2 - x / 3 + x**2 / 8 - x**3 / 30 + x**4 / 144 - x**5 / 840
    return np.where(small, series, (-np.expm1(-safe) - safe * np.exp(-safe)) / safe**2)
