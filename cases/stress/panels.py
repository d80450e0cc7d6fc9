"""What a panel of the stress map is: a pair of axes, the scenarios over them, and the variants of the solver."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from tetlux.cases.stress.scenarios import Scenario
from tetlux.cases.stress.variants import Variant

Value = float | str


@dataclass(frozen=True)
class Axis:
    """What is varied, and how.

    Attributes
    ----------
    name : str
        With its unit, if it has one.
    values : tuple of float or str
    few : tuple of float or str
        Those of a quick map; the same if it is not given.
    """

    name: str
    values: tuple[Value, ...]
    few: tuple[Value, ...] = ()


@dataclass(frozen=True)
class Panel:
    """A pair of axes, with the variants that are compared on it.

    Attributes
    ----------
    name : str
    description : str
        What is solved for.
    x, y : Axis
    make : callable
        The scenario at a pair of values; a function of a module, as it is called in other processes.
    variants : tuple of Variant
    fits : callable
        Whether there is a scenario at a pair of values.
    """

    name: str
    description: str
    x: Axis
    y: Axis
    make: Callable[..., Scenario]
    variants: tuple[Variant, ...]
    fits: Callable[..., bool] = lambda *_: True

    def quick(self) -> "Panel":
        """The same with few values."""
        x, y = (replace(axis, values=axis.few or axis.values) for axis in (self.x, self.y))
        return replace(self, x=x, y=y)

    def places(self) -> list[tuple[Value, Value]]:
        """The pairs of values that there are scenarios at, row by row."""
        return [(x, y) for y in self.y.values for x in self.x.values if self.fits(x, y)]
