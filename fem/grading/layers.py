"""Layers of flat tetrahedra below the parts of a surface that light covers.

A wide beam decays over a mean free path, and along the surface it varies as slowly as the surface bends. Regular
tetrahedra that resolve that depth grow in number with the square of the body's size; layers do not.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.host.blocks import THREADS
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.layers import REACH, add_layers
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.refine import refine_often

# Layers below a surface that light covers: the height of the first for a tolerance of .02, in depths over which the
# light decays to 1/e; by how much each is higher than the one above it, for each depth that it lies deeper; and the
# depth of the last. The error is proportional to the square of the heights.
FIRST_LAYER, LAYER_TOLERANCE, LAYER_GROWTH, DEEPEST_LAYER = 0.4, 0.02, 1.5, 30.0
# Layers that limit the error become thinner, down to this share of their height.
THINNEST = 0.05
# A node is lit if a place where light enters is nearer than this many times the distance between neighbouring ones.
NEAR_PLACES = 3.0
# Lateral size of tetrahedra that a curved surface needs, over its radius of curvature and the root of the tolerance.
LATERAL_SIZE = 1.0
# Nodes below a square of the resolution's size in a mesh of regular tetrahedra, over those of one layer there.
NODES_OF_REGULAR = 22.0
# Layers are made if they are expected to need at most this share of the nodes.
MUCH_SMALLER = 0.25
# Sizes of tetrahedra at creases and at rims, in the resolution without layers.
CREASE_SIZE, RIM_SIZE = 2.0, 1.0
# Least spacing of places along creases, relative to the diagonal of the body.
LEAST_SPACING = 0.005


@dataclass(frozen=True, eq=False)
class Layers:
    """Layers of flat tetrahedra below the parts of a surface that light covers.

    Attributes
    ----------
    places : (p, 3) ndarray
        Where the light enters, unit.
    rims : (r, 3) ndarray
        Where it varies along the surface as fast as with depth, unit.
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
    rims: FloatArray
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
        places, rims = (np.vstack(each) for each in zip(*((h.places, h.rims) for h in covering), strict=True))
        return cls(places, rims, depth, resolution, tolerance)

    def serve(self, mesh: TetMesh, surface: Surface, most: int) -> bool:
        """Whether a mesh with layers is expected to be much smaller than one of regular tetrahedra, and than `most`."""
        lit = np.flatnonzero(self.lights(mesh.points[mesh.boundary_faces].mean(axis=1)))
        if len(lit) == 0:
            return False
        sides, areas = mesh.boundary_sides[lit], mesh.boundary_areas[lit]
        # A facet of a sphere is its side² over six radii away from it.
        radii = sides**2 / (6.0 * np.maximum(mesh.boundary_distances(surface, lit), 1e-9 * sides))
        lateral = np.minimum(sides, LATERAL_SIZE * np.sqrt(self.tolerance) * radii)
        count = len(self.depths[self.depths < REACH * sides.mean()])
        regular = (
            NODES_OF_REGULAR * max(1.0, LAYER_TOLERANCE / self.tolerance) ** 1.25 * areas.sum() / self.resolution**2
        )
        if count * (areas / lateral**2).sum() >= MUCH_SMALLER * regular:
            return False
        return len(self.on(mesh)[0].tetrahedra) < MUCH_SMALLER * most

    @property
    def depths(self) -> FloatArray:
        """Of the lower sides of the layers, (k,), unit."""
        fineness = self.thinned * np.sqrt(self.tolerance / LAYER_TOLERANCE)
        ratio = 1.0 + LAYER_GROWTH * FIRST_LAYER * fineness
        count = int(np.log1p(LAYER_GROWTH * DEEPEST_LAYER) / np.log(ratio))
        return np.asarray(self.depth / LAYER_GROWTH * (ratio ** np.arange(1, count + 1) - 1.0))

    def scaled(self, factor: float) -> "Layers":
        """Layers of smaller heights, or the same if these are the least."""
        thinned = max(factor * self.thinned, THINNEST)
        return replace(self, thinned=thinned) if thinned < self.thinned else self

    def lights(self, points: FloatArray) -> BoolArray:
        """Whether points of the surface (q, 3) are lit."""
        tree, near = self._tree
        return np.asarray(tree.query(points, workers=THREADS)[0] < near)

    @cached_property
    def _tree(self) -> tuple[cKDTree, float]:
        """A tree of the places, and how near one of them a point has to be to be lit, unit."""
        tree = cKDTree(self.places)
        gaps = tree.query(self.places, k=[2], workers=THREADS)[0]
        return tree, NEAR_PLACES * float(np.median(gaps))

    def places_without(self, surface: Surface) -> tuple[FloatArray, FloatArray]:
        """Rims and lit creases (c, 3), for which layers do not serve, and the lengths to resolve there, (c,)."""
        ends = surface.creases.ends if surface.creases else np.empty((0, 2, 3))
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        parts = np.ceil(lengths / max(self.depth, LEAST_SPACING * surface.diagonal)).astype(np.int64)
        own = np.repeat(np.arange(len(ends)), parts)
        along = (np.arange(len(own)) - np.repeat(np.cumsum(parts) - parts, parts) + 0.5) / parts[own]
        points = ends[own, 0] + along[:, None] * (ends[own, 1] - ends[own, 0])
        if len(points):
            points = points[self.lights(points)]
        sizes = np.repeat([CREASE_SIZE, RIM_SIZE], [len(points), len(self.rims)])
        return np.vstack([points, self.rims]), sizes * self.resolution

    def on(self, mesh: TetMesh) -> tuple[TetMesh, IntArray]:
        """A mesh with the layers, and what each of its tetrahedra belongs to: see `add_layers`."""
        near = np.zeros(len(mesh.points), dtype=bool)
        near[mesh.boundary_nodes] = self.lights(mesh.boundary_points)
        return add_layers(mesh, self.depths, near)


def with_layers(mesh: TetMesh, layers: Layers | None) -> tuple[TetMesh, IntArray]:
    """A mesh with layers, if there are any, and what each of its tetrahedra belongs to: see `Layers.on`."""
    return (mesh, np.arange(len(mesh.tetrahedra))) if layers is None else layers.on(mesh)


def refine_below(
    mesh: TetMesh,
    parents: IntArray,
    splits: IntArray,
    surfaces: tuple[Surface, Sequence[Surface]],
    most: int,
    layers: Layers | None,
) -> tuple[TetMesh, TetMesh, IntArray]:
    """Refine the mesh below layers.

    Parameters
    ----------
    mesh : TetMesh
    parents : (m,) ndarray
        What each tetrahedron of the mesh with layers belongs to.
    splits : (m,) ndarray of int
        How often each of these has to be split.
    surfaces : Surface and sequence of Surface
        Of the body, and of its regions.
    most : int
        Number of tetrahedra at which refinement stops.
    layers : Layers, optional

    Returns
    -------
    below, finer : TetMesh
        The refined mesh, and it with layers.
    parents : ndarray
        What each tetrahedron of the latter belongs to.
    """
    own = np.zeros(len(mesh.tetrahedra), dtype=np.int64)
    np.maximum.at(own, parents, splits)
    below = refine_often(mesh, own, *surfaces, most)
    return below, *with_layers(below, layers)
