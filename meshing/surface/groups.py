"""Groups of neighbouring triangles of a surface, from coarse to fine, so that a part of it may stand for many of them.

Triangles are sorted by the axis that their normals are nearest to, and then by the cell of an octree that holds their
centroid. Groups of one cell are contiguous in this order; the two sides of a plate are in different groups. Long thin
triangles are cut into pieces first, or a group would be as large as the longest of them.
"""

from dataclasses import dataclass

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.subdivide import NEXT_CORNER
from tetlux.meshing.surface.triangles import longest_sides

# Levels of the octree; what shares a cell of the finest one is a group of its own each below it.
LEVELS = 12
# Relative difference of lengths that count as equal.
EQUAL = 1e-9
# Triangles are cut until they are at most so many times longer than they are wide on average.
LONGEST_PIECE = 3.0
# No piece is shorter than this share of the longest side of all.
SHORTEST_PIECE = 1e-3
# Pieces that are added at most, as a multiple of the triangles and as a number; pieces are longer if there are more.
MOST_ADDED_SHARE, MOST_ADDED = 1.0, 20_000


@dataclass(frozen=True, eq=False)
class GroupLevel:
    """Groups of one size.

    Attributes
    ----------
    starts, ends : (g,) ndarray
        Their first pieces in the order of pieces, and the ones after their last.
    centroids : (g, 3) ndarray
    sizes : (g,) ndarray
        Diagonals of the boxes around them, unit.
    children : (g + 1,) ndarray
        The first group of each on the next level.
    """

    starts: IntArray
    ends: IntArray
    centroids: FloatArray
    sizes: FloatArray
    children: IntArray


@dataclass(frozen=True, eq=False)
class TriangleGroups:
    """Pieces of a surface's triangles, ordered so that neighbours are near each other, and groups of them.

    Attributes
    ----------
    faces : (p,) ndarray
        The triangle of each piece.
    corners : (p, 3, 3) ndarray
    areas : (p,) ndarray
        On the smooth surface, unit².
    total_areas : (p + 1,) ndarray
        Areas of all pieces before each, unit².
    levels : tuple of GroupLevel
        From coarse to fine; the groups of the last one are single pieces.
    """

    faces: IntArray
    corners: FloatArray
    areas: FloatArray
    total_areas: FloatArray
    levels: tuple[GroupLevel, ...]


def bisect(corners: FloatArray) -> FloatArray:
    """Cut triangles (f, 3, 3) in the middle of their longest sides, (2 f, 3, 3)."""
    sides = np.linalg.norm(corners - corners[:, NEXT_CORNER], axis=2)
    longest, rows = _largest(sides), np.arange(len(corners))
    a, b, c = (corners[rows, (longest + turn) % 3] for turn in range(3))
    halves = np.empty((len(corners), 2, 3, 3))
    halves[:, 0, 0], halves[:, 1, 1], halves[:, :, 2] = a, b, c[:, None]
    halves[:, 0, 1] = halves[:, 1, 0] = 0.5 * (a + b)
    return halves.reshape(-1, 3, 3)


def cut_long_triangles(corners: FloatArray) -> tuple[IntArray, FloatArray]:
    """Pieces of long thin triangles (f, 3, 3): the triangle of each (p,), and their corners (p, 3, 3)."""
    longest, areas = longest_sides(corners), _areas(corners)
    widths = LONGEST_PIECE * 2.0 * areas / np.where(longest > 0, longest, 1.0)
    shortest, most = float(longest.max()) * SHORTEST_PIECE, MOST_ADDED_SHARE * len(corners) + MOST_ADDED
    while 2.0 * (longest / np.maximum(widths, shortest))[longest > widths].sum() > most:
        shortest *= 2.0
    limits = np.maximum(widths, shortest)
    faces, done = np.arange(len(corners)), []
    while True:
        sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long, narrow = sides.max(axis=1) > limits[faces], sides.min(axis=1) <= limits[faces]
        done.append((faces[~long], corners[~long]))
        done.append(_slice(faces[long & narrow], corners[long & narrow], limits))
        rest = long & ~narrow
        if not rest.any():
            return np.concatenate([some for some, _ in done]), np.concatenate([some for _, some in done])
        faces, corners = np.repeat(faces[rest], 2), bisect(corners[rest])


