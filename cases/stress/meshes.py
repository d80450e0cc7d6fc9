"""Meshes of a ball that are the same on every machine: layers of tetrahedra, and the same with bad ones among them."""

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.shapes import sphere
from tetlux.meshing.tetmesh import TetMesh, tetrahedron_volumes

# No node is moved next to one that was, so that each makes a bad tetrahedron of its own; these are so many at most.
MOST_SPOILED = 60
HALVINGS = 40


def ball_of_layers(radius: float, subdivisions: int, layers: int, core: int = 0) -> TetMesh:
    """A ball of nested icospheres, the prisms between which are cut into three tetrahedra each.

    Parameters
    ----------
    radius : float
        Unit.
    subdivisions : int
        Of the icospheres: 2 gives 320 triangles.
    layers : int
        How many, evenly spaced; inside the last one all tetrahedra meet at the centre.
    core : int
        So many of them, the inner ones, are region 1.

    Returns
    -------
    TetMesh
    """
    shell = sphere(1.0, subdivisions=subdivisions)
    count = len(shell.points)
    outward = shell.points / np.linalg.norm(shell.points, axis=1)[:, None]
    shares = np.arange(layers, 0, -1) / layers
    points = np.vstack([*(radius * share * outward for share in shares), np.zeros(3)])
    # Cut by the order of nodes, prisms side by side agree on the diagonals between them.
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
    return TetMesh(points, oriented(points, tetrahedra), regions=regions.astype(np.int64))


def oriented(points: FloatArray, tetrahedra: IntArray) -> IntArray:
    """The same tetrahedra with positive volumes."""
    turned = tetrahedra.copy()
    inverted = tetrahedron_volumes(points, tetrahedra) < 0
    turned[inverted, :2] = tetrahedra[inverted][:, [1, 0]]
    return turned


def spoiled(mesh: TetMesh, quality: float) -> TetMesh:
    """The same mesh with bad tetrahedra in it: slivers and needles, in turn.

    An inner node is moved towards the opposite face of one of its tetrahedra (a sliver), or along one of its edges (a
    needle), as far as it takes to make that tetrahedron as bad as is asked for and leave no other worse.

    Parameters
    ----------
    mesh : TetMesh
    quality : float
        That of the worst tetrahedra, see `TetMesh.quality`.

    Returns
    -------
    TetMesh
    """
    points = mesh.points.copy()
    around: list[list[int]] = [[] for _ in points]
    for cell, corners in enumerate(mesh.tetrahedra.tolist()):
        for corner in corners:
            around[corner].append(cell)
    fixed = np.zeros(len(points), dtype=bool)
    fixed[mesh.boundary_nodes] = True
    # The faces between regions are to stay where they are.
    fixed[mesh.interfaces[0]] = True
    moved = np.zeros(len(points), dtype=bool)
    done = 0
    for node, cells in enumerate(around):
        if done == MOST_SPOILED:
            break
        near = mesh.tetrahedra[cells]
        if fixed[node] or moved[near].any():
            continue
        for cell in range(len(cells)):
            others = points[near[cell][near[cell] != node]]
            aim = others.mean(axis=0) if done % 2 == 0 else others[0]
            place = _place(points, near, node, aim, quality)
            if place is not None:
                points[node], moved[node] = place, True
                done += 1
                break
    return TetMesh(points, mesh.tetrahedra, mesh.unit, mesh.regions)


def _place(points: FloatArray, near: IntArray, node: int, aim: FloatArray, quality: float) -> FloatArray | None:
    """Where a node of tetrahedra goes for the worst of them to be of a quality; None if it does not get there."""
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
    # Where a tetrahedron is turned inside out before any is bad, there is no such place.
    return np.asarray(points[node] + low * (aim - points[node])) if worst(low) < 2.0 * quality else None
