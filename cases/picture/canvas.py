"""`Canvas`: smooth lines, discs and text on a picture in memory, by Pillow."""

from collections.abc import Callable, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from tetlux.meshing.arrays import FloatArray

# Shapes are drawn this many times larger and then averaged, since Pillow's lines have no smooth edges.
FINER = 4
# Width of the rim round letters, pixels.
RIM = 2
# How hard PNG is compressed: 6, Pillow's own, takes three times as long for files 10 % smaller.
COMPRESSION = 3
Point = tuple[float, float]
_Draw = Callable[[ImageDraw.ImageDraw, FloatArray], None]


class Canvas:
    """A picture to draw on; places are in pixels from its left upper corner.

    Parameters
    ----------
    size : (int, int)
        Width and height, pixels.
    background : (3,) floats
        Red, green and blue from 0 to 1.
    """

    def __init__(self, size: tuple[int, int], background: Sequence[float]) -> None:
        red, green, blue = (round(255 * value) for value in background)
        self._image = Image.new("RGB", size, (red, green, blue))
        self._draw = ImageDraw.Draw(self._image)

    @property
    def image(self) -> Image.Image:
        """What is drawn so far."""
        return self._image

    def paste(self, pixels: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], left: int, top: int) -> None:
        """Put an image (h, w, 3) at a place."""
        self._image.paste(Image.fromarray(pixels), (left, top))

    def text(
        self, place: Point, text: str, size: float, color: str, *, anchor: str = "lm", outline: str | None = None
    ) -> None:
        """Write text, which may have several lines.

        Parameters
        ----------
        place : (float, float)
        text : str
        size : float
            Of the font, pixels.
        color : str
        anchor : str
            Which point of the text is at `place`: l, m or r along the line, and a (top), m or d (bottom) across it.
        outline : str, optional
            Colour of a rim round the letters.
        """
        self._draw.text(
            place,
            text,
            fill=color,
            font=_font(size),
            anchor=anchor,
            align="center",
            spacing=0.35 * size,
            stroke_width=RIM if outline else 0,
            stroke_fill=outline,
        )

    @staticmethod
    def text_width(text: str, size: float) -> float:
        """Width of one line of text with a rim, pixels."""
        return _font(size).getlength(text) + 2.0 * RIM

    def line(self, points: Sequence[Point], width: float, color: str, *, round_ends: bool = False) -> None:
        """Draw a line through points."""
        self.lines([points], width, color, round_ends=round_ends)

    def lines(
        self,
        lines: Sequence[Sequence[Point] | FloatArray],
        width: float,
        color: str,
        *,
        opacity: float = 1.0,
        round_ends: bool = False,
    ) -> None:
        """Draw several lines, as one where they cross."""
        paths = [np.asarray(points, dtype=float) for points in lines]

        def draw(mask: ImageDraw.ImageDraw, corner: FloatArray) -> None:
            for path in paths:
                finer = FINER * (path - corner)
                mask.line(_flat(finer), fill=255, width=round(FINER * width), joint="curve")
                for x, y in finer[[0, -1]] if round_ends else ():
                    reach = 0.5 * FINER * width
                    mask.ellipse((x - reach, y - reach, x + reach, y + reach), fill=255)

        self._fill(np.vstack(paths), width, draw, color, opacity)

    def disc(self, place: Point, radius: float, color: str, *, hole: float = 0.0, opacity: float = 1.0) -> None:
        """Draw a disc, or a ring round a hole of a radius."""

        def draw(mask: ImageDraw.ImageDraw, corner: FloatArray) -> None:
            x, y = (FINER * (np.asarray(place) - corner)).tolist()
            for reach, value in ((FINER * radius, 255), (FINER * hole, 0)):
                if reach > 0:
                    mask.ellipse((x - reach, y - reach, x + reach, y + reach), fill=value)

        self._fill(np.array([place]), radius, draw, color, opacity)

    def polygon(self, corners: Sequence[Point], color: str) -> None:
        """Fill a polygon."""

        def draw(mask: ImageDraw.ImageDraw, corner: FloatArray) -> None:
            mask.polygon(_flat(FINER * (np.asarray(corners) - corner)), fill=255)

        self._fill(np.asarray(corners, dtype=float), 0.0, draw, color, 1.0)

    def shade(self, coverage: FloatArray, left: int, top: int, color: str, opacity: float) -> None:
        """Tint what is covered: shares (h, w) of pixels from 0 to 1."""
        mask = Image.fromarray(np.round(255.0 * opacity * coverage).astype(np.uint8))
        self._image.paste(color, (left, top, left + mask.width, top + mask.height), mask)

    def rectangle(self, left: float, top: float, width: float, height: float, color: str) -> None:
        """Fill a rectangle of whole pixels."""
        self._draw.rectangle((left, top, left + width - 1, top + height - 1), fill=color)

    def halved(self) -> "Canvas":
        """The same at half the width and height."""
        small = Canvas((self._image.width // 2, self._image.height // 2), (0.0, 0.0, 0.0))
        small._image.paste(self._image.reduce(2))
        return small

    def save(self, path: Path) -> None:
        """Write a PNG."""
        self._image.save(path, format="PNG", compress_level=COMPRESSION)

    def _fill(self, points: FloatArray, reach: float, draw: _Draw, color: str, opacity: float) -> None:
        """Put a colour where a shape is, which is within `reach` of points."""
        low = np.maximum(np.floor(points.min(axis=0) - reach - 1), 0).astype(int)
        high = np.minimum(np.ceil(points.max(axis=0) + reach + 1), self._image.size).astype(int)
        if (high <= low).any():
            return
        width, height = (high - low).tolist()
        mask = Image.new("L", (FINER * width, FINER * height))
        draw(ImageDraw.Draw(mask), low.astype(float))
        mask = mask.reduce(FINER)
        if opacity < 1.0:
            mask = mask.point([round(opacity * value) for value in range(256)])
        x, y = low.tolist()
        self._image.paste(color, (x, y, x + width, y + height), mask)


def _flat(points: FloatArray) -> list[float]:
    """Points (n, 2) as Pillow takes them: x, y, x, y, ..."""
    return [float(value) for value in points.ravel()]


@cache
def _font(size: float) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, which comes with matplotlib and has more letters than the font within Pillow."""
    found = find_spec("matplotlib")
    for folder in (found.submodule_search_locations or ()) if found else ():
        path = Path(folder, "mpl-data", "fonts", "ttf", "DejaVuSans.ttf")
        if path.exists():
            return ImageFont.truetype(path, size)
    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont)
    return font