def _slice(faces: IntArray, corners: FloatArray, limits: FloatArray) -> tuple[IntArray, FloatArray]:
    """Cut triangles with one short side each, (f, 3, 3), across, into slices as long as the limits of their faces."""
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    # The tip is opposite the shortest side, which ends at the corner after its first.
    turn = (sides.argmin(axis=1)[:, None] + 2 + np.arange(3)) % 3
    tip, left, right = np.take_along_axis(corners, turn[:, :, None], axis=1).transpose(1, 0, 2)
    count = np.ceil(sides.max(axis=1) / limits[faces]).astype(np.int64)
    own = np.repeat(np.arange(len(count)), count)
    index = np.arange(len(own)) - np.repeat(np.cumsum(count) - count, count)
    near, far = (index / count[own])[:, None], ((index + 1) / count[own])[:, None]
    tips, lefts, rights = tip[own], left[own] - tip[own], right[own] - tip[own]
    outer = np.stack([tips + near * lefts, tips + far * lefts, tips + far * rights], axis=1)
    inner = np.stack([tips + near * lefts, tips + far * rights, tips + near * rights], axis=1)
    double = index > 0
    return np.concatenate([faces[own], faces[own[double]]]), np.concatenate([outer, inner[double]])


def group_triangles(faces: IntArray, corners: FloatArray, areas: FloatArray) -> TriangleGroups:
    """Groups of pieces.

    Parameters
    ----------
    faces : (p,) ndarray
        The triangle of each piece.
    corners : (p, 3, 3) ndarray
    areas : (p,) ndarray
        On the smooth surface, unit².
    """
    keys = _keys(corners)
    order = np.argsort(keys, kind="stable")
    faces, corners, areas, keys = faces[order], corners[order], areas[order], keys[order]
    levels, starts = [], np.arange(len(keys))
    middles, low, high = corners.mean(axis=1), corners.min(axis=1), corners.max(axis=1)
    moments, weights = areas[:, None] * middles, areas
    children = np.arange(len(keys) + 1)
    shift = np.uint64(0)
    levels.append(GroupLevel(starts, starts + 1, middles, longest_sides(corners), children))
    for _ in range(LEVELS + 1):
        group = keys[starts] >> shift
        first = np.flatnonzero(np.concatenate([[True], group[1:] != group[:-1]]))
        shift += np.uint64(3)
        if len(first) == len(starts):
            continue
        low, high = np.minimum.reduceat(low, first), np.maximum.reduceat(high, first)
        moments, weights = np.add.reduceat(moments, first), np.add.reduceat(weights, first)
        starts = starts[first]
        ends = np.append(starts[1:], len(keys))
        centroids = moments / np.where(weights > 0, weights, 1.0)[:, None]
        sizes = np.linalg.norm(high - low, axis=1)
        levels.append(GroupLevel(starts, ends, centroids, sizes, np.append(first, len(levels[-1].starts))))
    return TriangleGroups(faces, corners, areas, np.append(0.0, np.cumsum(areas)), tuple(levels[::-1]))


def _keys(corners: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.uint64]]:
    """The axis of each normal, then the interleaved digits of the centroid's cell, (p,)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    axis = _largest(np.abs(normals))
    kind = 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0)
    middles = corners.mean(axis=1)
    low = middles.min(axis=0)
    size = float((middles.max(axis=0) - low).max())
    cells = ((middles - low) * ((1 << LEVELS) - 1) / (size if size > 0 else 1.0)).astype(np.uint64)
    keys = kind.astype(np.uint64)
    for digit in range(LEVELS - 1, -1, -1):
        for i in range(3):
            keys = (keys << np.uint64(1)) | ((cells[:, i] >> np.uint64(digit)) & np.uint64(1))
    return np.asarray(keys)


def _largest(values: FloatArray) -> IntArray:
    """The column of the largest of each row, (n,); the first of equal ones, so that rounding does not decide."""
    most = values.max(axis=1, keepdims=True)
    return np.asarray((values >= (1.0 - EQUAL) * most).argmax(axis=1))


def _areas(corners: FloatArray) -> FloatArray:
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(0.5 * np.linalg.norm(sides, axis=1))
