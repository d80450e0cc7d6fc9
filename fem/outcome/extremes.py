"""Places where the exitance is largest and least, found without the many vertices that a picture of it needs."""

from weakref import WeakKeyDictionary

import numpy as np

from tetlux.fem.models.modulation import modulus
from tetlux.fem.outcome.solution import Solution
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides

# The brightest peaks, from which the largest value is climbed to, and how dim they may be beside the brightest, since a
# coarse mesh may miss most of a peak; directions of a step; and lengths that are tried at once, each half of the one
# before, the first the longest side of the facets around the node.
PEAKS, LEAST_PEAK, DIRECTIONS, LENGTHS = 4, 0.1, 8, 6
# The least value is that of so many of the dimmest nodes and of the vertices on facets around them.
DIMMEST = 16
# A step that gains less than this share is the last.
LEAST_GAIN, MOST_STEPS = 1e-3, 40

# Copies of vertices that cannot be written to, whose nearest points a mesh keeps.
_VERTICES: WeakKeyDictionary[Surface, FloatArray] = WeakKeyDictionary()


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
    vertices = _vertices_of(solution.surface)
    mesh = solution.mesh
    dim = np.zeros(len(mesh.points), dtype=bool)
    dimmest = mesh.boundary_nodes[np.argsort(modulus(solution.exitance))[:DIMMEST]]
    dim[dimmest] = True
    near = dim[mesh.boundary_faces[mesh.closest_boundary(vertices)[1]]].any(axis=1)
    return np.vstack([solution.surface.project(mesh.points[dimmest])[0], vertices[near], _climb(solution)])


def _vertices_of(surface: Surface) -> FloatArray:
    """The vertices of a surface, (n, 3), as one array that cannot be written to."""
    if surface not in _VERTICES:
        vertices = surface.points.copy()
        vertices.setflags(write=False)
        _VERTICES[surface] = vertices
    return _VERTICES[surface]


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
    mesh, surface = solution.mesh, solution.surface
    sides = np.zeros(len(mesh.points))
    facets = mesh.boundary_faces
    np.maximum.at(sides, facets.ravel(), np.repeat(longest_sides(mesh.points[facets]), 3))
    brightest = _peaks(solution)
    places, normals = surface.project(mesh.points[brightest])
    values, steps = modulus(solution.exitance_on(places)), sides[brightest]
    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    shorter = 0.5 ** np.arange(LENGTHS)
    climbing = np.arange(len(brightest))
    for _ in range(MOST_STEPS):
        if len(climbing) == 0:
            break
        first = np.cross(normals[climbing], np.eye(3)[np.abs(normals[climbing]).argmin(axis=1)])
        first /= np.linalg.norm(first, axis=1)[:, None]
        second = np.cross(normals[climbing], first)
        ways = np.cos(angles)[:, None] * first[:, None] + np.sin(angles)[:, None] * second[:, None]
        # (climbing, lengths, directions, 3)
        tried = places[climbing, None, None] + (steps[climbing, None] * shorter)[..., None, None] * ways[:, None]
        found, found_normals = surface.project(tried.reshape(-1, 3))
        bright = modulus(solution.exitance_on(found)).reshape(len(climbing), LENGTHS * DIRECTIONS)
        best = bright.argmax(axis=1)
        row = np.arange(len(climbing)) * LENGTHS * DIRECTIONS + best
        gains = bright.max(axis=1) - values[climbing]
        better = gains > LEAST_GAIN * np.abs(values[climbing])
        moved = climbing[better]
        places[moved], normals[moved] = found[row[better]], found_normals[row[better]]
        values[moved] = bright.max(axis=1)[better]
        # The next steps begin with the length that led farthest.
        steps[moved] *= shorter[best[better] // DIRECTIONS]
        climbing = moved
    return places
