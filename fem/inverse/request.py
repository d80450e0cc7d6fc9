"""`FitRequest`: what a fit is asked for, checked before anything is solved."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from tetlux.fem.inverse.parameters import FitUnknowns, unknowns_of
from tetlux.fem.inverse.unknowns import FRACTIONS, HAEMOGLOBIN, Start, TissueUnknowns, Unknowns
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region
from tetlux.fem.media.tissue import MOST_HAEMOGLOBIN
from tetlux.fem.outcome.reading import Reading
from tetlux.fem.sources.light import Light
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError

# Unknowns end within this factor of their start.
WIDEST = 1e3
# Amounts reach this share of the most that `tissue` takes, so that steps of differences stay below it.
FULL = 0.999

Readings = npt.ArrayLike | Sequence[Reading] | Sequence[Sequence[Reading]]
Starts = Start | Sequence[Start | Sequence[Medium]]
Bounds = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class FitRequest:
    """What is fitted to what.

    Attributes
    ----------
    unknowns : FitUnknowns
    readings : (c, l, d) ndarray
        Measured exitance of each channel, light and detector, W/unit²; nan where there is none.
    noise : (c, l, d) ndarray
        Relative standard deviations.
    noise_is_known : bool
        Whether it is not to be estimated by the residuals.
    bounds : (u, 2) ndarray
        Least and largest values of the unknowns.
    """

    unknowns: FitUnknowns
    readings: NumberArray
    noise: FloatArray
    noise_is_known: bool
    bounds: FloatArray

    __repr__ = one_line


def make_request(
    unit: str,
    lights: Sequence[Light],
    detectors: int,
    readings: Readings,
    unknowns: Sequence[str],
    start: Starts,
    *,
    regions: Sequence[Region] = (),
    noise: npt.ArrayLike | None = None,
    bounds: Bounds | None = None,
    frequency: float = 0.0,
    region_names: Sequence[str] = (),
    light_names: Sequence[str] = (),
) -> FitRequest:
    """Check what `tetlux.fem.fit` is given, of a body in a unit of length and a number of detectors.

    Raises
    ------
    InputError
        If an argument is not sensible, or there are more unknowns than readings.
    """
    wanted = unknowns_of(
        unknowns, _with_unit(start, unit), regions, lights, region_names=region_names, light_names=light_names
    )
    measured = _measured(readings, len(wanted.media(wanted.start)), len(lights), detectors)
    if np.iscomplexobj(measured) != bool(frequency):
        kind = "complex readings, with their phases" if frequency else "real readings, or a frequency"
        raise InputError(f"the light is {'modulated' if frequency else 'steady'}; give {kind}.", field="readings")
    relative = _noise(noise, measured)
    numbers = int(np.isfinite(measured).sum()) * (2 if np.iscomplexobj(measured) else 1)
    if len(wanted.names) > numbers:
        raise InputError(
            f"there are {len(wanted.names)} unknowns and {numbers} readings; give fewer unknowns or more readings.",
            field="unknowns",
        )
    return FitRequest(wanted, measured, relative, noise is not None, _bounds(wanted, bounds or {}))


def _with_unit(start: Starts, unit: str) -> Starts:
    """The start with arguments of `tissue` for a body in a unit of length."""
    if isinstance(start, Mapping):
        if start.get("unit", unit) != unit:
            raise InputError(
                f"start has the unit {start['unit']}, and the body is in {unit}; leave unit out.", field="start"
            )
        return {**start, "unit": unit}
    if isinstance(start, Medium) or not isinstance(start, Sequence):
        return start
    return [_with_unit(each, unit) if isinstance(each, Mapping) else each for each in start]  # type: ignore[misc]


def _bounds(unknowns: FitUnknowns, given: Bounds) -> FloatArray:
    """Least and largest values of the unknowns, (u, 2)."""
    start, positive = unknowns.start, unknowns.positive
    bounds = np.column_stack([np.where(positive, start / WIDEST, -np.inf), np.where(positive, start * WIDEST, np.inf)])
    for name, limits in given.items():
        if name not in unknowns.names:
            raise InputError(
                f'there are bounds of "{name}", which is no unknown; give those of {", ".join(unknowns.names)}.',
                field="bounds",
            )
        number = unknowns.names.index(name)
        pair = np.asarray(limits)
        least = 0.0 if positive[number] else -np.inf
        if pair.shape != (2,) or pair.dtype.kind not in "if" or not least < pair[0] < pair[1] < np.inf:
            shown = (
                " and ".join(f"{value:g}" for value in pair) if pair.dtype.kind in "if" and pair.ndim else f"{limits}"
            )
            values = "values greater than 0" if positive[number] else "coordinates"
            raise InputError(f"bounds of {name} are {shown}; give two {values}, the lower one first.", field="bounds")
        low, high = pair.tolist()
        if not low <= start[number] <= high:
            raise InputError(
                f"{name} begins at {start[number]:g}, outside of its bounds {low:g} and {high:g}; begin within them.",
                field="bounds",
            )
        bounds[number] = low, high
    rows = unknowns.media_rows
    bounds[rows] = _limit_amounts(unknowns.of_media, bounds[rows])
    return bounds


def _limit_amounts(unknowns: Unknowns, bounds: FloatArray) -> FloatArray:
    """Bounds (u, 2) within what `tissue` takes: fractions of a part never add up to more than 1."""
    if not isinstance(unknowns, TissueUnknowns):
        return bounds
    for number, part in enumerate(unknowns.parts):
        if isinstance(part, tuple):
            continue
        places = list(enumerate(unknowns.places))
        rows = [row for row, (owner, quantity) in places if owner == number and quantity in FRACTIONS]
        for row in [row for row, (_, quantity) in places if quantity in HAEMOGLOBIN]:
            bounds[row, 1] = min(bounds[row, 1], FULL * MOST_HAEMOGLOBIN)
        room = FULL - _filled(part)
        for row in rows:
            bounds[row, 1] = min(bounds[row, 1], unknowns.start[row] + max(room, 0.0) / len(rows))
    return bounds


def _filled(part: Mapping[str, Any]) -> float:
    """The share of the volume that fractions fill at the start."""
    others = (amount for spectrum, amount in (part.get("others") or {}).values() if spectrum.kind == "absorption")
    return float(sum(part.get(name, 0.0) for name in FRACTIONS) + sum(others))


def _measured(readings: Readings, channels: int, lights: int, detectors: int) -> NumberArray:
    """Measured readings as an array (c, l, d)."""
    rows: Any = readings
    if isinstance(rows, Sequence):
        rows = [
            each.exitance
            if isinstance(each, Reading)
            else [one.exitance if isinstance(one, Reading) else one for one in each]
            if isinstance(each, Sequence)
            else each
            for each in rows
        ]
    values = _as_array(rows)
    if values is None or values.size != channels * lights * detectors:
        shape = "rows of different lengths" if values is None else f"shape {values.shape}"
        raise InputError(
            f"readings have {shape}; give {channels} x {lights} x {detectors} numbers, one for each "
            "wavelength, light and detector.",
            field="readings",
        )
    values = values.reshape(channels, lights, detectors)
    known = values[~np.isnan(values)]
    if not np.isfinite(known).all() or (known == 0 if np.iscomplexobj(values) else known <= 0).any():
        raise InputError(
            "a reading is 0 or below: that detector is in the dark; leave it out, or give nan.", field="readings"
        )
    return values


def _as_array(rows: Any) -> NumberArray | None:
    """Numbers as an array; None of what is no array of numbers."""
    try:
        values = np.asarray(rows)
    except ValueError:
        return None
    return values if values.dtype.kind in "iufc" else None


def _noise(noise: npt.ArrayLike | None, measured: NumberArray) -> FloatArray:
    """Relative standard deviations as an array (c, l, d)."""
    given = np.asarray(1.0 if noise is None else noise)
    if given.dtype.kind not in "if":
        raise InputError(f"noise is {noise!r}; give a relative standard deviation of readings.", field="noise")
    if given.size not in (1, measured.size):
        raise InputError(f"noise has shape {given.shape}; give one number, or one for each reading.", field="noise")
    shape = measured.shape
    full = np.full(shape, float(given.item())) if given.size == 1 else given.reshape(shape).astype(float)
    of_readings = full[~np.isnan(measured)]
    if not (np.isfinite(of_readings).all() and (of_readings > 0).all()):
        raise InputError("noise is a relative standard deviation of readings, greater than 0.", field="noise")
    return full
