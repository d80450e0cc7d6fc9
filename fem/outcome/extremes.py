"""Places where the exitance is largest and least, found without the many vertices that a picture of it needs."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.distance import cdist

from tetlux.fem.models.modulation import modulus
from tetlux.fem.outcome.solution import Solution
from tetlux.meshing.arrays import FloatArray, IntArray, freeze, perpendicular_axes
from tetlux.meshing.host.by_pair import ByPair
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# The brightest peaks, from which the largest value is climbed to, and how dim they may be beside the brightest, since a
# coarse mesh may miss most of a peak; directions of a step; and lengths that are tried at once, each half of the one
# before, the first the longest side of the facets around the node.
PEAKS, LEAST_PEAK, DIRECTIONS, LENGTHS = 4, 0.1, 8, 6
SHORTER = 0.5 ** np.arange(LENGTHS)
# The least value is that of so many of the dimmest nodes and of the vertices on facets around them.
DIMMEST = 4
# A step that gains less than the first share is not taken, and one that gains less than the second is the last: around
# a peak the next one, half as long, gains a quarter of it.
LEAST_GAIN, LAST_GAIN, MOST_STEPS = 1e-3, 4e-3, 40

# Vertices on a facet are closer to each of its corners than this times its longest side.
CLOSE = 2.0
# The last points of the surface that were tried for a mesh: runs on one mesh mostly try the same. None can be written
# to, so that the mesh keeps which of its facets they are on.
MOST_KEPT = 64
_KEPT: ByPair[TetMesh, Surface, dict[bytes, FloatArray]] = ByPair()


def extremes(solution: Solution) -> tuple[FloatArray, FloatArray]:
    """Points of the surface among which the exitance is largest and least, and the exitance there.

    Parameters
    ----------
    solution : Solution

    Returns
    -------
    points : (q, 3) ndarray
        The dimmest nodes and the vertices of the surface around them, and the brightest places that a climb from the
        brightest nodes leads to. The largest value there is within 1 %, the least within 10 % of that at the vertices
        of `surface_exitance`.
    exitance : (q,) ndarray
        Of modulated light its modulus, W/unit².
    """
    mesh = solution.mesh
    dimmest = np.sort(mesh.boundary_nodes[np.argsort(modulus(solution.exitance))[:DIMMEST]])
    dim = _kept(solution, dimmest, lambda: _around_nodes(solution, dimmest))
    bright, values = _climb(solution, dim)
    return _both(solution, dim, bright), values


def _around_nodes(solution: Solution, nodes: IntArray) -> FloatArray:
    """Projections of nodes on the surface, and the vertices of the surface on the facets around them, (q, 3)."""
    mesh, surface = solution.mesh, solution.surface
    facets = np.asarray(np.isin(mesh.boundary_faces, nodes).any(axis=1))
    # Most vertices are farther from the nodes than facets around them reach.
    reach = CLOSE * mesh.boundary_sides[facets].max()
    vertices = surface.points[(cdist(surface.points, mesh.points[nodes]) < reach).any(axis=1)]
    near = facets[mesh.closest_boundary(vertices)[1]]
    return np.vstack([surface.project(mesh.points[nodes])[0], vertices[near]])


def _kept(solution: Solution, key: IntArray | FloatArray, make: Callable[[], FloatArray]) -> FloatArray:
    """Points of the surface that are made only if they are not among the last for a mesh and a key."""
    kept, content = _KEPT.get(solution.mesh, solution.surface, dict), key.tobytes()
    # The last that was used is the last that is forgotten.
    points = kept.pop(content, None)
    kept[content] = points = freeze(make()) if points is None else points
    while len(kept) > MOST_KEPT:
        del kept[next(iter(kept))]
    return points


def _peaks(solution: Solution) -> IntArray:
    """The brightest of the nodes that no neighbour on the boundary is brighter than, (p,)."""
    mesh = solution.mesh
    values, around = np.full(len(mesh.points), -np.inf), np.full(len(mesh.points), -np.inf)
    values[mesh.boundary_nodes] = modulus(solution.exitance)
    np.maximum.at(around, mesh.boundary_faces.ravel(), np.repeat(values[mesh.boundary_faces].max(axis=1), 3))
    nodes: IntArray = mesh.boundary_nodes[values[mesh.boundary_nodes] >= around[mesh.boundary_nodes]]
    nodes = nodes[np.argsort(-values[nodes])[:PEAKS]]
    is_bright = values[nodes] >= LEAST_PEAK * values[nodes[0]]
    return np.asarray(nodes[is_bright])


def _climb(solution: Solution, others: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Climb from the brightest nodes to places (p, 3) of the surface that none around is brighter than.

    Also returns the exitance at other places (q, 3), which are evaluated with the first step, and there, (q + p,).
    """
    places, steps = _first_places(solution)
    climbing, reached = np.arange(len(places)), np.empty(len(places))
    at_others = np.empty(0)
    for step in range(MOST_STEPS):
        tried = _around(solution, places[climbing], steps[climbing])
        asked = tried if step else _both(solution, others, tried)
        found = modulus(solution.exitance_on(asked))
        if step == 0:
            at_others, found = np.split(found, [len(others)])
        bright = found.reshape(len(climbing), -1)
        # The first of the places tried is where it is.
        gains, scale = bright.max(axis=1) - bright[:, 0], np.abs(bright[:, 0])
        best = np.where(gains > LEAST_GAIN * scale, bright.argmax(axis=1), 0)
        rows = np.arange(len(climbing))
        places[climbing] = tried.reshape(len(climbing), -1, 3)[rows, best]
        reached[climbing] = bright[rows, best]
        goes_on = gains > LAST_GAIN * scale
        climbing, best = climbing[goes_on], best[goes_on]
        if len(climbing) == 0:
            break
        # The next steps begin with the length that led farthest.
        steps[climbing] *= SHORTER[(best - 1) // DIRECTIONS]
    return places, np.concatenate([at_others, reached])


def _both(solution: Solution, first: FloatArray, second: FloatArray) -> FloatArray:
    """Points of two arrays as one that is kept."""
    both = np.vstack([first, second])
    return _kept(solution, both, lambda: both)


def _first_places(solution: Solution) -> tuple[FloatArray, FloatArray]:
    """The brightest nodes (p, 3), and the longest sides of the facets around them, (p,)."""
    mesh, nodes = solution.mesh, _peaks(solution)
    around = mesh.boundary_faces[None, :, :] == nodes[:, None, None]
    return mesh.points[nodes], np.max(np.where(around.any(axis=2), mesh.boundary_sides, 0.0), axis=1)


def _around(solution: Solution, places: FloatArray, steps: FloatArray) -> FloatArray:
    """For each of places (p, 3) its projection on the surface, and others around it within steps (p,), (p t, 3)."""
    return _kept(solution, np.column_stack([places, steps]), lambda: _points_around(solution.surface, places, steps))


def _points_around(surface: Surface, places: FloatArray, steps: FloatArray) -> FloatArray:
    """`_around`, without what is remembered."""
    middles, normals = surface.project(places)
    first, second = perpendicular_axes(normals)
    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    ways = np.cos(angles)[:, None] * first[:, None] + np.sin(angles)[:, None] * second[:, None]
    # (p, lengths, directions, 3)
    offsets = (steps[:, None] * SHORTER)[..., None, None] * ways[:, None]
    around = middles[:, None] + offsets.reshape(len(places), -1, 3)
    found = surface.project(around.reshape(-1, 3))[0].reshape(around.shape)
    return np.concatenate([middles[:, None], found], axis=1).reshape(-1, 3)
