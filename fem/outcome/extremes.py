"""Places where the exitance is largest and least, found without the many vertices that a picture of it needs."""

from collections.abc import Callable
from weakref import WeakKeyDictionary

import numpy as np

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
DIMMEST = 16
# A step that gains less than this share is the last.
LEAST_GAIN, MOST_STEPS = 1e-3, 40

# Vertices of a surface, and the last points of the surface that were tried for a mesh: runs on one mesh mostly try the
# same. None can be written to, so that the mesh keeps which of its facets they are on.
MOST_KEPT = 64
_VERTICES: WeakKeyDictionary[Surface, FloatArray] = WeakKeyDictionary()
_KEPT: ByPair[TetMesh, Surface, dict[bytes, FloatArray]] = ByPair()


def extreme_places(solution: Solution) -> FloatArray:
    """Points of the surface among which the exitance is largest and least.

    Parameters
    ----------
    solution : Solution

    Returns
    -------
    (q, 3) ndarray
        The dimmest nodes and the vertices of the surface around them, and the brightest places that a climb from the
        brightest nodes leads to. The largest value there is within 1 %, the least within 10 % of that at the vertices
        of `surface_exitance`.
    """
    mesh = solution.mesh
    dimmest = np.sort(mesh.boundary_nodes[np.argsort(modulus(solution.exitance))[:DIMMEST]])
    dim = _kept(solution, dimmest, lambda: _around_nodes(solution, dimmest))
    points = np.vstack([dim, _climb(solution)])
    return _kept(solution, points, lambda: points)


def _around_nodes(solution: Solution, nodes: IntArray) -> FloatArray:
    """Projections of nodes on the surface, and the vertices of the surface on the facets around them, (q, 3)."""
    mesh, vertices = solution.mesh, _vertices_of(solution.surface)
    chosen = np.zeros(len(mesh.points), dtype=bool)
    chosen[nodes] = True
    near = chosen[mesh.boundary_faces[mesh.closest_boundary(vertices)[1]]].any(axis=1)
    return np.vstack([solution.surface.project(mesh.points[nodes])[0], vertices[near]])


def _vertices_of(surface: Surface) -> FloatArray:
    """The vertices of a surface, (n, 3), as one array that cannot be written to."""
    if surface not in _VERTICES:
        _VERTICES[surface] = freeze(surface.points.copy())
    return _VERTICES[surface]


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


def _climb(solution: Solution) -> FloatArray:
    """Climb from the brightest nodes to places (p, 3) of the surface that none around is brighter than."""
    mesh = solution.mesh
    sides = np.zeros(len(mesh.points))
    facets = mesh.boundary_faces
    np.maximum.at(sides, facets.ravel(), np.repeat(mesh.boundary_sides, 3))
    brightest = _peaks(solution)
    places, steps = mesh.points[brightest], sides[brightest]
    climbing = np.arange(len(brightest))
    for _ in range(MOST_STEPS):
        tried = _around(solution, places[climbing], steps[climbing])
        bright = modulus(solution.exitance_on(tried)).reshape(len(climbing), -1)
        # The first of the places tried is where it is.
        better = bright.max(axis=1) - bright[:, 0] > LEAST_GAIN * np.abs(bright[:, 0])
        best = np.where(better, bright.argmax(axis=1), 0)
        places[climbing] = tried.reshape(len(climbing), -1, 3)[np.arange(len(climbing)), best]
        climbing, best = climbing[better], best[better]
        if len(climbing) == 0:
            break
        # The next steps begin with the length that led farthest.
        steps[climbing] *= SHORTER[(best - 1) // DIRECTIONS]
    return places


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
