"""Exitance on the user's own surface, to be written or drawn."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.outcome.exitance_field import ResolvedField
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.subdivide import mark_longest_edges, number_triangle_edges, split_edges
from tetlux.meshing.surface.surface import Surface

# An edge is split if the exitance in its middle is off the mean of its ends by more than a share of the largest
# exitance, or by a share of itself where it is not too dark to see; and while it is so much longer than the mesh's own
# there, so that what is bright inside a triangle is not missed. So much shorter than those it is never made: there the
# exitance may step, at a crease of the surface.
STEP, OWN_STEP, DARK = 0.002, 0.05, 1e-4
COARSER, FINER = 2.0, 0.05
# Where splitting stops, beyond the triangles of the surface itself.
MOST_ADDED = 200_000


def surface_exitance(solution: ResolvedField) -> tuple[Surface, FloatArray]:
    """Exitance at the vertices of the surface that was solved for.

    Triangles too large to show how the exitance changes are split: the given vertices come first, in their order.

    Parameters
    ----------
    solution : Solution or ChargeSolution

    Returns
    -------
    surface : Surface
    exitance : (v,) ndarray
        At its vertices, W/unit².
    """
    given = solution.surface
    flat, faces, parents = given.points, given.faces, np.arange(len(given.faces))
    points, exitance = given.points, solution.exitance_on(given.points)
    places, size = solution.resolution
    tree = cKDTree(places)
    # Edges that were looked at and found short enough stay so.
    known = np.zeros((0, 2), dtype=np.int64)
    while len(flat) < len(given.points) + MOST_ADDED:
        edges = ends, edge = number_triangle_edges(faces)
        owner = np.empty(len(ends), dtype=np.int64)
        owner[edge.ravel()] = np.repeat(parents, 3)
        key, done = (e[:, 0] * np.int64(len(flat)) + e[:, 1] for e in (ends, known))
        new = np.flatnonzero(~np.isin(key, done))
        middles = flat[ends[new]].mean(axis=1)
        value = solution.exitance_on(given.on_curve(owner[new], middles)[0])
        brightest = max(exitance.max(), value.max(initial=0.0))
        step = np.where(value > DARK * brightest, np.minimum(STEP * brightest, OWN_STEP * value), STEP * brightest)
        off = np.abs(value - exitance[ends[new]].mean(axis=1)) > step
        lengths = np.linalg.norm(flat[ends[new, 0]] - flat[ends[new, 1]], axis=1)
        mesh_size = size[tree.query(middles)[1]]
        marked = np.zeros(len(ends), dtype=bool)
        marked[new] = (off & (lengths > FINER * mesh_size)) | (lengths > COARSER * mesh_size)
        if not marked.any():
            break
        known = np.vstack([known, ends[new[~marked[new]]]])
        marked = mark_longest_edges(flat, edges, marked)
        flat, faces, origin = split_edges(flat, faces, edges, marked)
        added, _ = given.on_curve(owner[marked], flat[len(points) :])
        parents = parents[origin]
        points, exitance = np.vstack([points, added]), np.concatenate([exitance, solution.exitance_on(added)])
    return replace(given, points=points, faces=faces, repairs=(), warnings=()), exitance
