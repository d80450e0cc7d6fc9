"""What a beam's cross-section is like: round, rectangular, Gaussian, or an image."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from tetlux.fem.lights.point import as_vector
from tetlux.fem.media.varying import as_text
from tetlux.meshing.arrays import BoolArray, FloatArray, Vector
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError

# A Gaussian spot is cut off where it has fallen to exp(-8), 0.03 %, of its middle.
GAUSSIAN_EDGE = 2.0
# Details finer than this share of an image are averaged: light that diffuses does not show them.
FINEST = 1.0 / 128.0
# Parts of facets that an edge crosses are as small as this share of a spot's width. With what `CollimatedBeam` looks
# at in each, the power of a spot on a flat face is right to 0.2 %.
EDGE = 1.0 / 8.0


class Spot(Protocol):
    """A pattern on the plane across a beam."""

    @property
    def center(self) -> Vector:
        """A point on the beam's axis, unit."""
        ...

    @property
    def reach(self) -> float:
        """Distance from the middle beyond which it is dark, unit."""
        ...

    @property
    def detail(self) -> float:
        """Length over which it changes, unit."""
        ...

    @property
    def edge(self) -> float:
        """Size of the parts that are still told apart where it has a sharp edge, unit; inf where it has none."""
        ...

    @property
    def area(self) -> float:
        """Integral of `brightness` over the plane, unit²: power over irradiance."""
        ...

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """Share of the full irradiance at offsets (q, 3) from the middle, across `direction`, (q,)."""
        ...

    def away(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """How far from the lit area these offsets (q, 3) are at least, across `direction`, (q,), unit."""
        ...

    def looks(self, count: int, direction: FloatArray) -> FloatArray:
        """Offsets (q, 3) of some bright places of it, its middle first if that is bright, across `direction`."""
        ...


def scattered(count: int) -> FloatArray:
    """Points (count, 2) of the unit square, evenly spread along each axis too, and along slanting lines."""
    # Roberts' additive sequence of the plastic number.
    return np.asarray(np.modf(0.5 + np.outer(np.arange(count), [0.7548776662466927, 0.5698402909980532]))[0])


def _squared(offsets: FloatArray, direction: FloatArray) -> FloatArray:
    """Squared lengths of offsets (q, 3) across a direction, (q,)."""
    return np.asarray(np.einsum("ij,ij->i", offsets, offsets) - (offsets @ direction) ** 2)


def _beyond(offsets: FloatArray, direction: FloatArray, radius: float) -> FloatArray:
    """How far from a disc offsets (q, 3) are, across a direction, (q,)."""
    across = np.sqrt(np.maximum(_squared(offsets, direction), 0.0))
    return np.asarray(np.maximum(across - radius, 0.0))


def _with_middle(offsets: FloatArray) -> FloatArray:
    return np.vstack([np.zeros((1, 3)), offsets])


def sunflower(count: int, radius: float, direction: FloatArray) -> FloatArray:
    """Places (count, 3) that cover a disc across a direction evenly, no two on one radius (Vogel 1979)."""
    index = np.arange(count)
    distance, angle = radius * np.sqrt((index + 0.5) / count), index * np.pi * (3.0 - np.sqrt(5.0))
    across = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    across /= np.linalg.norm(across)
    spread = np.outer(distance * np.cos(angle), across)
    return np.asarray(spread + np.outer(distance * np.sin(angle), np.cross(direction, across)))


def _check_length(value: float, name: str) -> None:
    if not 0 < value < math.inf:
        raise InputError(f"{name} of the spot is {value:g}; give a length greater than 0.", field=name)


@dataclass(frozen=True)
class Disc:
    """An even, round spot.

    Parameters
    ----------
    center : (3,) floats
        A point on the beam's axis, unit.
    radius : float
        unit.
    """

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        as_vector(self.center, "center")
        _check_length(self.radius, "radius")

    @property
    def reach(self) -> float:
        """See `Spot`."""
        return self.radius

    @property
    def detail(self) -> float:
        """See `Spot`."""
        return self.radius / 2.0

    @property
    def edge(self) -> float:
        """See `Spot`."""
        return 2.0 * EDGE * self.radius

    @property
    def area(self) -> float:
        """See `Spot`."""
        return math.pi * self.radius**2

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return np.where(_squared(offsets, direction) <= self.radius**2, 1.0, 0.0)

    def away(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return _beyond(offsets, direction, self.reach)

    def looks(self, count: int, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return _with_middle(sunflower(count, self.reach, direction))


@dataclass(frozen=True)
class Gaussian:
    """A Gaussian spot, ``exp(-2 r²/radius²)``, cut off at twice its radius.

    Parameters
    ----------
    center : (3,) floats
        A point on the beam's axis, unit.
    radius : float
        Where irradiance has fallen to 1/e² of the middle's, unit.
    """

    center: Vector
    radius: float

    def __post_init__(self) -> None:
        as_vector(self.center, "center")
        _check_length(self.radius, "radius")

    @property
    def reach(self) -> float:
        """See `Spot`."""
        return GAUSSIAN_EDGE * self.radius

    @property
    def detail(self) -> float:
        """See `Spot`."""
        return self.radius / 4.0

    edge = math.inf

    @property
    def area(self) -> float:
        """See `Spot`."""
        return 0.5 * math.pi * self.radius**2 * (1.0 - math.exp(-2.0 * GAUSSIAN_EDGE**2))

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        across = _squared(offsets, direction)
        share = np.exp(-2.0 * across / self.radius**2)
        return np.where(across <= self.reach**2, share, 0.0)

    def away(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return _beyond(offsets, direction, self.reach)

    def looks(self, count: int, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return _with_middle(sunflower(count, self.reach, direction))


def check_pixels(pixels: FloatArray) -> None:
    """Refuse what is no image of brightness, or one that is black all over."""
    if pixels.ndim != 2 or min(pixels.shape) < 1:
        raise InputError(f"the image has the shape {pixels.shape}; give rows and columns of brightness.")
    if not np.isfinite(pixels).all() or (pixels < 0).any():
        raise InputError("the image holds a brightness that is not a number or negative.")
    if not (pixels > 0).any():
        raise InputError("the image is black all over; no light would fall on the body.")


def _axes(direction: FloatArray, up: Vector) -> tuple[FloatArray, FloatArray]:
    """Unit vectors to the right and up on the plane across a beam, as one sees it who looks along the beam."""
    raised = as_vector(up, "up")
    raised = raised - (raised @ direction) * direction
    length = float(np.linalg.norm(raised))
    if not length > 1e-6 * float(np.linalg.norm(up)):
        raise InputError(
            f"up of the spot is {as_text(up)}, along the beam; give another direction that is up.", field="up"
        )
    raised /= length
    return np.cross(direction, raised), raised


def _outside(offsets: FloatArray, axes: tuple[FloatArray, FloatArray], size: tuple[float, float]) -> FloatArray:
    """How far from a rectangle offsets (q, 3) are, (q,)."""
    past = [np.maximum(np.abs(offsets @ axis) - 0.5 * side, 0.0) for axis, side in zip(axes, size, strict=True)]
    return np.hypot(*past)


@dataclass(frozen=True)
class Rectangle:
    """An even, rectangular spot.

    Parameters
    ----------
    center : (3,) floats
        A point on the beam's axis, unit.
    width, height : float
        Across and along `up`, unit.
    up : (3,) floats
        The direction that is up on it, not along the beam.
    """

    center: Vector
    width: float
    height: float
    up: Vector = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        as_vector(self.center, "center")
        _check_length(self.width, "width")
        _check_length(self.height, "height")

    @property
    def reach(self) -> float:
        """See `Spot`."""
        return 0.5 * math.hypot(self.width, self.height)

    @property
    def detail(self) -> float:
        """See `Spot`."""
        return 0.5 * min(self.width, self.height)

    @property
    def edge(self) -> float:
        """See `Spot`."""
        return EDGE * min(self.width, self.height)

    @property
    def area(self) -> float:
        """See `Spot`."""
        return self.width * self.height

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        right, up = _axes(direction, self.up)
        inside = (np.abs(offsets @ right) <= 0.5 * self.width) & (np.abs(offsets @ up) <= 0.5 * self.height)
        return np.where(inside, 1.0, 0.0)

    def away(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return _outside(offsets, _axes(direction, self.up), (self.width, self.height))

    def looks(self, count: int, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        places = (scattered(count) - 0.5) * [self.width, self.height]
        return _with_middle(places @ np.stack(_axes(direction, self.up)))


@dataclass(frozen=True, eq=False)
class Image:
    """A spot whose irradiance is an image, as a projector casts it: its upper edge towards `up`.

    Who looks along the beam sees the image as it is. Details finer than a 128th of it are averaged.

    Parameters
    ----------
    center : (3,) floats
        A point on the beam's axis, where the image's middle goes, unit.
    width : float
        unit; the height follows from the image.
    pixels : (rows, columns) ndarray
        Brightness from 0 to 1, linear, the upper row first.
    up : (3,) floats
        The direction that is up on it, not along the beam.

    Raises
    ------
    InputError
        If the pixels are no image or all dark.
    """

    center: Vector
    width: float
    pixels: FloatArray
    up: Vector = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("center", "up"):
            # Nobody can change them afterwards.
            object.__setattr__(self, name, tuple(as_vector(getattr(self, name), name).tolist()))
        _check_length(self.width, "width")
        check_pixels(self.pixels)

    @cached_property
    def _coarse(self) -> FloatArray:
        """The image with what is finer than `FINEST` averaged."""
        pixels = self.pixels
        for axis in (0, 1):
            count = min(pixels.shape[axis], round(1.0 / FINEST))
            places = np.arange(pixels.shape[axis]) * count // pixels.shape[axis]
            sizes = np.bincount(places)
            sums = np.add.reduceat(pixels, np.searchsorted(places, np.arange(count)), axis=axis)
            pixels = sums / (sizes[:, None] if axis == 0 else sizes)
        return np.asarray(pixels)

    @property
    def height(self) -> float:
        """Unit."""
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
    def edge(self) -> float:
        """See `Spot`."""
        return EDGE * min(self.width, self.height)

    @property
    def area(self) -> float:
        """See `Spot`."""
        return float(self._coarse.mean()) * self.width * self.height

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        right, up = _axes(direction, self.up)
        rows, columns = self._coarse.shape
        row = np.floor((0.5 - (offsets @ up) / self.height) * rows).astype(np.int64)
        column = np.floor(((offsets @ right) / self.width + 0.5) * columns).astype(np.int64)
        inside: BoolArray = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        shares = np.zeros(len(offsets))
        shares[inside] = self._coarse[row[inside], column[inside]]
        return shares

    def away(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        return _outside(offsets, _axes(direction, self.up), (self.width, self.height))

    def looks(self, count: int, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        rows, columns = self._coarse.shape
        bright = np.flatnonzero(self._coarse.ravel() > 0)
        # In every bright pixel if there are few, else in some of each row.
        row, column = np.divmod(bright[np.arange(count) * len(bright) // count], columns)
        within = scattered(count)
        places = np.column_stack([(column + within[:, 0]) / columns - 0.5, 0.5 - (row + within[:, 1]) / rows])
        return np.asarray(places * [self.width, self.height] @ np.stack(_axes(direction, self.up)))

    __repr__ = one_line


# Spots that stay what they are, of which what they light may be remembered.
UNCHANGING = (Disc, Gaussian, Rectangle, Image)
