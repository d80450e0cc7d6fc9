"""Refine marked tetrahedra, with new boundary nodes on the true surface."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import count

import numpy as np
from scipy.spatial import cKDTree

from tetlux.meshing.arrays import BoolArray, FloatArray, IndexArray, IntArray
from tetlux.meshing.surface.creases import Creases
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.geometry import tetrahedron_volumes
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.regions import surface_nodes
from tetlux.meshing.tets.topology import EDGES, EDGES_OF_FACES

# The moves of boundary nodes are shortened until each tetrahedron keeps the first share of its volume, and the same
# share of its quality or a quality above the second value (or its old quality, if that is lower).
SMALLEST_SHARE = 0.4
LEAST_QUALITY = 0.1
# A part is split often enough if its volume is at most this many times what halving makes of it.
FULLY_SPLIT = 1.5
# How often moves of nodes to a surface are halved before they are given up.
MOST_HALVINGS = 6
# Moves below this share of the body's diagonal are rounding errors.
ROUNDING = 1e-9
# A node on two surfaces is projected on each in turn, this many times: the projections converge to their intersection.
PROJECTION_ROUNDS = 10
# Nodes are moved onto a crease or corner that is nearer to them than this share of their shortest edge.
NEAR_CREASE = 0.35
# The edges of a tetrahedron, and of each of its faces.
_GROUPS = [list(range(6)), *EDGES_OF_FACES.tolist()]
# Even permutations of the corners that put each edge first, and the resulting permutations of the edges.
_EDGE_FIRST = np.array([[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]])
_ITS_EDGES = np.array(
    [[EDGES.tolist().index(sorted(pair)) for pair in corners[EDGES].tolist()] for corners in _EDGE_FIRST]
)


def refine(
    mesh: TetMesh, marked: BoolArray, surface: Surface | None = None, regions: Sequence[Surface] = ()
) -> TetMesh:
    """Bisect marked tetrahedra by longest edges, and neighbours as needed for a conforming mesh.

    Parameters
    ----------
    mesh : TetMesh
    marked : (m,) ndarray of bool
    surface : Surface, optional
        Surface that new boundary nodes are moved to; without it they stay at the midpoints of edges.
    regions : sequence of Surface
        Surfaces that new nodes between regions are moved to: the inner surfaces of the mesh, in their order.

    Returns
    -------
    TetMesh
        Its first ``len(mesh.points)`` nodes are those of `mesh`; parts of a tetrahedron keep its region.

    Raises
    ------
    InputError
        If `mesh` has more regions than there are inner surfaces, unless there are none.
    """
    return _refine(mesh, marked, surface, regions)[0]


def refine_often(mesh: TetMesh, splits: IntArray, surface: Surface, regions: Sequence[Surface], most: int) -> TetMesh:
    """Bisect each tetrahedron and its parts several times.

    Parameters
    ----------
    mesh : TetMesh
    splits : (m,) ndarray of int
        How often: 1 halves the tetrahedron, 2 its halves too.
    surface, regions
        As in `refine`.
    most : int
        Number of tetrahedra at which it stops.

    Returns
    -------
    TetMesh
    """
    left, volumes = splits, mesh.volumes * 0.5**splits
    while (left > 0).any():
        mesh, parents = _refine(mesh, left > 0, surface, regions)
        if len(mesh.tetrahedra) > most:
            break
        left, volumes = left[parents] - 1, volumes[parents]
        # Neighbours have split some of them already.
        left[mesh.volumes < FULLY_SPLIT * volumes] = 0
    return mesh


def _refine(
    mesh: TetMesh, marked: BoolArray, surface: Surface | None, regions: Sequence[Surface]
) -> tuple[TetMesh, IntArray]:
    """The refined mesh, and the tetrahedron that each of its tetrahedra is a part of, (m,)."""
    points, tetrahedra, parents = _bisect(mesh, marked)
    fine = TetMesh(points, tetrahedra, mesh.unit, labels=mesh.labels, warnings=mesh.warnings)
    if mesh.regions.any():
        fine = replace(fine, regions=mesh.regions[parents])
    if surface is None:
        return fine, parents
    return move_to_surface(fine, surface, regions, first=len(mesh.points)), parents


def _bisect(mesh: TetMesh, marked: BoolArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Bisect tetrahedra: new points and tetrahedra, and the old tetrahedron of each.

    Bisection by longest edges (Plaza & Carey 2000, refinement based on the skeleton).

    All edges have one order, by length. If any edge of a tetrahedron or a face is split, so is its longest one, and the
    split edges of a tetrahedron are halved from the longest to the shortest. So both sides of a face are cut alike.
    """
    ends, edges = mesh.edges, mesh.tetrahedron_edges
    order = np.empty(len(ends), dtype=np.int32)
    order[np.argsort(mesh.edge_lengths, kind="stable")] = np.arange(len(ends))
    priority = order[edges]
    split = np.flatnonzero(_mark_edges(edges, priority, marked, len(ends)))
    points = np.concatenate([mesh.points, 0.5 * (mesh.points[ends[split, 0]] + mesh.points[ends[split, 1]])])
    middle_of_edge = np.full(len(ends), -1)
    middle_of_edge[split] = len(mesh.points) + np.arange(len(split))

    corners, middles, parents = mesh.tetrahedra, middle_of_edge[edges], np.arange(len(edges))
    done, parents_of_done = [], []
    while True:
        ready = (middles < 0).all(axis=1)
        done.append(corners[ready])
        parents_of_done.append(parents[ready])
        corners, middles = corners[~ready], middles[~ready]
        priority, parents = priority[~ready], parents[~ready]
        if len(corners) == 0:
            return points, np.concatenate(done), np.concatenate(parents_of_done)
        longest = np.where(middles >= 0, priority, -1).argmax(axis=1)
        corners = np.take_along_axis(corners, _EDGE_FIRST[longest], axis=1)
        middles = np.take_along_axis(middles, _ITS_EDGES[longest], axis=1)
        priority = np.take_along_axis(priority, _ITS_EDGES[longest], axis=1)
        halves, middles_of_halves = np.stack([corners, corners]), np.stack([middles, middles])
        # The midpoint replaces the second corner in one half and the first in the other; edges at it are not split.
        halves[0, :, 1] = halves[1, :, 0] = middles[:, 0]
        middles_of_halves[0][:, [0, 3, 4]] = -1
        middles_of_halves[1][:, [0, 1, 2]] = -1
        corners, middles = halves.reshape(-1, 4), middles_of_halves.reshape(-1, 6)
        priority, parents = np.concatenate([priority, priority]), np.concatenate([parents, parents])


