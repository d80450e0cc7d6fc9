"""Colours of the drawn body and of the lights' arrows."""

from dataclasses import dataclass

import numpy as np

from tetlux.cases.picture.rasterizer import Visible, gradients, visible_triangles
from tetlux.cases.picture.stage import ARROW_OPACITY, FULL, LIGHT, OVERSAMPLING, SHADED, Image, Stage
from tetlux.cases.picture.view import Camera, caster_of
from tetlux.meshing.arrays import BoolArray, FloatArray, IndexArray, IntArray

# Triangles whose means differ by less have one colour: of the map's positions, or of red, green and blue.
ONE_COLOUR = 0.02
# Rays through a pixel on the outline, along each side: more than samples, since there the contrast is largest.
RAYS = 4


def draw_stage(stage: Stage) -> Image:
    """Draw the body and the arrows into the panel, (h, w, 3).

    A pixel in which triangles of about one colour are visible has the colour of its middle, others have the mean of
    their samples; along the outline, rays say how much of a pixel the body covers. Arrows are translucent where the
    body is behind them.
    """
    placed, arrows = (place_samples(stage.camera, corners) for corners in (stage.corners, stage.arrows))
    width, height = stage.camera.panel
    body = visible_triangles(placed, samples_of(stage.camera), closed=True)
    owner = _by_pixel(body.owner)
    paint = _paint_of_body(stage, placed)
    image = np.empty((owner.shape[1], 3), dtype=np.uint8)
    image[:] = _bytes(np.asarray(stage.background))
    lit: BoolArray = np.zeros(len(image), dtype=bool)
    if len(arrows):
        lit_pixels, arrow = _visible_arrows(arrows, body, (width, height))
        lit[lit_pixels] = True
    plain = paint.is_even(owner) & ~lit
    pixels = np.flatnonzero(plain & (owner[0] >= 0))
    row, column = np.divmod(pixels, width)
    middle = 0.5 * OVERSAMPLING
    image[pixels] = _bytes(paint(owner[0, pixels], OVERSAMPLING * column + middle, OVERSAMPLING * row + middle))
    mixed = np.flatnonzero(~plain & ~lit)
    image[mixed] = _bytes(_paint_mixed(stage, paint, owner[:, mixed], mixed))
    if lit.any():
        own = owner[:, lit_pixels]
        under = _paint_samples(paint, own, lit_pixels, _ground(stage, len(lit_pixels)), width)
        over = _paint_samples(_paint_of_arrows(stage, arrows), arrow, lit_pixels, under, width)
        share = np.where(own >= 0, ARROW_OPACITY, 1.0)[:, :, None]
        image[lit_pixels] = _bytes((under + share * (over - under)).mean(axis=0))
    return image.reshape(height, width, 3)


def _bytes(colours: FloatArray) -> Image:
    """Colours from 0 to 1 as bytes."""
    return np.asarray(np.round(255.0 * colours), dtype=np.uint8)


def _visible_arrows(arrows: FloatArray, body: Visible, panel: tuple[int, int]) -> tuple[IntArray, IndexArray]:
    """The pixels (n,) in which arrows (m, 3, 3) are visible, and the triangles at their samples, (samples, n)."""
    corners = arrows[:, :, :2].reshape(-1, 2)
    last = np.array(panel) - 1
    low = np.clip(np.floor(corners.min(axis=0) / OVERSAMPLING).astype(np.int64), 0, last)
    high = np.clip(np.floor(corners.max(axis=0) / OVERSAMPLING).astype(np.int64), 0, last) + 1
    (left, top), (right, bottom) = OVERSAMPLING * low, OVERSAMPLING * high
    shifted = arrows - np.array([left, top, 0.0])
    before = body.nearness[top:bottom, left:right]
    owner = _by_pixel(visible_triangles(shifted, (right - left, bottom - top), closed=False, before=before).owner)
    seen = np.flatnonzero((owner >= 0).any(axis=0))
    row, column = np.divmod(seen, int(high[0] - low[0]))
    return (row + low[1]) * panel[0] + column + low[0], owner[:, seen]


def _ground(stage: Stage, pixels: int) -> FloatArray:
    """The background at the samples of pixels, (samples of a pixel, pixels, 3)."""
    return np.tile(stage.background, (OVERSAMPLING**2, pixels, 1))


def _paint_mixed(stage: Stage, paint: "_Paint", owner: IndexArray, pixels: IntArray) -> FloatArray:
    """Colours (n, 3) of pixels (n,) that show several triangles, or the body and the background."""
    colours = _paint_samples(paint, owner, pixels, _ground(stage, len(pixels)), stage.camera.panel[0])
    mean: FloatArray = colours.mean(axis=0)
    inside = owner >= 0
    outline = np.flatnonzero(inside.any(axis=0) & ~inside.all(axis=0))
    drawn = np.einsum("sp,spc->pc", inside[:, outline] / inside[:, outline].sum(axis=0), colours[:, outline])
    share = _coverage(stage, pixels[outline])[:, None]
    mean[outline] = share * drawn + (1.0 - share) * np.asarray(stage.background)
    return mean


