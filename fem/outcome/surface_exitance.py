"""Exitance on the user's own surface, to be written or drawn."""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.outcome.exitance_field import ResolvedField
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, freeze
from tetlux.meshing.surface.subdivide import mark_longest_edges, number_triangle_edges, split_edges
from tetlux.meshing.surface.surface import Surface

# An edge is split if the exitance in its middle is off the mean of its ends by more than a share of the largest
# exitance, or by a share of itself where it is not too dark to see; and while it is so much longer than the mesh's own
# there, so that what is bright inside a triangle is not missed. So much shorter than those it is never made: there the
# exitance may step, at a crease of the surface. The first share is this part of the solution's estimated error, within
# limits: finer steps would show its noise, by four times as many vertices in sunlight at a tolerance of 0.05.
STEP_PER_ERROR, STEP, MOST_STEP = 0.2, 0.002, 0.01
OWN_STEP, DARK = 0.05, 1e-4
COARSER, FINER = 2.0, 0.05
# Where splitting stops, beyond the triangles of the surface itself.
MOST_ADDED = 200_000
# An edge's two nodes are one number: the first times two to this, plus the second.
NODE_BITS = 32


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
    points = freeze(given.points.copy())
    exitance = solution.exitance_on(points)
    splits = _Splits(solution)
    while len(flat) < len(given.points) + MOST_ADDED:
        edges = ends, edge = number_triangle_edges(faces)
        owner = np.empty(len(ends), dtype=np.int64)
        owner[edge.ravel()] = np.repeat(parents, 3)
        marked, places, values = splits.choose(flat, edges, owner, exitance)
        if not marked.any():
            break
        flat, faces, origin = split_edges(flat, faces, edges, marked)
        parents = parents[origin]
        points, exitance = np.vstack([points, places]), np.concatenate([exitance, values])
    return replace(given, points=freeze(points), faces=faces, repairs=(), warnings=()), exitance


class _Splits:
    """Chooses the edges of triangles that are split, round by round; each edge is looked at once."""

    def __init__(self, solution: ResolvedField) -> None:
        self._solution = solution
        places, self._sizes = solution.resolution
        self._tree = cKDTree(places)
        # Comparisons with nan are false.
        wanted = STEP_PER_ERROR * solution.error_estimate
        self._step = min(wanted, MOST_STEP) if wanted > STEP else STEP
        # Edges that were found short enough, by the nodes at their ends.
        self._short = np.zeros(0, dtype=np.int64)

    def choose(
        self, flat: FloatArray, edges: tuple[IntArray, IntArray], owner: IntArray, exitance: FloatArray
    ) -> tuple[BoolArray, FloatArray, FloatArray]:
        """Choose edges to split.

        Parameters
        ----------
        flat : (n, 3) ndarray
            Vertices on the given triangles.
        edges : tuple of ndarray
            From `number_triangle_edges`.
        owner : (e,) ndarray
            A given triangle that each edge lies on.
        exitance : (n,) ndarray
            At the vertices, W/unit².

        Returns
        -------
        marked : (e,) ndarray of bool
        places : (s, 3) ndarray
            Middles of the marked edges, on the smooth surface.
        values : (s,) ndarray
            Exitance there, W/unit².
        """
        ends, _ = edges
        key = (ends[:, 0] << NODE_BITS) + ends[:, 1]
        row = np.minimum(np.searchsorted(self._short, key), max(len(self._short) - 1, 0))
        new = np.flatnonzero(self._short[row] != key) if len(self._short) else np.arange(len(ends))
        places, values = np.empty((len(ends), 3)), np.full(len(ends), np.nan)
        places[new], values[new] = self._middles(flat, ends[new], owner[new])
        marked = np.zeros(len(ends), dtype=bool)
        marked[new] = self._are_long(flat, ends[new], values[new], exitance)
        self._short = np.sort(np.concatenate([self._short, key[new[~marked[new]]]]))
        if marked.any():
            marked = mark_longest_edges(flat, edges, marked)
            looked_at = np.zeros(len(ends), dtype=bool)
            looked_at[new] = True
            late = np.flatnonzero(marked & ~looked_at)
            places[late], values[late] = self._middles(flat, ends[late], owner[late])
        return marked, places[marked], values[marked]

    def _middles(self, flat: FloatArray, ends: IntArray, owner: IntArray) -> tuple[FloatArray, FloatArray]:
        """Middles (k, 3) of edges (k, 2) on the smooth surface, and the exitance there, (k,)."""
        # Several lights and channels are evaluated there.
        places = freeze(self._solution.surface.on_curve(owner, flat[ends].mean(axis=1))[0])
        return places, self._solution.exitance_on(places)

    def _are_long(self, flat: FloatArray, ends: IntArray, values: FloatArray, exitance: FloatArray) -> BoolArray:
        """Whether edges (k, 2) are too long to show how the exitance changes, given that in their middles, (k,)."""
        brightest = max(exitance.max(), values.max(initial=0.0))
        step = np.where(values > DARK * brightest, np.minimum(self._step * brightest, OWN_STEP * values), np.inf)
        step = np.minimum(step, self._step * brightest)
        off = np.abs(values - exitance[ends].mean(axis=1)) > step
        lengths = np.linalg.norm(flat[ends[:, 0]] - flat[ends[:, 1]], axis=1)
        mesh_size = self._sizes[self._tree.query(flat[ends].mean(axis=1))[1]]
        return np.asarray((off & (lengths > FINER * mesh_size)) | (lengths > COARSER * mesh_size))