def _mark_edges(edges: IndexArray, priority: IndexArray, marked: BoolArray, count: int) -> BoolArray:
    """Which of `count` edges are split: the longest of each marked tetrahedron, and those that conformity adds."""
    rows = np.arange(len(edges))
    longest = [edges[rows, np.array(group)[priority[:, group].argmax(axis=1)]] for group in _GROUPS]
    split = np.zeros(count, dtype=bool)
    split[longest[0][marked]] = True
    before = 0
    while before < (before := int(split.sum())):
        touched = split[edges]
        for group, edge in zip(_GROUPS, longest, strict=True):
            split[edge[touched[:, group].any(axis=1)]] = True
    return split


def move_to_surface(mesh: TetMesh, surface: Surface, regions: Sequence[Surface] = (), *, first: int = 0) -> TetMesh:
    """Move boundary nodes to the closest points of a surface, and nodes between regions to the inner surfaces.

    A node where surfaces touch moves to a point of both. A node whose move would invert or flatten a tetrahedron moves
    only part of the way or not at all: 0 to 5 % of the nodes of fTetWild's meshes. A worst quality above 0.1 stays so.

    Nodes near creases and corners are then moved onto these: facets that cut off a corner by a thirtieth of their size
    change the exitance there by 8 %, however fine charges and elements are.

    Parameters
    ----------
    mesh : TetMesh
    surface : Surface
        Of the body.
    regions : sequence of Surface
        The inner surfaces of the mesh, in their order.
    first : int
        Nodes of smaller numbers stay.
    """
    targets = [
        (target, np.flatnonzero(nodes[first:]) + first) for target, nodes in surface_nodes(mesh, surface, regions)
    ]
    surfaces_at = np.bincount(np.concatenate([nodes for _, nodes in targets]), minlength=len(mesh.points))
    if not surfaces_at.any():
        return mesh
    aim = mesh.points.copy()
    for again in range(PROJECTION_ROUNDS if surfaces_at.max() > 1 else 1):
        for target, nodes in targets:
            some = nodes[surfaces_at[nodes] > 1] if again else nodes
            aim[some], _ = target.project(aim[some])
    moved = _move(mesh, aim - mesh.points, (surfaces_at > 0).astype(np.float64), MOST_HALVINGS)
    for target, nodes in targets:
        own = nodes[surfaces_at[nodes] == 1]
        if target.crease_angle > 0 and target.creases is not None and len(own):
            moved = _move_to_creases(moved, target.creases, own)
    return moved


def _move_to_creases(mesh: TetMesh, creases: Creases, nodes: IntArray) -> TetMesh:
    """Move those of some nodes of a surface that are near creases and corners onto these, or leave them."""
    shortest = np.full(len(mesh.points), np.inf)
    np.minimum.at(shortest, mesh.edges, mesh.edge_lengths[:, None])
    reach, places = NEAR_CREASE * shortest[nodes], mesh.points[nodes]
    aim = mesh.points.copy()
    closest = creases.closest(places)
    near = np.linalg.norm(closest - places, axis=1) < reach
    aim[nodes[near]] = closest[near]
    if len(creases.corners):
        distances, found = (np.asarray(each) for each in cKDTree(places).query(creases.corners))
        near = distances < reach[found]
        aim[nodes[found[near]]] = creases.corners[near]
    step = aim - mesh.points
    share = (np.abs(step).max(axis=1) > ROUNDING * mesh.diagonal).astype(np.float64)
    return _move(mesh, step, share, 0) if share.any() else mesh


def _move(mesh: TetMesh, step: FloatArray, share: FloatArray, halvings: int) -> TetMesh:
    """Move nodes by shares (n,) of steps (n, 3), halved so often, and then left, where they would spoil tetrahedra."""
    touched = mesh.tetrahedra[(share[mesh.tetrahedra] > 0).any(axis=1)]
    least = SMALLEST_SHARE * tetrahedron_volumes(mesh.points, touched)
    before = TetMesh(mesh.points, touched).quality
    lowest = np.minimum(before, np.maximum(LEAST_QUALITY, SMALLEST_SHARE * before))
    for attempt in count():
        moved = mesh.points + share[:, None] * step
        squashed = tetrahedron_volumes(moved, touched) < least
        sound = np.flatnonzero(~squashed)
        if len(sound) > 0:
            # The tolerance covers rounding of the quality where no node moved.
            squashed[sound] = TetMesh(moved, touched[sound]).quality < (1.0 - 1e-9) * lowest[sound]
        if not squashed.any():
            break
        share[np.unique(touched[squashed])] *= 0.5 if attempt < halvings else 0.0
    return replace(mesh, points=moved)
