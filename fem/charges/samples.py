"""Points on a surface at a variable spacing, for charges and equations.

The surface is cut into cells about as large as the wanted spacing. Candidates are drawn from the cells in proportion to
area over the square of the spacing, and then thinned: a candidate stays unless an earlier one that stays is too near
(Poisson-disc sampling by dart throwing; with a radius that varies, Mitchell et al. 2012). Points on opposite sides of a
plate, whose normals point away from each other, do not thin each other.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, sum_by_index
from tetlux.meshing.surface.subdivide import quarter_triangles
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides

# Candidates in each square of the spacing.
CANDIDATES_PER_SQUARE = 4.0
# Least distance between two points that stay, over the spacing.
LEAST_SEPARATION = 0.8
# Nearest candidates that may remove one; within the least distance there are 8 on average.
CHECKED_NEIGHBOURS = 20
# Longest side of a cell, over the spacing in its middle.
LARGEST_CELL = 1.5
_MOST_CUTS = 40

# The wanted distance between points (n, 3) of the surface, (n,), unit.
Spacing = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Samples:
    """Points of the smooth surface.

    Attributes
    ----------
    points, normals : (n, 3) ndarray
        Outward unit normals.
    areas : (n,) ndarray
        Quadrature weight of each, unit².
    spacing : (n,) ndarray
        Wanted distance to the next one, unit.
    """

    points: FloatArray
    normals: FloatArray
    areas: FloatArray
    spacing: FloatArray

    @cached_property
    def tree(self) -> cKDTree:
        """Of the points."""
        return cKDTree(self.points)

    def __getitem__(self, some: BoolArray | IntArray) -> "Samples":
        return Samples(self.points[some], self.normals[some], self.areas[some], self.spacing[some])

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class Cells:
    """Parts of a surface's triangles.

    Attributes
    ----------
    faces : (m,) ndarray
        The triangle of each.
    corners : (m, 3, 3) ndarray
    spacing : (m,) ndarray
        Wanted distance between points there, unit.
    """

    faces: IntArray
    corners: FloatArray
    spacing: FloatArray

    @property
    def areas(self) -> FloatArray:
        """Their areas (m,), unit²."""
        first, second = (self.corners[:, i] - self.corners[:, 0] for i in (1, 2))
        return np.asarray(0.5 * np.linalg.norm(np.cross(first, second), axis=1))

    @property
    def sample_count(self) -> float:
        """Number of points: squares of the spacing that fit into the cells."""
        return float((self.areas / self.spacing**2).sum())

    def scaled(self, scale: float) -> "Cells":
        """The same cells for a spacing times a factor."""
        return replace(self, spacing=scale * self.spacing)

    def cut(self, spacing: Spacing, size: float = LARGEST_CELL) -> "Cells":
        """Cut cells in four until none is longer than `size` times the spacing in its middle."""
        faces, corners, wanted = self.faces, self.corners, self.spacing
        done: list[tuple[IntArray, FloatArray, FloatArray]] = []
        for cut in range(_MOST_CUTS + 1):
            small = (longest_sides(corners) <= size * wanted) | (cut == _MOST_CUTS)
            done.append((faces[small], corners[small], wanted[small]))
            if small.all():
                break
            faces, corners = np.repeat(faces[~small], 4), quarter_triangles(corners[~small])
            wanted = spacing(corners.mean(axis=1))
        faces, corners, wanted = (np.concatenate(part) for part in zip(*done, strict=True))
        # Parts of one triangle become neighbours, so that stratified drawing covers each triangle evenly.
        order = np.argsort(faces, kind="stable")
        return Cells(faces[order], corners[order], wanted[order])


def cells_of(surface: Surface, spacing: Spacing) -> Cells:
    """The triangles of a surface."""
    corners = surface.points[surface.faces]
    return Cells(np.arange(len(corners)), corners, spacing(corners.mean(axis=1)))


def draw(surface: Surface, cells: Cells, rng: np.random.Generator) -> Samples:
    """Draw `CANDIDATES_PER_SQUARE` points from each square of the spacing."""
    squares = cells.areas / cells.spacing**2
    drawn = np.diff(np.floor(np.cumsum(squares) * CANDIDATES_PER_SQUARE + rng.random()), prepend=0.0)
    own = np.repeat(np.arange(len(squares)), drawn.astype(np.int64))
    first, second = rng.random((2, len(own)))
    root = np.sqrt(first)
    weights = np.column_stack([1.0 - root, root * (1.0 - second), root * second])
    flat = np.einsum("qi,qij->qj", weights, cells.corners[own])
    points, normals = surface.on_curve(cells.faces[own], flat)
    wanted = cells.spacing[own]
    return Samples(points, normals, wanted**2 / CANDIDATES_PER_SQUARE, wanted)


def thin(samples: Samples, radii: FloatArray) -> BoolArray:
    """Whether each sample stays, (n,), so that none lies within the radius (n,) of an earlier one."""
    count = len(samples)
    if count < 2:
        return np.ones(count, dtype=bool)
    tree = cKDTree(samples.points)
    found = tree.query(samples.points, k=min(CHECKED_NEIGHBOURS, count))
    distance, near = np.asarray(found[0])[:, 1:], np.asarray(found[1])[:, 1:]
    close = distance < np.minimum(radii[:, None], radii[near])
    close &= np.einsum("ij,ikj->ik", samples.normals, samples.normals[near]) > 0.0
    first, place = np.nonzero(close)
    second = near[first, place]
    earlier = second < first
    late, early = first[earlier], second[earlier]
    kept, open_ = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
    while open_.any():
        # A sample stays once all earlier samples near it are removed.
        waiting = np.zeros(count, dtype=bool)
        waiting[late[open_[early]]] = True
        stays = open_ & ~waiting
        kept |= stays
        open_ &= ~stays
        gone = late[stays[early]]
        open_[gone] = False
    return kept


def spread(surface: Surface, cells: Cells, rng: np.random.Generator) -> tuple[Samples, Samples]:
    """Points about a spacing apart, in random order, and the candidates that were removed."""
    drawn = draw(surface, cells, rng)
    drawn = drawn[rng.permutation(len(drawn))]
    kept = thin(drawn, LEAST_SEPARATION * drawn.spacing)
    chosen = drawn[kept]
    nearest = np.asarray(cKDTree(chosen.points).query(drawn.points)[1])
    return replace(chosen, areas=sum_by_index(nearest, drawn.areas, len(chosen))), drawn[~kept]
