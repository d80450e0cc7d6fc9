"""`Variant`s: settings of the solver that the stress map compares."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


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
