"""`Panel` of the stress map: a pair of axes, the scenarios over them, and the `Variant`s of the solver."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from tetlux.cases.stress.scenes.scenarios import Scenario

Value = float | str


@dataclass(frozen=True)
class Variant:
    """Settings of the solver.

    Attributes
    ----------
    name : str
    options : dict
        Keyword arguments of `tetlux.fem.solve`.
    adaptive : bool
        Whether the mesh is refined until the estimated error is within the tolerance; no effect on a given mesh.
    counts : bool
        Whether breaking a rule is a violation; other variants are there for comparison only.
    """

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    adaptive: bool = True
    counts: bool = False


CHARGES = Variant("charges", {"model": "charges"}, counts=True)
DEFAULT = Variant("default", counts=True)
PLANNED = Variant("chosen by the plan", {"model": "auto"}, counts=True)
TRUNCATED = Variant("truncated", {"model": "truncated"}, counts=True)
NOT_REFINED = Variant("default, not refined", adaptive=False, counts=True)
NO_LIMITER = Variant("no limiter", {"limit": False})
CONSISTENT = Variant("consistent mass, no limiter", {"mass": "consistent", "limit": False})
FREE_SPACE = Variant("free space subtracted", {"subtract": "free-space"})
NOTHING = Variant("nothing subtracted", {"subtract": "nothing"})
# Variants that differ in how they keep the fluence nonnegative.
SIGN_VARIANTS = (DEFAULT, NO_LIMITER, CONSISTENT)


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
