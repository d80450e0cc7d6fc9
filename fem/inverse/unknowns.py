"""What is fitted: coefficients of the body and of its regions, or what tissue consists of."""

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
# The unknown factor of all readings.
GAIN = "gain"
# Step of central differences of media by unknowns, as a share of these.
STEP = 1e-4


class Unknowns(Protocol):
    """Unknowns, and the media that follow from them."""

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


@dataclass(frozen=True, eq=False)
class CoefficientUnknowns:
    """Coefficients of the body and of regions, in one channel."""

    names: tuple[str, ...]
    given: tuple[Medium, ...]

    @property
    def start(self) -> FloatArray:
        """See `Unknowns`."""
        return np.array([1.0 if name == GAIN else self._at(name) for name in self.names])

    def media(self, values: FloatArray) -> list[list[Medium]]:
        """See `Unknowns`."""
        media = list(self.given)
        for name, value in zip(self.names, values.tolist(), strict=True):
            if name != GAIN:
                number, coefficient = _split(name)
                media[number] = _with_coefficient(media[number], coefficient, value)
        return [media]

    def _at(self, name: str) -> float:
        number, coefficient = _split(name)
        medium = self.given[number]
        return medium.sigma_a if coefficient == "sigma_a" else medium.reduced_scattering

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class TissueUnknowns:
    """Chromophores and scattering of the body at several wavelengths; media of regions (c, r) are known."""

    names: tuple[str, ...]
    given: Mapping[str, Any]
    regions: tuple[tuple[Medium, ...], ...]

    @property
    def start(self) -> FloatArray:
        """See `Unknowns`."""
        return np.array([1.0 if name == GAIN else float(self.given.get(name, 0.0)) for name in self.names])

    def media(self, values: FloatArray) -> list[list[Medium]]:
        """See `Unknowns`."""
        fitted = {name: value for name, value in zip(self.names, values.tolist(), strict=True) if name != GAIN}
        return [
            [medium, *others] for medium, others in zip(tissue(**{**self.given, **fitted}), self.regions, strict=True)
        ]

    __repr__ = one_line


def unknowns_of(names: Sequence[str], start: Medium | Mapping[str, Any], regions: Sequence[Region]) -> Unknowns:
    """The unknowns that names stand for.

    Raises
    ------
    InputError
        If a name is not known or given twice, or a start is 0.
    """
    if isinstance(names, str) or len(names) == 0:
        raise InputError(
            "unknowns are given in a list of names, and there is none; give at least one.", field="unknowns"
        )
    repeated = next((name for name in names if list(names).count(name) > 1), None)
    if repeated is not None:
        raise InputError(f'the unknown "{repeated}" is given twice; give each once.', field="unknowns")
    if isinstance(start, Medium):
        media = [_only(region.medium, number) for number, region in enumerate(regions, 1)]
        known = [
            f"{prefix}{name}"
            for prefix in ["", *(f"{n}." for n in range(1, len(regions) + 1))]
            for name in COEFFICIENTS
        ]
        found: Unknowns = CoefficientUnknowns(tuple(names), (start, *media))
    else:
        channels = len(start.get("wavelengths", ()))
        of_regions = [_of_channels(region.medium, channels, number) for number, region in enumerate(regions, 1)]
        known = list(OF_TISSUE)
        found = TissueUnknowns(tuple(names), start, tuple(zip(*of_regions, strict=True)) or ((),) * channels)
    for name in names:
        if name not in (*known, GAIN):
            raise InputError(
                f'"{name}" is no unknown of this fit; give some of {", ".join([*known, GAIN])}.', field="unknowns"
            )
    for name, value in zip(found.names, found.start.tolist(), strict=True):
        if not value > 0:
            raise InputError(f"{name} begins at {value:g}; begin with a value greater than 0.", field="start")
    return found


def slopes_of_media(unknowns: Unknowns, values: FloatArray) -> FloatArray:
    """Derivatives of the two coefficients of each medium of each channel to unknowns (u,), (c, r, 2, u)."""
    columns = []
    for number, value in enumerate(values.tolist()):
        step = np.zeros(len(values))
        step[number] = STEP * value
        sides = [_coefficients(unknowns.media(values + side * step)) for side in (1.0, -1.0)]
        columns.append((sides[0] - sides[1]) / (2.0 * STEP * value))
    return np.stack(columns, axis=-1)


def _coefficients(media: list[list[Medium]]) -> FloatArray:
    return np.array([[[medium.sigma_a, medium.reduced_scattering] for medium in channel] for channel in media])


def _split(name: str) -> tuple[int, str]:
    """The number of the region that a name is of, 0 for the body, and the coefficient."""
    number, _, coefficient = name.rpartition(".")
    return int(number or 0), coefficient


def _with_coefficient(medium: Medium, coefficient: str, value: float) -> Medium:
    if coefficient == "sigma_a":
        return replace(medium, sigma_a=value)
    if medium.sigma_s is None:
        return replace(medium, sigma_s_prime=value)
    return replace(medium, sigma_s=value / (1.0 - medium.mean_cosine))


def _only(medium: object, number: int) -> Medium:
    if not isinstance(medium, Medium):
        raise InputError(f"region {number} has no single even medium, which a fit begins with; give one Medium.")
    return medium


def _of_channels(medium: object, channels: int, number: int) -> list[Medium]:
    each = [medium] * channels if isinstance(medium, Medium) else medium
    if not (isinstance(each, Sequence) and len(each) == channels and all(isinstance(one, Medium) for one in each)):
        raise InputError(f"region {number} needs one Medium, or one for each of the {channels} wavelengths.")
    return list(each)
