"""`Panel` of the stress map: a pair of axes, the scenarios over them, and the variants of the solver."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from tetlux.cases.stress.scenarios import Scenario
from tetlux.cases.stress.variants import Variant

Value = float | str


@dataclass(frozen=True)
class Axis:
    """An axis of a panel: the quantity that is varied, and its values.

    Attributes
    ----------
    name : str
        With its unit, if it has one.
    values : tuple of float or str
    few : tuple of float or str
        The values of a quick map; by default `values`.
    """

    name: str
    values: tuple[Value, ...]
    few: tuple[Value, ...] = ()


@dataclass(frozen=True)
class Panel:
    """A pair of axes, and the variants that are compared over it.

    Attributes
    ----------
    name : str
    description : str
        What the scenarios are.
    x, y : Axis
    make : callable
        Makes the scenario at a pair of values; defined at module level, since other processes call it.
    variants : tuple of Variant
    fits : callable
        Whether a pair of values has a scenario.
    """

    name: str
    description: str
    x: Axis
    y: Axis
    make: Callable[..., Scenario]
    variants: tuple[Variant, ...]
    fits: Callable[..., bool] = lambda *_: True

    def quick(self) -> "Panel":
        """The same panel with few values."""
        x, y = (replace(axis, values=axis.few or axis.values) for axis in (self.x, self.y))
        return replace(self, x=x, y=y)

    def places(self) -> list[tuple[Value, Value]]:
        """The pairs of values that have scenarios, row by row."""
        return [(x, y) for y in self.y.values for x in self.x.values if self.fits(x, y)]
