"""The right-hand side: what deposits put on the nodes, ``∫ Q0 v + (1/sigma_t') ∫ Q1 . grad v``.

Diffuse light adds ``∮ 2 E_t v / (1 + 3 C2)``, with E_t the irradiance that passes to the inside.
"""

import numpy as np

from tetlux.fem.fresnel import moments
from tetlux.fem.lights.deposit import Deposit
from tetlux.fem.medium import Medium
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.tetmesh import TetMesh


def load_vector(mesh: TetMesh, medium: Medium, deposit: Deposit) -> FloatArray:
    """Load of a deposit on the nodes of a mesh.

    Parameters
    ----------
    mesh : TetMesh
    medium : Medium
    deposit : Deposit

    Returns
    -------
    (n,) ndarray
        Of points and segments, sums to the scattered power that they hold, W, to rounding.
    """
    load = np.zeros(len(mesh.points))
    if len(deposit.points):
        _add_points(load, mesh, deposit.points, deposit.powers)
    for start, direction, length, flux in zip(
        deposit.starts, deposit.directions, deposit.lengths, deposit.fluxes, strict=True
    ):
        _add_segment(load, mesh, medium, start, direction, float(length), float(flux))
    if deposit.transmitted_irradiance:
        _, c2 = moments(medium.eta)
        load[mesh.boundary_nodes] += mesh.boundary_node_areas * 2.0 * deposit.transmitted_irradiance / (1.0 + 3.0 * c2)
    return load


def _add_points(load: FloatArray, mesh: TetMesh, points: FloatArray, powers: FloatArray) -> None:
    cells, weights = mesh.locate(points)
    inside = cells >= 0
    np.add.at(load, mesh.tetrahedra[cells[inside]], powers[inside, None] * weights[inside])
    if not inside.all():
        # Between the surface and the mesh's facets, a hair outside the mesh.
        _, faces, corner = mesh.closest_boundary(points[~inside])
        np.add.at(load, mesh.boundary_faces[faces], powers[~inside, None] * corner)


def _add_segment(
    load: FloatArray,
    mesh: TetMesh,
    medium: Medium,
    start: FloatArray,
    direction: FloatArray,
    length: float,
    flux: float,
) -> None:
    """A fading beam, integrated in closed form over every tetrahedron that it passes."""
    scattering, cosine = medium.delta_eddington
    extinction = medium.sigma_a + scattering
    total = flux * scattering / extinction * -np.expm1(-extinction * length)
    cells, enter, leave, slopes = _passed(mesh, start, direction, length)
    if len(cells) == 0:
        _add_points(load, mesh, start[None], np.array([total]))
        return
    step = leave - enter
    x = extinction * step
    carried = flux * scattering * np.exp(-extinction * enter)
    mean = carried * step * _phi1(x)
    first = carried * step**2 * _phi2(x)
    at_entry = mesh.barycentric(start + enter[:, None] * direction, cells)
    q0 = mean[:, None] * at_entry + first[:, None] * slopes
    q1 = cosine / medium.sigma_t_prime * mean[:, None] * slopes
    # The chord in the mesh misses the path in the body by the facets' sagitta; the power must not.
    np.add.at(load, mesh.tetrahedra[cells], (q0 + q1) * (total / mean.sum()))


def _passed(
    mesh: TetMesh, start: FloatArray, direction: FloatArray, length: float
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """The tetrahedra along a segment, each stretch of it given to one of them.

    Returns
    -------
    cells : (s,) ndarray
    enter, leave : (s,) ndarray
        Along the segment.
    slopes : (s, 4) ndarray
        Derivatives of the barycentric coordinates along it.
    """
    near = np.flatnonzero(_near_segment(mesh, start, direction, length))
    if len(near) == 0:
        none = np.zeros(0)
        return near, none, none, np.zeros((0, 4))
    base = mesh.barycentric(np.broadcast_to(start, (len(near), 3)), near)
    slope = mesh.barycentric(np.broadcast_to(start + direction, (len(near), 3)), near) - base
    with np.errstate(divide="ignore", invalid="ignore"):
        root = -base / slope
    enter = np.where(slope > 0, root, -np.inf).max(axis=1).clip(min=0.0)
    leave = np.where(slope < 0, root, np.inf).min(axis=1).clip(max=length)
    # A coordinate that does not change must be positive all along.
    never = ((slope == 0) & (base < 0)).any(axis=1)
    hit = (leave > enter) & ~never
    near, enter, leave, slope = near[hit], enter[hit], leave[hit], slope[hit]
    # A path along a face or an edge runs in several tetrahedra at once: each stretch counts once.
    cuts = np.unique(np.concatenate([enter, leave]))
    middle = 0.5 * (cuts[1:] + cuts[:-1])
    holds = (enter[None] < middle[:, None]) & (middle[:, None] < leave[None])
    covered = holds.any(axis=1)
    owner = holds.argmax(axis=1)[covered]
    return near[owner], cuts[:-1][covered], cuts[1:][covered], slope[owner]


def _near_segment(mesh: TetMesh, start: FloatArray, direction: FloatArray, length: float) -> BoolArray:
    centre = mesh.points[mesh.tetrahedra[:, 0]] - start
    along = np.clip(centre @ direction, 0.0, length)
    distance = np.linalg.norm(centre - along[:, None] * direction, axis=1)
    return np.asarray(distance <= mesh.longest_edges)


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
