"""What is fitted of media: coefficients of the body and of its regions, or what tissue consists of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region
from tetlux.fem.media.tissue import tissue
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError

COEFFICIENTS = ("sigma_a", "sigma_s_prime")
OF_TISSUE = ("hbo2", "hhb", "water", "fat", "a", "b")
HAEMOGLOBIN = ("hbo2", "hhb")
# Those that are shares of the volume.
FRACTIONS = ("water", "fat")
# The unknown factor of all readings.
GAIN = "gain"
# What a part of the body begins with: coefficients, or the arguments of `tissue`.
Start = Medium | Mapping[str, Any]
# What `tissue` needs, and all that it takes.
NEEDED = ("wavelengths", "a", "b", "eta")
ARGUMENTS = (*NEEDED, "hbo2", "hhb", "water", "fat", "others", "unit", "boundary")
# Step of central differences of media by unknowns, as a share of these.
STEP = 1e-4


class Unknowns(Protocol):
    """Unknowns of media and the gain, and the media that follow from them."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the unknowns."""
        ...

    @property
    def start(self) -> FloatArray:
        """Values to begin with, (u,), greater than 0."""
        ...

    def media(self, values: FloatArray) -> list[list[Medium]]:
        """For each channel the medium of the body and of each region, by values (u,)."""
        ...


# The number of the part that an unknown is of, 0 for the body, and its quantity.
Place = tuple[int, str]


@dataclass(frozen=True, eq=False)
class CoefficientUnknowns:
    """Coefficients of the body and of regions, in one channel."""

    names: tuple[str, ...]
    places: tuple[Place, ...]
    given: tuple[Medium, ...]

    @property
    def start(self) -> FloatArray:
        """See `Unknowns`."""
        return np.array([self._at(*place) for place in self.places])

    def media(self, values: FloatArray) -> list[list[Medium]]:
        """See `Unknowns`."""
        media = list(self.given)
        for (number, quantity), value in zip(self.places, values.tolist(), strict=True):
            if quantity != GAIN:
                media[number] = _with_coefficient(media[number], quantity, value)
        return [media]

    def _at(self, number: int, quantity: str) -> float:
        if quantity == GAIN:
            return 1.0
        medium = self.given[number]
        return medium.sigma_a if quantity == "sigma_a" else medium.reduced_scattering

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class TissueUnknowns:
    """Chromophores and scattering at several wavelengths.

    Attributes
    ----------
    names : tuple of str
    places : tuple of (int, str)
    parts : tuple of mapping or of tuple of Medium
        Of the body and of each region: arguments of `tissue`, or the media at all wavelengths, which are known.
    """

    names: tuple[str, ...]
    places: tuple[Place, ...]
    parts: tuple[Mapping[str, Any] | tuple[Medium, ...], ...]

    @property
    def start(self) -> FloatArray:
        """See `Unknowns`."""
        return np.array([self._at(*place) for place in self.places])

    def media(self, values: FloatArray) -> list[list[Medium]]:
        """See `Unknowns`."""
        fitted: list[dict[str, float]] = [{} for _ in self.parts]
        for (number, quantity), value in zip(self.places, values.tolist(), strict=True):
            if quantity != GAIN:
                fitted[number][quantity] = value
        by_part = [
            part if isinstance(part, tuple) else tissue(**{**part, **own})
            for part, own in zip(self.parts, fitted, strict=True)
        ]
        return [list(media) for media in zip(*by_part, strict=True)]

    def _at(self, number: int, quantity: str) -> float:
        part = self.parts[number]
        return 1.0 if quantity == GAIN or isinstance(part, tuple) else float(part.get(quantity, 0.0))

    __repr__ = one_line


