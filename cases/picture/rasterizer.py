"""A software rasterizer with a depth buffer, for machines where PyVista cannot render."""

import numpy as np

from tetlux.cases.picture.stage import (
    FULL,
    LIGHT,
    OVERSAMPLING,
    SHADED,
    Image,
    Stage,
    see_through,
)
from tetlux.cases.picture.view import PANEL
from tetlux.meshing.arrays import FloatArray, IntArray

# Pairs of pixel and triangle tested at a time, which bounds the memory to about 100 MB.
BATCH = 1_000_000


def rasterize(stage: Stage) -> Image:
    """Draw the body and the arrows, (h, w, 3) at `OVERSAMPLING` times the size of the panel."""
    corners = np.concatenate([stage.corners, stage.arrows])
    placed = stage.camera.project(corners.reshape(-1, 3)).reshape(-1, 3, 3) * OVERSAMPLING
    body = len(stage.corners)
    bare = nearest_triangles(placed[:body], closed=body)
    under = _shade(stage, placed, bare[0])
    if len(corners) == body:
        return under
    return see_through(
        _shade(stage, placed, nearest_triangles(placed, closed=body, behind=bare)[0]), under, stage.background
    )


def _shade(stage: Stage, placed: FloatArray, owner: IntArray) -> Image:
    """Colour each pixel by the triangle that is visible there (h, w), (h, w, 3)."""
    body = len(stage.corners)
    flat = owner.ravel()
    pixels = np.flatnonzero(flat >= 0)
    flat = flat[pixels]
    width = owner.shape[1]
    weights = _weights(placed[flat, :, :2], pixels % width + 0.5, pixels // width + 0.5)
    colors = np.empty((len(pixels), 3))
    lit = flat >= body
    if stage.colours is None:
        shares = np.einsum("ij,ij->i", weights[~lit], stage.shares[flat[~lit]])
        colors[~lit] = stage.table[np.clip(shares * 256, 0, 255).astype(int)]
    else:
        colors[~lit] = np.einsum("ij,ijk->ik", weights[~lit], stage.colours[flat[~lit]])
    colors[lit] = LIGHT
    normals = np.concatenate([stage.normals, stage.arrow_normals])
    lamp, eye = (
        np.einsum("ij,ij->i", weights, (normals @ axis)[flat]) for axis in (stage.camera.lamp, stage.camera.toward)
    )
    # Like VTK, reverse a normal that points away from the eye.
    cosine = np.clip(np.where(eye < 0, -lamp, lamp), 0.0, 1.0)
    colors *= (SHADED + (FULL - SHADED) * cosine)[:, None]
    image = np.tile(np.round(255 * np.asarray(stage.background)).astype(np.uint8), (owner.size, 1))
    image[pixels] = np.round(255 * colors).astype(np.uint8)
    return image.reshape(*owner.shape, 3)


def nearest_triangles(
    placed: FloatArray, closed: int, behind: tuple[IntArray, FloatArray] | None = None
) -> tuple[IntArray, FloatArray]:
    """Find the visible triangle of each pixel.

    Parameters
    ----------
    placed : (m, 3, 3) ndarray
        Corners of the triangles: column and row, in drawn pixels, and nearness.
    closed : int
        How many triangles, from the first, belong to a closed surface, of which only front faces are drawn.
    behind : pair of (h, w) ndarray, optional
        The result for these `closed` triangles alone, if known; they are then not drawn again.

    Returns
    -------
    owner, nearness : (h, w) ndarray
        The triangle, -1 if none, and how near it is.
    """
    size = np.array([OVERSAMPLING * n for n in PANEL])
    a, b, c = (placed[:, i, :2] for i in range(3))
    # Rows count downwards, so that front faces run clockwise.
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    drawn = np.flatnonzero((area < 0) | ((area > 0) & (np.arange(len(placed)) >= closed)))
    if behind is not None:
        drawn = drawn[drawn >= closed]
    # The pixels whose centres, at n + 1/2, lie within the bounding rectangle of a triangle.
    low = np.maximum(np.ceil(placed[drawn, :, :2].min(axis=1) - 0.5).astype(int), 0)
    high = np.minimum(np.floor(placed[drawn, :, :2].max(axis=1) - 0.5).astype(int), size - 1)
    columns, rows = np.maximum(high - low + 1, 0).T
    if behind is None:
        owner = np.full((size[1], size[0]), -1, dtype=np.int64)
        nearness = np.full(owner.shape, -np.inf)
    else:
        owner, nearness = (array.copy() for array in behind)
    # One strip is one row of pixels of one triangle.
    strip, row = np.repeat(np.arange(len(drawn)), rows), _concatenate_ranges(rows)
    ends = np.cumsum(columns[strip])
    cuts = np.searchsorted(ends, np.arange(BATCH, int(columns @ rows), BATCH))
    for part in np.split(np.arange(len(strip)), cuts):
        long = columns[strip[part]]
        strips = np.repeat(part, long)
        first = low[strip[strips]]
        pixels = np.column_stack([first[:, 0] + _concatenate_ranges(long), first[:, 1] + row[strips]])
        _keep_nearest(owner, nearness, placed, drawn[strip[strips]], pixels)
    return owner, nearness


def _keep_nearest(
    owner: IntArray, nearness: FloatArray, placed: FloatArray, triangle: IntArray, pixels: IntArray
) -> None:
    """Give each pixel (column, row) to the nearest triangle that covers its centre; updates `owner` and `nearness`."""
    weights = _weights(placed[triangle, :, :2], *(pixels.T + 0.5))
    inside = (weights >= -1e-9).all(axis=1)
    triangle, column, row = triangle[inside], *pixels[inside].T
    near = np.einsum("ij,ij->i", weights[inside], placed[triangle, :, 2])
    np.maximum.at(nearness, (row, column), near)
    wins = near == nearness[row, column]
    owner[row[wins], column[wins]] = triangle[wins]


def _weights(corners: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Barycentric coordinates (n, 3) of points in triangles of the plane (n, 3, 2), pair by pair."""
    (ax, ay), (bx, by), (cx, cy) = (corners[:, i].T for i in range(3))
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    second = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
    third = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
    return np.column_stack([1.0 - second - third, second, third])


def _concatenate_ranges(lengths: IntArray) -> IntArray:
    """The ranges 0, 1, ..., length - 1 of all lengths, one after the other."""
    starts = np.cumsum(lengths) - lengths
    return np.arange(int(lengths.sum())) - np.repeat(starts, lengths)
