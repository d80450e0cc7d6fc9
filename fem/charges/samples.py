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
from tetlux.meshing.surface.groups import bisect
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides

# Candidates in each square of the spacing.
CANDIDATES_PER_SQUARE = 4.0
# Least distance between two points that stay, over the spacing.
LEAST_SEPARATION = 0.8
# Nearest candidates that may remove one; within the least distance there are 8 on average.
CHECKED_NEIGHBOURS = 20
# Radii within the inverse of this power of two are searched together: 9 ms for 5,400 candidates, with one search of all
# neighbours 16.
RADII_PER_OCTAVE = 2
# Longest side of a cell, over the spacing in its middle.
LARGEST_CELL = 1.5
_MOST_CUTS = 80
# Number of nearest points from which a spacing is interpolated.
INTERPOLATED_NEIGHBOURS = 3
# A spacing that differs by more than this factor over the surface is limited: from a point to the next it grows by no
# more than their distance, as that of the first fit does. Otherwise a large cell could hide a spot where it is small.
LARGEST_CONTRAST = 1e3

# The wanted distance between points (n, 3) of the surface, (n,), unit.
Spacing = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class InterpolatedSpacing:
    """A spacing between points at which it is known.

    Attributes
    ----------
    tree : cKDTree
        Of the points.
    logarithms : (n,) ndarray
        Of the spacing at the points, unit.
    near : (n, k) ndarray
        Numbers of the nearest points of each, itself among them.
    apart : (n, k) ndarray
        How far they are away, unit.
    """

    tree: cKDTree
    logarithms: FloatArray
    near: IntArray
    apart: FloatArray

    def __call__(self, points: FloatArray) -> FloatArray:
        """The spacing at points (q, 3), (q,), unit."""
        _, around = self.tree.query(points, k=min(INTERPOLATED_NEIGHBOURS, len(self.logarithms)))
        columns = np.asarray(around).reshape(len(points), -1).T
        # Column by column, which is faster than the mean of short rows.
        return np.asarray(np.exp(sum(self.logarithms[column] for column in columns) / len(columns)))

    def scaled(self, scale: float) -> "InterpolatedSpacing":
        """The spacing times a factor; one that differs much grows by no more than the distance between points."""
        logarithms = self.logarithms + np.log(scale)
        if np.ptp(logarithms) > np.log(LARGEST_CONTRAST):
            logarithms = np.log(_grow_slowly(np.exp(logarithms), self.near, self.apart))
        return replace(self, logarithms=logarithms)


def _grow_slowly(spacing: FloatArray, near: IntArray, apart: FloatArray) -> FloatArray:
    """The largest spacing (n,), not above a given one, that grows by no more than distances of neighbours (n, k)."""
    while True:
        limited: FloatArray = np.minimum(spacing, (spacing[near] + apart).min(axis=1))
        if np.array_equal(limited, spacing):
            return limited
        spacing = limited


def scaled(spacing: Spacing, scale: float) -> Spacing:
    """A spacing times a factor."""
    if isinstance(spacing, InterpolatedSpacing):
        return spacing.scaled(scale)
    return lambda points: scale * spacing(points)


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
    """Parts of a surface: pieces of its triangles, cut where they are large, and groups of them where they are small.

    Attributes
    ----------
    surface : Surface
    starts, ends : (m,) ndarray
        The pieces of `surface.groups` that each holds.
    corners : (m, 3, 3) ndarray
        Of a cell that is a part of one piece.
    centroids : (m, 3) ndarray
    areas : (m,) ndarray
        Of the smooth surface, unit².
    spacing : (m,) ndarray
        Wanted distance between points there, unit.
    """

    surface: Surface
    starts: IntArray
    ends: IntArray
    corners: FloatArray
    centroids: FloatArray
    areas: FloatArray
    spacing: FloatArray

    @property
    def is_group(self) -> BoolArray:
        """Whether each holds several pieces, (m,)."""
        return self.ends > self.starts + 1

    @property
    def faces(self) -> IntArray:
        """The triangle of each, (m,); one of several of a group."""
        return self.surface.groups.faces[self.starts]

    @property
    def sample_count(self) -> float:
        """Number of points: squares of the spacing that fit into the cells."""
        return float((self.areas / self.spacing**2).sum())


def cells_of(surface: Surface, spacing: Spacing, size: float = LARGEST_CELL, piece_size: float | None = None) -> Cells:
    """Cells of a surface, by spacings in their middles.

    Parameters
    ----------
    surface : Surface
    spacing : callable
    size : float
        Largest size of a group of triangles, in spacings.
    piece_size : float, optional
        Longest side of a part of one triangle, in spacings; `size` if not given.
    """
    groups = surface.groups
    starts, ends, centroids, wanted = [], [], [], []
    some = np.arange(len(groups.levels[0].starts))
    for level in groups.levels:
        own = level.centroids[some]
        apart = spacing(own)
        done = (level.sizes[some] <= size * apart) | (level.ends[some] == level.starts[some] + 1)
        starts.append(level.starts[some[done]])
        ends.append(level.ends[some[done]])
        centroids.append(own[done])
        wanted.append(apart[done])
        some = some[~done]
        if len(some) == 0:
            break
        first, count = level.children[some], level.children[some + 1] - level.children[some]
        some = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
    first, last = np.concatenate(starts), np.concatenate(ends)
    return _cut_pieces(
        Cells(
            surface,
            first,
            last,
            groups.corners[first],
            np.concatenate(centroids),
            groups.total_areas[last] - groups.total_areas[first],
            np.concatenate(wanted),
        ),
        spacing,
        size if piece_size is None else piece_size,
    )