def _coverage(stage: Stage, pixels: IntArray) -> FloatArray:
    """The share of each pixel (n,) of the panel that the body covers, by rays through it."""
    camera, n = stage.camera, RAYS
    row, column = np.divmod(pixels, camera.panel[0])
    down, right = ((np.indices((n, n)).reshape(2, -1) + 0.5) / n)[:, None]
    across = (column[:, None] + right).ravel() - 0.5 * camera.panel[0]
    above = 0.5 * camera.panel[1] - (row[:, None] + down).ravel()
    eye = camera.center + np.linalg.norm(np.ptp(stage.corners, axis=(0, 1))) * camera.toward
    places = eye + camera.pixel * (across[:, None] * camera.right + above[:, None] * camera.up)
    _, hit = caster_of(stage.corners).first(places, np.broadcast_to(-camera.toward, places.shape))
    return np.asarray((hit >= 0).reshape(-1, n * n).mean(axis=1))


def place_samples(camera: Camera, corners: FloatArray) -> FloatArray:
    """Corners (m, 3, 3) of triangles in the panel: column and row, in samples, and nearness to the eye."""
    return camera.project(corners.reshape(-1, 3)).reshape(-1, 3, 3) * OVERSAMPLING


def samples_of(camera: Camera) -> tuple[int, int]:
    """Samples of the panel, by column and by row."""
    return OVERSAMPLING * camera.panel[0], OVERSAMPLING * camera.panel[1]


def _by_pixel(samples: IndexArray) -> IndexArray:
    """The samples (h, w) of each pixel of the panel, (samples of a pixel, pixels)."""
    n, (height, width) = OVERSAMPLING, samples.shape
    by_sample = samples.reshape(height // n, n, width // n, n).transpose(1, 3, 0, 2)
    return by_sample.reshape(n * n, -1)


@dataclass(frozen=True, eq=False)
class _Paint:
    """Colours on triangles, which a lamp shades.

    Values at a triangle's first corner and their change by column and by row, (v, m) each: of the lamp's and the eye's
    cosine with the normal, then of the position on a colour map, or of red, green and blue, unless the colour is even.
    """

    corner: FloatArray
    means: FloatArray
    values: tuple[FloatArray, FloatArray, FloatArray]
    table: FloatArray

    def is_even(self, owner: IndexArray) -> BoolArray:
        """Whether the samples (s, n) of pixels belong to one triangle, to triangles of one colour, or to none, (n,)."""
        even: BoolArray = np.asarray((owner == owner[0]).all(axis=0))
        several = np.flatnonzero(~even & (owner >= 0).all(axis=0))
        # The eye's cosine does not change a colour.
        for mean in np.delete(self.means, 1, axis=0):
            several = several[np.ptp(mean[owner[:, several]], axis=0) < ONE_COLOUR]
        even[several] = True
        return even

    def __call__(self, triangle: IndexArray, column: FloatArray, row: FloatArray) -> FloatArray:
        """Colours (n, 3) at places of triangles (n,)."""
        right, down = column - self.corner[0, triangle], row - self.corner[1, triangle]
        lamp, eye, *rest = (
            at[triangle] + right * by_column[triangle] + down * by_row[triangle]
            for at, by_column, by_row in zip(*self.values, strict=True)
        )
        # A normal that points away from the eye is reversed.
        cosine = np.clip(np.where(eye < 0, -lamp, lamp), 0.0, 1.0)
        if len(rest) == 3:
            colours = np.clip(np.column_stack(rest), 0.0, 1.0)
        else:
            share = rest[0] if rest else np.zeros(len(triangle))
            colours = self.table[np.clip(share * len(self.table), 0, len(self.table) - 1).astype(np.int64)]
        return np.asarray(colours * (SHADED + (FULL - SHADED) * cosine)[:, None])


def _paint_of_body(stage: Stage, placed: FloatArray) -> _Paint:
    colours = [stage.shares] if stage.colours is None else list(np.moveaxis(stage.colours, 2, 0))
    return _make_paint(stage, placed, stage.normals, colours, stage.table)


def _paint_of_arrows(stage: Stage, placed: FloatArray) -> _Paint:
    return _make_paint(stage, placed, stage.arrow_normals, [], np.array([LIGHT]))


def _make_paint(
    stage: Stage, placed: FloatArray, normals: FloatArray, colours: list[FloatArray], table: FloatArray
) -> _Paint:
    values = [normals @ stage.camera.lamp, normals @ stage.camera.toward, *colours]
    slopes = [gradients(placed, value) for value in values]
    by_column, by_row = (np.stack(each) for each in zip(*slopes, strict=True))
    corner = np.ascontiguousarray(placed[:, 0, :2].T)
    means = np.stack([value.mean(axis=1) for value in values])
    return _Paint(corner, means, (np.stack([value[:, 0] for value in values]), by_column, by_row), table)


def _paint_samples(paint: _Paint, owner: IndexArray, pixels: IntArray, under: FloatArray, width: int) -> FloatArray:
    """Colours (samples of a pixel, pixels, 3) of samples; where they belong to no triangle, those `under` them."""
    colours = under.copy()
    sample, pixel = np.nonzero(owner >= 0)
    row, column = np.divmod(pixels[pixel], width)
    down, right = np.divmod(sample, OVERSAMPLING)
    places = OVERSAMPLING * column + right + 0.5, OVERSAMPLING * row + down + 0.5
    colours[sample, pixel] = paint(owner[sample, pixel], *places)
    return colours
