"""The first mesh: fine enough near sources for its error to be estimated at all."""

from collections.abc import Sequence
from dataclasses import replace

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

# Longest edge between sources and detectors for a tolerance of .01, in lengths over which fluence fades to 1/e. The
# error of quadratic elements is proportional to its fourth power. A path that is longer than the straight one by an
# excess carries e^{-k excess} of the light; edges there may be longer by the fourth root of that.
FADING, AT_TOLERANCE = 1.5, 0.01
# At a detector, where its dual solution is steep, edges are shorter by AT_DETECTOR; the factor grows to 1 at the
# distance NEAR_DETECTOR, in lengths over which fluence fades to 1/e.
AT_DETECTOR, NEAR_DETECTOR = 0.4, 2.0
# If there are more source points than this, every second, third, ... is taken.
MOST_SOURCE_POINTS = 32
# Longest edge of a tetrahedron on the first mesh, relative to its distance from the nearest source, or to the length
# to resolve there if that is larger. The error then is some per cent, and its estimate good to a factor of three.
LONGEST_EDGE = 1.0
# Where charges are fitted the error needs no such edges, but values at nodes should show the light: 10 to 60 % more
# nodes than the mesher's own.
LONGEST_IF_FITTED = 1.5


def places_to_resolve(deposits: Sequence[Deposit]) -> tuple[FloatArray, FloatArray]:
    """Places near which the mesh has to be fine.

    Parameters
    ----------
    deposits : sequence of Deposit

    Returns
    -------
    places : (s, 3) ndarray
        Points of the source terms and places of the mesh hints, each once, unit.
    resolutions : (s,) ndarray
        Length to resolve at each, unit; the shortest if several deposits have the same place.
    """
    found, resolutions = [np.zeros((0, 3))], [np.zeros(0)]
    for deposit in deposits:
        points = np.vstack([deposit.terms.points, deposit.hints.places])
        found.append(points)
        resolutions.append(np.full(len(points), deposit.hints.resolution))
    places, finest = np.vstack(found), np.concatenate(resolutions)
    order = np.lexsort((finest, *places.T))
    first = (np.diff(places[order], axis=0, prepend=np.inf) != 0).any(axis=1)
    return places[order[first]], finest[order[first]]


def grade_mesh(
    mesh: TetMesh,
    surface: Surface,
    points: FloatArray,
    resolutions: FloatArray,
    most: int,
    *,
    longest: float = LONGEST_EDGE,
    inner: Sequence[Surface] = (),
) -> TetMesh:
    """Refine a mesh until its edges are short compared with their distance from the nearest source.

    Parameters
    ----------
    mesh : TetMesh
    surface : Surface
        New boundary nodes are moved onto it.
    points, resolutions : (s, 3), (s,) ndarray
        See `places_to_resolve`.
    most : int
        Largest number of tetrahedra; a refinement that would exceed it is not made.
    longest : float
        Longest edge relative to the distance of the tetrahedron's middle from each point, or to the resolution there if
        that is larger.
    inner : sequence of Surface
        Surfaces of the mesh's regions; new nodes on them are moved onto them.

    Returns
    -------
    TetMesh
    """
    if len(points) == 0:
        return mesh
    # Each place has to be resolved, also where one of another resolution is nearer.
    trees = {finest: cKDTree(points[resolutions == finest]) for finest in np.unique(resolutions).tolist()}
    while True:
        long = np.flatnonzero(mesh.longest_edges > longest * resolutions.min())
        middles = mesh.points.take(mesh.tetrahedra[long], axis=0).mean(axis=1)
        allowed = np.full(len(long), np.inf)
        for finest, tree in trees.items():
            allowed = np.minimum(allowed, np.maximum(tree.query(middles, workers=THREADS)[0], finest))
        marked = np.zeros(len(mesh.tetrahedra), dtype=bool)
        marked[long] = mesh.longest_edges[long] > longest * allowed
        if not marked.any():
            return mesh
        finer = refine(mesh, marked, surface, inner)
        if len(finer.tetrahedra) > most:
            return mesh
        mesh = finer


def grade_between(
    mesh: TetMesh,
    surface: Surface,
    inner: Sequence[Surface],
    media: Sequence[AnyMedium],
    ways: Sequence[tuple[FloatArray, FloatArray]],
    tolerance: float,
    most: int,
    shift: complex = 0.0,
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
    ways : sequence of pairs of (s, 3), (d, 3) ndarray
        Where light is deposited, and where it is read.
    tolerance : float
        Of readings.
    most : int
        Tetrahedra at which it stops.
    shift : complex
        What is added to sigma_a, 1/unit: 0 for steady light.

    Returns
    -------
    TetMesh
    """
    some = [(points[:: max(1, -(-len(points) // MOST_SOURCE_POINTS))], detectors) for points, detectors in ways]
    while any(len(points) for points, _ in some):
        coefficients = replace(coefficients_on(mesh, media), shift=shift)
        decay = np.broadcast_to(coefficients.decay, len(mesh.tetrahedra))
        middles = mesh.points[mesh.tetrahedra].mean(axis=1)
        excess, nearest = np.full((2, len(middles)), np.inf)
        for points, detectors in some:
            to_detector = cdist(middles, detectors)
            nearest = np.minimum(nearest, to_detector.min(axis=1))
            for from_light, length in zip(cdist(points, middles), cdist(points, detectors), strict=True):
                excess = np.minimum(excess, from_light + (to_detector - length).min(axis=1))
        wanted = FADING * (tolerance / AT_TOLERANCE) ** 0.25 * np.exp(0.25 * decay * excess)
        near = decay * nearest / NEAR_DETECTOR
        wanted *= np.minimum(AT_DETECTOR + (1.0 - AT_DETECTOR) * near, 1.0)
        marked = mesh.longest_edges * decay > wanted
        if not marked.any():
            break
        finer = refine(mesh, marked, surface, inner)
        if len(finer.tetrahedra) > most:
            break
        mesh = finer
    return mesh