def _cut_pieces(cells: Cells, spacing: Spacing, size: float) -> Cells:
    """Cut cells that are parts of one piece in two until none is longer than `size` times the spacing."""
    done: list[tuple[FloatArray | IntArray, ...]] = []
    whole = cells.is_group
    rest = (cells.starts, cells.ends, cells.corners, cells.centroids, cells.areas, cells.spacing)
    for cut in range(_MOST_CUTS + 1):
        small = whole | (longest_sides(rest[2]) <= size * rest[5]) | (cut == _MOST_CUTS)
        done.append(tuple(part[small] for part in rest))
        if small.all():
            break
        corners = bisect(rest[2][~small])
        first, last = (np.repeat(part[~small], 2) for part in rest[:2])
        middles: FloatArray = np.asarray(corners.mean(axis=1))
        areas: FloatArray = np.asarray(np.repeat(0.5 * rest[4][~small], 2))
        rest = (first, last, corners, middles, areas, spacing(middles))
        whole = np.zeros(len(corners), dtype=bool)
    parts = [np.concatenate(part) for part in zip(*done, strict=True)]
    # Neighbours follow each other, so that stratified drawing covers the surface evenly.
    order = np.argsort(parts[0], kind="stable")
    return Cells(cells.surface, *(part[order] for part in parts))


def draw(cells: Cells, rng: np.random.Generator) -> Samples:
    """Draw `CANDIDATES_PER_SQUARE` points from each square of the spacing."""
    squares = cells.areas / cells.spacing**2
    drawn = np.diff(np.floor(np.cumsum(squares) * CANDIDATES_PER_SQUARE + rng.random()), prepend=0.0)
    own = np.repeat(np.arange(len(squares)), drawn.astype(np.int64))
    first, second, third = rng.random((3, len(own)))
    root = np.sqrt(first)
    weights = np.column_stack([1.0 - root, root * (1.0 - second), root * second])
    corners, faces = cells.corners[own], cells.faces[own]
    grouped, groups = np.flatnonzero(cells.is_group[own]), cells.surface.groups
    inside = own[grouped]
    at = groups.total_areas[cells.starts[inside]] + third[grouped] * cells.areas[inside]
    piece = np.clip(np.searchsorted(groups.total_areas, at) - 1, cells.starts[inside], cells.ends[inside] - 1)
    corners[grouped], faces[grouped] = groups.corners[piece], groups.faces[piece]
    points, normals = cells.surface.on_curve(faces, np.einsum("qi,qij->qj", weights, corners))
    wanted = cells.spacing[own]
    return Samples(points, normals, wanted**2 / CANDIDATES_PER_SQUARE, wanted)


def thin(samples: Samples, radii: FloatArray) -> BoolArray:
    """Whether each sample stays, (n,), so that none lies within the radius (n,) of an earlier one."""
    count = len(samples)
    if count < 2:
        return np.ones(count, dtype=bool)
    late, early = _close_pairs(samples.points, radii)
    facing = np.einsum("ij,ij->i", samples.normals[late], samples.normals[early]) > 0.0
    late, early = late[facing], early[facing]
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


def _close_pairs(points: FloatArray, radii: FloatArray) -> tuple[IntArray, IntArray]:
    """Pairs of points (n, 3) nearer to each other than the radii (n,) of both: the later and the earlier of each.

    Points are asked for their neighbours in groups of like radii, beyond which no search needs to go.
    """
    tree, most, pairs = cKDTree(points), min(CHECKED_NEIGHBOURS, len(points)), []
    classes = np.floor(RADII_PER_OCTAVE * np.log2(radii))
    for each in np.unique(classes):
        some = np.flatnonzero(classes == each)
        nearest = tree.query(points[some], most, distance_upper_bound=radii[some].max())
        distance, near = (np.asarray(found) for found in nearest)
        # Where there are fewer neighbours, there is the number of points in place of that of a neighbour.
        place, column = np.nonzero(near < some[:, None])
        first, second = some[place], near[place, column]
        close = distance[place, column] < np.minimum(radii[first], radii[second])
        pairs.append((first[close], second[close]))
    return np.concatenate([late for late, _ in pairs]), np.concatenate([early for _, early in pairs])


def spread(cells: Cells, rng: np.random.Generator) -> tuple[Samples, Samples]:
    """Points about a spacing apart, in random order, and the candidates that were removed."""
    drawn = draw(cells, rng)
    drawn = drawn[rng.permutation(len(drawn))]
    kept = thin(drawn, LEAST_SEPARATION * drawn.spacing)
    chosen = drawn[kept]
    nearest = np.asarray(cKDTree(chosen.points).query(drawn.points)[1])
    return replace(chosen, areas=sum_by_index(nearest, drawn.areas, len(chosen))), drawn[~kept]
