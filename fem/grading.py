"""The first mesh: fine enough, where light is deposited, for its error to be estimated at all."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.host.blocks import THREADS
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.refine import refine

# Edges on the first mesh are no longer than this times the distance from the light, or times what resolves it
# where they are at it. Its error then is some per cent, and its estimate good to a factor of three.
LONGEST = 1.0


def lit_points(deposits: list[Deposit]) -> tuple[FloatArray, FloatArray]:
    """Points where light is deposited, or is lit (s, 3), and the length to resolve at each (s,)."""
    found, resolutions = [np.zeros((0, 3))], [np.zeros(0)]
    for deposit in deposits:
        points = np.vstack([deposit.points, deposit.lit])
        found.append(points)
        resolutions.append(np.full(len(points), deposit.resolution))
    places, finest = np.vstack(found), np.concatenate(resolutions)
    # The same light in several media is at the same places, where the finest has its way.
    order = np.lexsort((finest, *places.T))
    new = (np.diff(places[order], axis=0, prepend=np.inf) != 0).any(axis=1)
    return places[order[new]], finest[order[new]]


def graded_towards(
    mesh: TetMesh,
    surface: Surface,
    points: FloatArray,
    resolutions: FloatArray,
    most: int,
    *,
    longest: float = LONGEST,
    inner: Sequence[Surface] = (),
) -> TetMesh:
    """Split tetrahedra until none is longer than `longest` times its distance from the light.

    Parameters
    ----------
    mesh : TetMesh
    surface : Surface
        New boundary nodes are moved onto it.
    points, resolutions : (s, 3), (s,) ndarray
        See `lit_points`.
    most : int
        Tetrahedra at which it stops.
    longest : float
    inner : sequence of Surface
        Those of the mesh's regions; new nodes on them are moved onto them.

    Returns
    -------
    TetMesh
    """
    if len(points) == 0:
        return mesh
    tree = cKDTree(points)
    while True:
        long = np.flatnonzero(mesh.longest_edges > longest * resolutions.min())
        middles = mesh.points.take(mesh.tetrahedra[long], axis=0).mean(axis=1)
        distance, nearest = tree.query(middles, workers=THREADS)
        marked = np.zeros(len(mesh.tetrahedra), dtype=bool)
        marked[long] = mesh.longest_edges[long] > longest * np.maximum(distance, resolutions[nearest])
        if not marked.any():
            return mesh
        finer = refine(mesh, marked, surface, inner)
        if len(finer.tetrahedra) > most:
            return mesh
        mesh = finer
