"""What a beam's cross-section is like: round, rectangular, Gaussian, or an image."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from tetlux.fem.lights.point import as_vector
from tetlux.meshing.arrays import BoolArray, FloatArray, Vector
from tetlux.meshing.errors import InputError

# A Gaussian spot is cut off where it has fallen to exp(-8), 0.03 %, of its middle.
GAUSSIAN_EDGE = 2.0
# Details finer than this share of an image are averaged: light that diffuses does not show them.
FINEST = 1.0 / 128.0


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
    def has_edge(self) -> bool:
        """Whether it ends at a sharp edge."""
        ...

    @property
    def area(self) -> float:
        """Integral of `brightness` over the plane, unit²: power over irradiance."""
        ...

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """Share of the full irradiance at offsets (q, 3) from the middle, across `direction`, (q,)."""
        ...


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
        raise InputError(f"{name} of the spot is {value:g}; give a length greater than 0.")


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

    has_edge = True

    @property
    def area(self) -> float:
        """See `Spot`."""
        return math.pi * self.radius**2

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        along = offsets @ direction
        across = np.einsum("ij,ij->i", offsets, offsets) - along**2
        return np.where(across <= self.radius**2, 1.0, 0.0)


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

    has_edge = False

    @property
    def area(self) -> float:
        """See `Spot`."""
        return 0.5 * math.pi * self.radius**2 * (1.0 - math.exp(-2.0 * GAUSSIAN_EDGE**2))

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        along = offsets @ direction
        across = np.einsum("ij,ij->i", offsets, offsets) - along**2
        share = np.exp(-2.0 * across / self.radius**2)
        return np.where(across <= self.reach**2, share, 0.0)


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
        raise InputError(f"up of the spot is {tuple(up)}, along the beam; give another direction that is up.")
    raised /= length
    return np.cross(direction, raised), raised


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

    has_edge = True

    @property
    def area(self) -> float:
        """See `Spot`."""
        return self.width * self.height

    def brightness(self, offsets: FloatArray, direction: FloatArray) -> FloatArray:
        """See `Spot`."""
        right, up = _axes(direction, self.up)
        inside = (np.abs(offsets @ right) <= 0.5 * self.width) & (np.abs(offsets @ up) <= 0.5 * self.height)
        return np.where(inside, 1.0, 0.0)


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
        as_vector(self.center, "center")
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
        return float(max(self.height / rows, self.width / columns))

    has_edge = False

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
