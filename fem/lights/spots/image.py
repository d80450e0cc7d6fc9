"""A spot with the pattern of an image."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tetlux.fem.inputs import as_vector
from tetlux.fem.lights.spots.plane import distances_to_rectangle, low_discrepancy, right_and_up
from tetlux.fem.lights.spots.spot import EDGE_SHARE, check_length
from tetlux.meshing.arrays import BoolArray, FloatArray, Vector
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError

# Pixels along each side of an image, at most; finer ones are averaged, since diffusion blurs them.
MOST_PIXELS = 128


def check_pixels(pixels: FloatArray) -> None:
    """Refuse an array that is no image of brightness, or black all over.

    Raises
    ------
    InputError
    """
    if pixels.ndim != 2 or min(pixels.shape) < 1:
        raise InputError(f"the image has the shape {pixels.shape}; give rows and columns of brightness.")
    if not np.isfinite(pixels).all() or (pixels < 0).any():
        raise InputError("the image holds a brightness that is not a number or negative.")
    if not (pixels > 0).any():
        raise InputError("the image is black all over; no light would fall on the body.")


@dataclass(frozen=True, eq=False)
class Image:
    """A spot whose irradiance is an image, as from a projector.

    Seen along the beam, the image is not mirrored. Details finer than a 128th of it are averaged.

    Parameters
    ----------
    center : (3,) floats
        Middle of the image, on the axis of the beam, unit.
    width : float
        Width of the image, unit; the height follows from its shape.
    pixels : (rows, columns) ndarray
        Brightness from 0 to 1, linear, the upper row first.
    up : (3,) floats
        Direction of the upper edge; its component along the beam does not count.

    Raises
    ------
    InputError
        If a coordinate is not finite, the width not positive, or the pixels no image or all dark; and, when solved, if
        `up` is along the beam.

    Examples
    --------
    >>> import numpy as np
    >>> stripes = Image(center=(0.0, 0.0, 20.0), width=4.0, pixels=np.array([[1.0, 0.0], [1.0, 0.0]]))
    >>> stripes.height, stripes.area
    (4.0, 8.0)
    """

    center: Vector
    width: float
    pixels: FloatArray
    up: Vector = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("center", "up"):
            # As tuples, they cannot be changed later.
            object.__setattr__(self, name, tuple(as_vector(getattr(self, name), name).tolist()))
        check_length(self.width, "width")
        check_pixels(self.pixels)

    @cached_property
    def _coarse(self) -> FloatArray:
        """The image, of at most `MOST_PIXELS` rows and columns."""
        pixels = self.pixels
        for axis in (0, 1):
            count = min(pixels.shape[axis], MOST_PIXELS)
            places = np.arange(pixels.shape[axis]) * count // pixels.shape[axis]
            sizes = np.bincount(places)
            sums = np.add.reduceat(pixels, np.searchsorted(places, np.arange(count)), axis=axis)
            pixels = sums / (sizes[:, None] if axis == 0 else sizes)
        return np.asarray(pixels)

    @property
    def height(self) -> float:
        """Height of the image, unit."""
        return float(self.width * self.pixels.shape[0] / self.pixels.shape[1])

    @property
    def reach(self) -> float:
        """See `Spot`."""
        return 0.5 * math.hypot(self.width, self.height)

    @property
    def detail(self) -> float:
        """See `Spot`."""
        rows, columns = self._coarse.shape
        return float(min(self.height / max(rows, 4), self.width / max(columns, 4)))

    @property
    def edge_size(self) -> float:
        """See `Spot`."""
        return EDGE_SHARE * min(self.width, self.height)

    @property
    def area(self) -> float:
        """See `Spot`."""
        return float(self._coarse.mean()) * self.width * self.height

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        right, up = right_and_up(direction, self.up)
        rows, columns = self._coarse.shape
        row = np.floor((0.5 - (offsets @ up) / self.height) * rows).astype(np.int64)
        column = np.floor(((offsets @ right) / self.width + 0.5) * columns).astype(np.int64)
        inside: BoolArray = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        shares = np.zeros(len(offsets))
        shares[inside] = self._coarse[row[inside], column[inside]]
        return shares

    def distances(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return distances_to_rectangle(offsets, right_and_up(direction, self.up), (self.width, self.height))

    def samples(self, count: int, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        rows, columns = self._coarse.shape
        bright = np.flatnonzero(self._coarse.ravel() > 0)
        # Points in every bright pixel, or in some of each row if there are more pixels than points.
        row, column = np.divmod(bright[np.arange(count) * len(bright) // count], columns)
        within = low_discrepancy(count)
        places = np.column_stack([(column + within[:, 0]) / columns - 0.5, 0.5 - (row + within[:, 1]) / rows])
        return np.asarray(places * [self.width, self.height] @ np.stack(right_and_up(direction, self.up)))

    __repr__ = one_line
