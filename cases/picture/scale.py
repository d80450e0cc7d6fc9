"""`Scale`: which colour stands for which value of a picture, and the ticks of its colour bar."""

import math
from dataclasses import dataclass

import numpy as np

from tetlux.cases.picture.colour_maps import color_table
from tetlux.meshing.arrays import FloatArray

# The colour map spans at most this many decades below the maximum.
DECADES = 6.0
# The colour map spans at least this factor, since a narrower range would show rounding errors as a pattern.
NARROWEST = 2.0
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, eq=False)
class Scale:
    """Values, and their positions on a colour map.

    Attributes
    ----------
    quantity, unit : str
        As they stand over the colour bar; `unit` is empty where there is none.
    ends : (float, float) or None
        Values at the ends of the colour map; None if no light leaves.
    logarithmic : bool
    table : (256, 3) ndarray
        The colour map, red, green and blue from 0 to 1.
    """

    quantity: str
    unit: str
    ends: tuple[float, float] | None
    logarithmic: bool
    table: FloatArray

    def shares(self, values: FloatArray) -> FloatArray:
        """Positions of values (n,) on the colour map, 0 to 1; what is not known is at 0."""
        if self.ends is None:
            return np.zeros(len(values))
        bottom, top = self.ends
        clipped = np.clip(np.nan_to_num(values, nan=bottom, posinf=top, neginf=bottom), bottom, top)
        if self.logarithmic:
            return np.asarray(np.log(clipped / bottom) / math.log(top / bottom))
        return np.asarray((clipped - bottom) / (top - bottom))

    def has_below(self, values: FloatArray) -> bool:
        """Whether some values (n,) are below the lower end."""
        return self.ends is not None and bool((values < self.ends[0] - 1e-9 * abs(self.ends[0])).any())

    def ticks(self) -> list[tuple[float, str]]:
        """Ticks of the colour bar: values and labels."""
        if self.ends is None:
            return []
        return bar_ticks(*self.ends) if self.logarithmic else even_ticks(*self.ends)

    @property
    def heading(self) -> str:
        """What stands over the colour bar."""
        return f"{self.quantity}\n{self.unit}" if self.unit else self.quantity


def scale_of(
    values: FloatArray,
    quantity: str,
    unit: str,
    *,
    logarithmic: bool = True,
    ends: tuple[float | None, float | None] = (None, None),
    colour_map: str = "inferno",
) -> Scale:
    """The scale of values (n,), from their own least to largest where `ends` gives none."""
    found = exitance_range(values) if logarithmic else linear_range(values)
    if found is not None:
        low, high = (own if given is None else given for own, given in zip(found, ends, strict=True))
        # One end alone was given, beyond all values.
        if not low < high:
            low, high = (
                (low, 2 * abs(low) + 1) if ends[0] is not None else ((high / 10 if logarithmic else high - 1), high)
            )
        found = low, high
    return Scale(quantity, unit, found, logarithmic, color_table(colour_map))


def exitance_range(exitance: FloatArray) -> tuple[float, float] | None:
    """The exitance at the ends of a logarithmic colour map; None if no light leaves.

    The range ends at the largest value. It begins at the smallest positive one, but at most `DECADES` below the
    largest, and spans at least a factor of `NARROWEST`.
    """
    positive = exitance[np.isfinite(exitance) & (exitance > 0)]
    if len(positive) == 0:
        return None
    top = float(positive.max())
    bottom = max(float(positive.min()), top * 10.0**-DECADES)
    return min(bottom, top / NARROWEST), top


def linear_range(values: FloatArray) -> tuple[float, float] | None:
    """From 0, or the least value below it, to the largest; None if there is none."""
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return None
    low, high = min(float(known.min()), 0.0), float(known.max())
    return low, high if high > low else low + 1.0


def round_length(longest: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above `longest`."""
    power = 10.0 ** math.floor(math.log10(longest))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest)


def bar_ticks(bottom: float, top: float) -> list[tuple[float, str]]:
    """Ticks of a logarithmic colour bar, values and labels: decades, or finer steps on a short bar."""
    low, high = math.ceil(math.log10(bottom) - 1e-9), math.floor(math.log10(top) + 1e-9)
    if high - low >= 2:
        return [(10.0**n, f"10{_superscript(n)}") for n in range(low, high + 1)]
    if top / bottom <= 5.0:
        return even_ticks(bottom, top)
    steps = [s * 10.0**n for n in range(low - 1, high + 1) for s in (1.0, 2.0, 5.0)]
    return [(s, number_label(s)) for s in steps if bottom * (1 - 1e-9) <= s <= top * (1 + 1e-9)]


def even_ticks(bottom: float, top: float) -> list[tuple[float, str]]:
    """Ticks of a linear colour bar, values and labels."""
    step = round_length((top - bottom) / 3.0)
    numbers = range(math.ceil(bottom / step - 1e-9), math.floor(top / step + 1e-9) + 1)
    return [(n * step, number_label(n * step)) for n in numbers]


def number_label(value: float) -> str:
    """A number as it stands beside a tick."""
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(value)))
    if -3 <= power <= 3:
        return f"{value:.6g}"
    return f"{value / 10.0**power:.4g}×10{_superscript(power)}"


def _superscript(number: int) -> str:
    return str(number).translate(SUPERSCRIPTS)
