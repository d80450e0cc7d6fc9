"""The first mesh: fine enough near sources for its error to be estimated at all."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from tetlux.fem.media.coefficients import AnyMedium, coefficients_on
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.host.blocks import THREADS
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.layers import REACH, add_layers
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

# Layers below a surface that light covers: the height of the first for a tolerance of .02, in depths over which the
# light decays to 1/e; by how much each is higher than the one above it, for each depth that it lies deeper; and the
# depth of the last. The error is proportional to the square of the heights.
FIRST_LAYER, LAYER_TOLERANCE, LAYER_GROWTH, DEEPEST_LAYER = 0.07, 0.02, 6.0, 30.0

# Layers become thinner by this factor where they are what limits the error.
THINNER = 0.7
# A node is lit if a place where light enters is nearer than this many times the distance between neighbouring ones.
NEAR_PLACES = 3.0
# Lateral size of tetrahedra that a curved surface needs, over its radius of curvature and the root of the tolerance.
LATERAL_SIZE = 1.0
# Nodes below a square of the resolution's size in a mesh of regular tetrahedra, over those of one layer there.
NODES_OF_REGULAR = 22.0
# Layers are made if they are expected to need at most this share of the nodes.
MUCH_SMALLER = 0.25
# Least spacing of places along creases, relative to the diagonal of the body.
LEAST_SPACING = 0.005


@dataclass(frozen=True, eq=False)
class Layers:
    """Layers of flat tetrahedra below the parts of a surface that light covers.

    Attributes
    ----------
    places : (p, 3) ndarray
        Where the light enters, unit.
    depth : float
        Over which the light decays to 1/e, unit.
    resolution : float
        Of a mesh without layers there, unit.
    tolerance : float
        Of the exitance.
    thinned : float
        The height of layers, relative to that for the tolerance.
    """

    places: FloatArray
    depth: float
    resolution: float
    tolerance: float
    thinned: float = 1.0

    @classmethod
    def for_lights(cls, deposits: Sequence[Deposit], tolerance: float) -> "Layers | None":
        """Those for some lights and a tolerance of the exitance; None if no light covers a surface."""
        covering = [deposit.hints for deposit in deposits if deposit.hints.depth > 0]
        if not covering:
            return None
        depth = min(hints.depth for hints in covering)
        resolution = min(hints.resolution for hints in covering)
        return cls(np.vstack([hints.places for hints in covering]), depth, resolution, tolerance)

    def serve(self, mesh: TetMesh, surface: Surface) -> bool:
        """Whether a mesh with layers is expected to be much smaller than one of regular tetrahedra."""
        lit = np.flatnonzero(self.lights(mesh.points[mesh.boundary_faces].mean(axis=1)))
        if len(lit) == 0:
            return False
        sides, areas = mesh.boundary_sides[lit], mesh.boundary_areas[lit]
        # A facet of a sphere is its side² over six radii away from it.
        radii = sides**2 / (6.0 * np.maximum(mesh.boundary_distances(surface, lit), 1e-9 * sides))
        lateral = np.minimum(sides, LATERAL_SIZE * np.sqrt(self.tolerance) * radii)
        count = len(self.depths[self.depths < REACH * sides.mean()])
        regular = NODES_OF_REGULAR * max(1.0, LAYER_TOLERANCE / self.tolerance) ** 1.25 * areas.sum() / self.resolution**2
        return bool(count * (areas / lateral**2).sum() < MUCH_SMALLER * regular)

    @property
    def depths(self) -> FloatArray:
        """Of the lower sides of the layers, (k,), unit."""
        fineness = self.thinned * np.sqrt(self.tolerance / LAYER_TOLERANCE)
        ratio = 1.0 + LAYER_GROWTH * FIRST_LAYER * fineness
        count = int(np.log1p(LAYER_GROWTH * DEEPEST_LAYER) / np.log(ratio))
        return np.asarray(self.depth / LAYER_GROWTH * (ratio ** np.arange(1, count + 1) - 1.0))

    def thinner(self) -> "Layers":
        """Layers of smaller heights."""
        return replace(self, thinned=THINNER * self.thinned)

    def lights(self, points: FloatArray) -> BoolArray:
        """Whether points of the surface (q, 3) are lit."""
        tree = cKDTree(self.places)
        gaps = tree.query(self.places, k=[2], workers=THREADS)[0]
        return np.asarray(tree.query(points, workers=THREADS)[0] < NEAR_PLACES * np.median(gaps))

    def places_at_creases(self, surface: Surface) -> FloatArray:
        """Places along lit creases, (c, 3), where light varies along the surface as fast as with depth."""
        ends = surface.creases
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        parts = np.ceil(lengths / max(self.depth, LEAST_SPACING * surface.diagonal)).astype(np.int64)
        own = np.repeat(np.arange(len(ends)), parts)
        along = (np.arange(len(own)) - np.repeat(np.cumsum(parts) - parts, parts) + 0.5) / parts[own]
        points = ends[own, 0] + along[:, None] * (ends[own, 1] - ends[own, 0])
        return points[self.lights(points)] if len(points) else points

    def on(self, mesh: TetMesh) -> tuple[TetMesh, IntArray]:
        """A mesh with the layers, and the tetrahedron of the mesh given that each of its tetrahedra belongs to, (m,)."""
        near = np.zeros(len(mesh.points), dtype=bool)
        near[mesh.boundary_nodes] = self.lights(mesh.boundary_points)
        return add_layers(mesh, self.depths, near)


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
