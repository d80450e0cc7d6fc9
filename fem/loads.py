"""The right-hand side: what deposits put on the nodes, ``∫ Q0 v + (1/sigma_t') ∫ Q1 . grad v``.

Diffuse light adds ``∮ 2 E_t v / (1 + 3 C2)``, with E_t the irradiance that passes to the inside.
"""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.fresnel import moments
from tetlux.fem.lights.deposit import Deposit
from tetlux.fem.medium import Medium
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.tetmesh import TetMesh

# How far outside a tetrahedron, in barycentric coordinates, a path may run and still count as inside.
SLACK = 1e-9


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
    stretches = _passed(mesh, start, direction, length)
    step = stretches.leave - stretches.enter
    x = extinction * step
    carried = flux * scattering * np.exp(-extinction * stretches.enter)
    mean = carried * step * _phi1(x)
    inside = stretches.cells >= 0
    cells, slopes, enter = stretches.cells[inside], stretches.slopes[inside], stretches.enter[inside]
    at_entry = mesh.barycentric(start + enter[:, None] * direction, cells)
    q0 = mean[inside, None] * at_entry + (carried * step**2 * _phi2(x))[inside, None] * slopes
    q1 = cosine / medium.sigma_t_prime * mean[inside, None] * slopes
    np.add.at(load, mesh.tetrahedra[cells], q0 + q1)
    # Between the surface and the mesh's facets the path may lie outside the mesh: to the nearest nodes with it.
    middle = start + 0.5 * (stretches.enter + stretches.leave)[:, None] * direction
    _add_points(load, mesh, middle[~inside], mean[~inside])


@dataclass(frozen=True, eq=False)
class _Stretches:
    """A segment cut where it passes from tetrahedron to tetrahedron.

    Attributes
    ----------
    cells : (s,) ndarray
        The tetrahedron of each stretch, -1 outside the mesh.
    enter, leave : (s,) ndarray
        Along the segment.
    slopes : (s, 4) ndarray
        Derivatives of the barycentric coordinates along it.
    """

    cells: IntArray
    enter: FloatArray
    leave: FloatArray
    slopes: FloatArray


def _passed(mesh: TetMesh, start: FloatArray, direction: FloatArray, length: float) -> _Stretches:
    """The tetrahedra along a segment, each stretch of it given to one of them."""
    near = np.flatnonzero(_near_segment(mesh, start, direction, length))
    base = mesh.barycentric(np.broadcast_to(start, (len(near), 3)), near)
    slope = mesh.barycentric(np.broadcast_to(start + length * direction, (len(near), 3)), near) - base
    slope /= length
    with np.errstate(divide="ignore", invalid="ignore"):
        root = -(base + SLACK) / slope
    enter = np.where(slope > 0, root, -np.inf).max(axis=1, initial=-np.inf).clip(min=0.0)
    leave = np.where(slope < 0, root, np.inf).min(axis=1, initial=np.inf).clip(max=length)
    hit = (leave > enter) & ~((slope == 0) & (base < -SLACK)).any(axis=1)
    near, base, slope = near[hit], base[hit], slope[hit]
    cuts = np.unique(np.concatenate([[0.0, length], enter[hit], leave[hit]]))
    middle = 0.5 * (cuts[1:] + cuts[:-1])
    owner = np.full(len(middle), -1)
    if len(near):
        # A path along a face or an edge runs in several tetrahedra at once: the one it is deepest in has it.
        depth = (base[None] + middle[:, None, None] * slope[None]).min(axis=2)
        best = depth.argmax(axis=1)
        owner = np.where(depth.max(axis=1) >= -2.0 * SLACK, best, -1)
    slopes = slope[owner] if len(near) else np.zeros((len(middle), 4))
    cells = np.where(owner >= 0, near[owner] if len(near) else -1, -1)
    return _Stretches(cells, cuts[:-1], cuts[1:], slopes)


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
