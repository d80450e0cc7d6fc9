"""Reproducible meshes of a ball, made of layers of tetrahedra, and a way to degrade some of these."""

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.shapes import sphere
from tetlux.meshing.tets.geometry import tetrahedron_volumes
from tetlux.meshing.tets.mesh import TetMesh

# The most nodes that are moved. No two of them are neighbours, so that each makes a bad tetrahedron of its own.
MOST_DEGRADED = 60
HALVINGS = 40


def layered_ball(radius: float, subdivisions: int, layers: int, core: int = 0) -> TetMesh:
    """Mesh a ball by nested icospheres; each prism between two of them is cut into three tetrahedra.

    Parameters
    ----------
    radius : float
        Unit.
    subdivisions : int
        Subdivisions of the icospheres; 2 gives 320 triangles.
    layers : int
        Number of layers, evenly spaced; in the innermost all tetrahedra meet at the centre.
    core : int
        Number of inner layers that are region 1.

    Returns
    -------
    TetMesh
    """
    shell = sphere(1.0, subdivisions=subdivisions)
    count = len(shell.points)
    outward = shell.points / np.linalg.norm(shell.points, axis=1)[:, None]
    shares = np.arange(layers, 0, -1) / layers
    points = np.vstack([*(radius * share * outward for share in shares), np.zeros(3)])
    # Prisms are cut by the order of their nodes, so that neighbours share the diagonals of their common face.
    a, b, c = np.sort(shell.faces, axis=1).T
    prism = np.concatenate(
        [
            np.column_stack([a, b, c, c + count]),
            np.column_stack([a, b, b + count, c + count]),
            np.column_stack([a, a + count, b + count, c + count]),
        ]
    )
    middle = np.column_stack([shell.faces + (layers - 1) * count, np.full(len(shell.faces), layers * count)])
    tetrahedra = np.vstack([*(prism + layer * count for layer in range(layers - 1)), middle])
    regions = np.repeat(np.arange(layers), [len(prism)] * (layers - 1) + [len(middle)]) >= layers - core
    return TetMesh(points, orient(points, tetrahedra), regions=regions.astype(np.int64))


def orient(points: FloatArray, tetrahedra: IntArray) -> IntArray:
    """Swap corners of inverted tetrahedra, so that all volumes are positive."""
    oriented = tetrahedra.copy()
    inverted = tetrahedron_volumes(points, tetrahedra) < 0
    oriented[inverted, :2] = tetrahedra[inverted][:, [1, 0]]
    return oriented


def degrade(mesh: TetMesh, quality: float) -> TetMesh:
    """Degrade some tetrahedra of a mesh to slivers and needles, in turn.

    An inner node is moved towards the opposite face of one of its tetrahedra (a sliver), or along one of its edges (a
    needle), until that tetrahedron has the quality that is asked for and no other is worse.

    Parameters
    ----------
    mesh : TetMesh
    quality : float
        Quality of the worst tetrahedra, see `TetMesh.quality`.

    Returns
    -------
    TetMesh
    """
    points, fixed = mesh.points.copy(), _fixed_nodes(mesh)
    moved = np.zeros(len(points), dtype=bool)
    done = 0
    for node, cells in enumerate(_cells_of_nodes(mesh)):
        if done == MOST_DEGRADED:
            break
        near = mesh.tetrahedra[cells]
        if fixed[node] or moved[near].any():
            continue
        place = _bad_place(points, near, node, quality, sliver=done % 2 == 0)
        if place is not None:
            points[node], moved[node] = place, True
            done += 1
    return TetMesh(points, mesh.tetrahedra, mesh.unit, mesh.regions)


def _cells_of_nodes(mesh: TetMesh) -> list[list[int]]:
    around: list[list[int]] = [[] for _ in mesh.points]
    for cell, corners in enumerate(mesh.tetrahedra.tolist()):
        for corner in corners:
            around[corner].append(cell)
    return around


def _fixed_nodes(mesh: TetMesh) -> BoolArray:
    """Nodes on the boundary and between regions, (n,)."""
    fixed = np.zeros(len(mesh.points), dtype=bool)
    fixed[mesh.boundary_nodes] = True
    fixed[mesh.interfaces[0]] = True
    return fixed


def _bad_place(points: FloatArray, near: IntArray, node: int, quality: float, *, sliver: bool) -> FloatArray | None:
    """Where to move a node so that one of its tetrahedra `near` becomes a sliver or a needle; None if nowhere."""
    for cell in near:
        others = points[cell[cell != node]]
        place = _approach(points, near, node, others.mean(axis=0) if sliver else others[0], quality)
        if place is not None:
            return place
    return None


def _approach(points: FloatArray, near: IntArray, node: int, aim: FloatArray, quality: float) -> FloatArray | None:
    """Where a node, moved towards `aim`, gives the worst tetrahedron a quality, by bisection; None if nowhere."""
    local = np.unique(near)
    cells = np.searchsorted(local, near)
    own = int(np.searchsorted(local, node))

    def worst(share: float) -> float:
        trial = points[local].copy()
        trial[own] += share * (aim - trial[own])
        return float(TetMesh(trial, cells).quality.min()) if (tetrahedron_volumes(trial, cells) > 0).all() else 0.0

    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if worst(middle) > quality else (low, middle)
    # A tetrahedron may become inverted before any has the quality.
    return np.asarray(points[node] + low * (aim - points[node])) if worst(low) < 2.0 * quality else None