def media_unknowns(
    names: Sequence[str],
    start: Start | Sequence[Start | Sequence[Medium]],
    regions: Sequence[Region],
    region_names: Sequence[str] = (),
    others: Sequence[str] = (),
) -> Unknowns:
    """The unknowns of media and the gain that names stand for; `others` are names that a fit knows besides.

    See `tetlux.fem.inverse.parameters.unknowns_of`.
    """
    parts = _parts(start, regions)
    of_tissue = [part for part in parts if isinstance(part, Mapping)]
    prefixes = ["", *(f"{name}." for name in region_names or range(1, len(parts)))]
    known: dict[str, Place] = {
        f"{prefixes[number]}{quantity}": (number, quantity)
        for number, part in enumerate(parts)
        for quantity in _quantities_of(part, of_tissue=bool(of_tissue))
    }
    known[GAIN] = 0, GAIN
    for name in names:
        if name not in known:
            every = ", ".join([*known, *others])
            raise InputError(f'"{name}" is no unknown of this fit; give some of {every}.', field="unknowns")
    places = tuple(known[name] for name in names)
    found: Unknowns
    if of_tissue:
        channels = _channels(of_tissue)
        each = (part if isinstance(part, Mapping) else _of_channels(part, channels, n) for n, part in enumerate(parts))
        found = TissueUnknowns(tuple(names), places, tuple(each))
    else:
        given = tuple(_only(part, number) for number, part in enumerate(parts))
        found = CoefficientUnknowns(tuple(names), places, given)
    for name, value in zip(found.names, found.start.tolist(), strict=True):
        if not value > 0:
            raise InputError(f"{name} begins at {value:g}; begin with a value greater than 0.", field="start")
    found.media(found.start)
    return found


def _parts(start: Start | Sequence[Start | Sequence[Medium]], regions: Sequence[Region]) -> list[Any]:
    """What the body and each region begin with."""
    if isinstance(start, Medium | Mapping):
        return [start, *(region.medium for region in regions)]
    given: object = start
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise InputError(f"start is {start!r}; give a Medium, or the arguments of tissue.", field="start")
    if len(start) != 1 + len(regions):
        raise InputError(
            f"start has {len(start)} entries; give one for the body and one for each of the {len(regions)} regions.",
            field="start",
        )
    return list(start)


def _quantities_of(part: object, *, of_tissue: bool) -> tuple[str, ...]:
    if isinstance(part, Mapping):
        return OF_TISSUE
    return () if of_tissue else COEFFICIENTS


def _channels(of_tissue: Sequence[Mapping[str, Any]]) -> int:
    """How many wavelengths there are, the same ones in all parts."""
    wavelengths = [list(part.get("wavelengths", ())) for part in of_tissue]
    if any(each != wavelengths[0] for each in wavelengths):
        raise InputError("parts of the body have other wavelengths; give all the same.", field="start")
    for part in of_tissue:
        missing = [name for name in NEEDED if name not in part]
        if missing:
            raise InputError(f"start lacks {', '.join(missing)}; give what tissue needs.", field="start")
        unknown = [name for name in part if name not in ARGUMENTS]
        if unknown:
            raise InputError(
                f'start has "{unknown[0]}"; the arguments of tissue are {", ".join(ARGUMENTS)}.', field="start"
            )
    return len(wavelengths[0])


def slopes_of_media(unknowns: Unknowns, values: FloatArray) -> FloatArray:
    """Derivatives of the two coefficients of each medium of each channel to unknowns (u,), (c, r, 2, u)."""
    columns = [np.zeros((*_coefficients(unknowns.media(values)).shape, 0))]
    for number, value in enumerate(values.tolist()):
        step = np.zeros(len(values))
        step[number] = STEP * value
        sides = [_coefficients(unknowns.media(values + side * step)) for side in (1.0, -1.0)]
        columns.append(((sides[0] - sides[1]) / (2.0 * STEP * value))[..., None])
    return np.concatenate(columns, axis=-1)


def _coefficients(media: list[list[Medium]]) -> FloatArray:
    return np.array([[[medium.sigma_a, medium.reduced_scattering] for medium in channel] for channel in media])


def _with_coefficient(medium: Medium, coefficient: str, value: float) -> Medium:
    if coefficient == "sigma_a":
        return replace(medium, sigma_a=value)
    if medium.sigma_s is None:
        return replace(medium, sigma_s_prime=value)
    return replace(medium, sigma_s=value / (1.0 - medium.mean_cosine))


def _only(medium: object, number: int) -> Medium:
    if not isinstance(medium, Medium):
        raise InputError(
            f"{_where(number)} has no single even medium, which a fit begins with; give it one.", field="start"
        )
    return medium


def _of_channels(medium: object, channels: int, number: int) -> tuple[Medium, ...]:
    each = [medium] * channels if isinstance(medium, Medium) else medium
    if not (isinstance(each, Sequence) and len(each) == channels and all(isinstance(one, Medium) for one in each)):
        raise InputError(
            f"{_where(number)} needs one even medium, or one for each of the {channels} wavelengths.", field="start"
        )
    return tuple(each)


def _where(number: int) -> str:
    return f"region {number}" if number else "the body"
