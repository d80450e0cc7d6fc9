"""A rasterizer with a depth buffer: which triangle is visible at each sample of a picture.

It is in double precision. A whole picture takes 0.4 s of CPU for 20,000 triangles and 0.7 s for 150,000 on a busy
machine, where VTK takes some 3 s in a process of its own.
"""

from dataclasses import dataclass

import numpy as np

from tetlux.meshing.arrays import FloatArray, IndexArray, IntArray

# Pairs of sample and triangle that are processed at a time, which bounds the memory to about 100 MB.
BATCH = 1_000_000
# Samples this near to the outside of a triangle, in samples, belong to it, so that no gap opens along shared edges.
SLACK = 1e-7


@dataclass(frozen=True, eq=False)
class Visible:
    """What is visible at each sample.

    Attributes
    ----------
    owner : (h, w) ndarray
        The triangle, -1 if there is none.
    nearness : (h, w) ndarray
        How near it is to the eye, samples; -inf if there is none.
    """

    owner: IndexArray
    nearness: FloatArray


def visible_triangles(
    placed: FloatArray, size: tuple[int, int], *, closed: bool, before: FloatArray | None = None
) -> Visible:
    """Find the triangle that is visible at each sample.

    Parameters
    ----------
    placed : (m, 3, 3) ndarray
        Corners of the triangles: column, row and nearness, in samples, whose middles are at n + 1/2.
    size : (int, int)
        Samples in a row and in a column.
    closed : bool
        Whether the triangles are a closed surface, of which only front faces can be visible.
    before : (h, w) ndarray, optional
        Nearness of what may hide the triangles.

    Returns
    -------
    Visible
    """
    width, height = size
    owner = np.full(width * height, -1, dtype=np.int32)
    nearness = np.full(owner.shape, -np.inf) if before is None else before.ravel().copy()
    area, slope_x, slope_y = _planes(placed)
    # Rows count downwards, so that front faces run clockwise.
    drawn = np.flatnonzero(area < 0 if closed else area != 0)
    triangle, row, left, right = _strips(placed, drawn, height)
    first = np.maximum(np.ceil(left - 0.5 - SLACK).astype(np.int64), 0)
    count = np.maximum(np.minimum(np.floor(right - 0.5 + SLACK).astype(np.int64), width - 1) - first + 1, 0)
    corner, nearest = placed[:, 0], placed[:, :, 2].max(axis=1)
    start = corner[triangle, 2] + slope_x[triangle] * (first + 0.5 - corner[triangle, 0])
    start += slope_y[triangle] * (row + 0.5 - corner[triangle, 1])
    ends = np.cumsum(count)
    cuts = np.searchsorted(ends, np.arange(BATCH, int(count.sum()), BATCH))
    for part in np.split(np.arange(len(count)), cuts):
        strip, step = np.repeat(part, count[part]), _concatenate_ranges(count[part])
        own = triangle[strip]
        # Rounding must not bring a triangle seen edge-on to the front.
        near = np.minimum(start[strip] + step * slope_x[own], nearest[own])
        sample = (row * width + first)[strip] + step
        np.maximum.at(nearness, sample, near)
        wins = near == nearness[sample]
        owner[sample[wins]] = own[wins]
    return Visible(owner.reshape(height, width), nearness.reshape(height, width))


def gradients(placed: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Change of values (m, 3) at the corners of triangles by column and by row, (m,) each; 0 where they are edge-on."""
    a, b, c = (placed[:, i, :2] for i in range(3))
    along, across = b - a, c - a
    area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    inverse = np.divide(1.0, area, out=np.zeros(len(area)), where=area != 0)
    first, second = values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]
    by_column = (first * across[:, 1] - second * along[:, 1]) * inverse
    by_row = (second * along[:, 0] - first * across[:, 0]) * inverse
    return by_column, by_row


def _planes(placed: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Twice the signed area of each triangle in the picture, and the change of nearness by column and by row."""
    a, b, c = (placed[:, i, :2] for i in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return area, *gradients(placed, placed[:, :, 2])


def _strips(placed: FloatArray, drawn: IntArray, height: int) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Cut triangles into rows of samples.

    Returns
    -------
    triangle, row : (s,) ndarray
        Each row of each of the triangles `drawn`.
    left, right : (s,) ndarray
        Where the triangle begins and ends in the middle of that row.
    """
    rows = placed[drawn, :, 1]
    top = np.maximum(np.ceil(rows.min(axis=1) - 0.5).astype(np.int64), 0)
    count = np.maximum(np.minimum(np.floor(rows.max(axis=1) - 0.5).astype(np.int64), height - 1) - top + 1, 0)
    triangle, row = np.repeat(drawn, count), np.repeat(top, count) + _concatenate_ranges(count)
    middle = row + 0.5
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        # From the upper end down, so that triangles that share an edge compute the same crossing.
        start, end = placed[:, i, :2], placed[:, j, :2]
        swap = (start[:, 1] > end[:, 1])[:, None]
        start, end = np.where(swap, end, start), np.where(swap, start, end)
        fall = end[:, 1] - start[:, 1]
        slope = np.divide(end[:, 0] - start[:, 0], fall, out=np.zeros(len(fall)), where=fall > 0)
        top_y, low_y = start[triangle, 1], end[triangle, 1]
        crossing = start[triangle, 0] + (middle - top_y) * slope[triangle]
        meets = (top_y <= middle) & (middle <= low_y) & (low_y > top_y)
        left = np.where(meets, np.minimum(left, crossing), left)
        right = np.where(meets, np.maximum(right, crossing), right)
    found = np.flatnonzero(left <= right)
    return triangle[found], row[found], left[found], right[found]


def _concatenate_ranges(lengths: IntArray) -> IntArray:
    """The ranges 0, 1, ..., length - 1 of all lengths, one after the other."""
    starts = np.cumsum(lengths) - lengths
    return np.arange(int(lengths.sum())) - np.repeat(starts, lengths)
