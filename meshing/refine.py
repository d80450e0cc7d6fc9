"""Refinement of marked tetrahedra, with new boundary nodes on the true surface."""

import logging
from itertools import count

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh, tetrahedron_volumes

# A tetrahedron may lose this share of its volume when boundary nodes move; below it, the move is shortened.
SMALLEST_SHARE = 0.4


def refine(mesh: TetMesh, marked: BoolArray, surface: Surface | None = None) -> TetMesh:
    """Split marked tetrahedra (and as many neighbours as keeps the mesh conforming) by longest edges.

    Parameters
    ----------
    mesh : TetMesh
    marked : (m,) ndarray of bool
    surface : Surface, optional
        Where new boundary nodes are moved to; without it they stay in the middle of their edges.

    Returns
    -------
    TetMesh
        Its first ``len(mesh.points)`` nodes are those of `mesh`.
    """
    points, tetrahedra = _bisected(mesh, marked)
    fine = TetMesh(points, tetrahedra, mesh.unit)
    if surface is None:
        return fine
    return moved_to_surface(fine, surface, first=len(mesh.points))


def _bisected(mesh: TetMesh, marked: BoolArray) -> tuple[FloatArray, IntArray]:
    """scikit-fem's longest-edge bisection, without its side effects.

    It breaks ties between edges by noise of 1e-10 in absolute coordinates, so it is given a body of size
    one; it seeds NumPy's global generator, which is put back; and it logs how its arrays lie in memory.
    """
    from skfem import MeshTet1  # noqa: PLC0415

    origin, size = mesh.points[0], mesh.diagonal
    scaled = np.ascontiguousarray(((mesh.points - origin) / size).T)
    log = logging.getLogger("skfem.mesh.mesh")
    level, state = log.level, np.random.get_state()  # noqa: NPY002
    log.setLevel(logging.ERROR)
    try:
        fine = MeshTet1(scaled, np.ascontiguousarray(mesh.tetrahedra.T)).refined(np.flatnonzero(marked))
    finally:
        log.setLevel(level)
        np.random.set_state(state)  # noqa: NPY002
    points = fine.p.T * size + origin
    points[: len(mesh.points)] = mesh.points
    tetrahedra = fine.t.T.astype(np.int64)
    inverted = tetrahedron_volumes(points, tetrahedra) < 0
    tetrahedra[inverted] = tetrahedra[inverted][:, [1, 0, 2, 3]]
    return points, tetrahedra


def moved_to_surface(mesh: TetMesh, surface: Surface, *, first: int = 0) -> TetMesh:
    """Move boundary nodes (those numbered `first` and up) to the nearest point of a surface.

    A node whose move would invert or squash a tetrahedron goes only part of the way, or stays.
    """
    nodes = mesh.boundary_nodes[mesh.boundary_nodes >= first]
    if len(nodes) == 0:
        return mesh
    target, _ = surface.closest(mesh.points[nodes])
    step = np.zeros_like(mesh.points)
    step[nodes] = target - mesh.points[nodes]
    share = np.zeros(len(mesh.points))
    share[nodes] = 1.0
    touched = mesh.tetrahedra[(share[mesh.tetrahedra] > 0).any(axis=1)]
    least = SMALLEST_SHARE * tetrahedron_volumes(mesh.points, touched)
    for attempt in count():
        moved = mesh.points + share[:, None] * step
        squashed = tetrahedron_volumes(moved, touched) < least
        if not squashed.any():
            break
        share[np.unique(touched[squashed])] *= 0.5 if attempt < 6 else 0.0
    return TetMesh(moved, mesh.tetrahedra, mesh.unit)
