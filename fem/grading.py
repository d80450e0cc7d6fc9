"""The first mesh: fine enough, where light is deposited, for its error to be estimated at all."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from tetlux.fem.media.coefficients import AnyMedium, coefficients_on
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.host.blocks import THREADS
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.refine import refine

# Between light and detectors, edges are no longer than this times the length over which fluence fades to 1/e, for a
# tolerance of .01: the error of quadratic elements goes with its fourth power. Off the straight way light gets fainter
# by e^{-k excess}, with what its way is longer, and edges may be longer by the root of that.
FADING, AT_TOLERANCE = 1.5, 0.01
# So many lit points are looked at.
MOST_LIT = 32
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


def graded_between(
    mesh: TetMesh,
    surface: Surface,
    inner: Sequence[Surface],
    media: Sequence[AnyMedium],
    lit: FloatArray,
    seen: FloatArray,
    tolerance: float,
    most: int,
) -> TetMesh:
    """Split tetrahedra that are too coarse for light that fades on its way to detectors.

    Parameters
    ----------
    mesh : TetMesh
    surface : Surface
        New boundary nodes are moved onto it.
    inner : sequence of Surface
        Those of the mesh's regions.
    media : sequence of medium
        Of the body and of its regions.
    lit, seen : (s, 3), (d, 3) ndarray
        Where light is deposited, and where it is read.
    tolerance : float
        Of readings.
    most : int
        Tetrahedra at which it stops.

    Returns
    -------
    TetMesh
    """
    some = lit[:: -(-len(lit) // MOST_LIT)] if len(lit) else lit
    lengths = cdist(some, seen)
    while len(some):
        coefficients = coefficients_on(mesh, media)
        decay = np.broadcast_to(np.sqrt(coefficients.sigma_a / coefficients.diffusion), len(mesh.tetrahedra))
        middles = mesh.points[mesh.tetrahedra].mean(axis=1)
        from_light, to_detector = cdist(middles, some), cdist(middles, seen)
        excess = np.full(len(middles), np.inf)
        for light, length in enumerate(lengths):
            excess = np.minimum(excess, (from_light[:, [light]] + to_detector - length).min(axis=1))
        wanted = FADING * (tolerance / AT_TOLERANCE) ** 0.25 * np.exp(0.25 * decay * excess)
        marked = mesh.longest_edges * decay > wanted
        if not marked.any():
            break
        finer = refine(mesh, marked, surface, inner)
        if len(finer.tetrahedra) > most:
            break
        mesh = finer
    return mesh
