"""Lights and media a little different, for differences of what charges and loads follow from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tetlux.fem.charges.placement import ChargePlacement
from tetlux.fem.known.charges import Charges
from tetlux.fem.known.split import SplitLights
from tetlux.fem.media.coefficients import AnyMedium, by_label
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.varying import VaryingMedium
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.system import System
from tetlux.meshing.arrays import FloatArray, NumberArray

Coefficient = Literal["sigma_a", "sigma_s_prime"]
# Step of central differences, as a share of the coefficient, and how it is shortened where a charge comes or goes:
# those of images do at some ratios of coefficients.
STEP = 2e-4
SHORTER, SHORTENINGS = 0.1, 3
# Weights of the values one step to each side.
WEIGHTS = {1.0: 0.5, -1.0: -0.5}
# Positions and strengths that differ by less than this share are the same.
SAME = 1e-13


@dataclass(frozen=True, eq=False)
class Nearby:
    """Lights in a medium that is a little different, one of some, with a weight of the value for differences.

    Strengths of fitted charges are not those of that medium.
    """

    weight: float
    system: System
    split: SplitLights


@dataclass(frozen=True, eq=False)
class Change:
    """Charges of a patch as some coefficient changes.

    Attributes
    ----------
    nearby : sequence of Charges
        In lights and media that are a little different.
    weights : sequence of float
        Of each in the difference.
    coefficient : {"sigma_a", "sigma_s_prime"}, optional
        That of their medium that changes; None where that stays as it is.
    placement : ChargePlacement, optional
        Where charges are that were fitted, and whose strengths follow from that.
    """

    nearby: Sequence[Charges]
    weights: Sequence[float]
    coefficient: Coefficient | None = None
    placement: ChargePlacement | None = None

    def sum(self, name: str) -> NumberArray:
        """The derivative of an attribute of the charges."""
        return np.asarray(sum(weight * getattr(each, name) for weight, each in self.weighted))

    @property
    def weighted(self) -> list[tuple[float, Charges]]:
        """The charges with their weights."""
        return list(zip(self.weights, self.nearby, strict=True))


def change_of(nearby: Sequence[Nearby], light: int, patch: int, coefficient: Coefficient | None = None) -> Change:
    """How the charges of a patch of a light change."""
    fitted = nearby[0].split.fitted.get(light)
    return Change(
        [_charges_of(each.split, light)[patch] for each in nearby],
        [each.weight for each in nearby],
        coefficient,
        None if fitted is None else fitted.placement,
    )


def change_medium(system: System, label: int, coefficient: Coefficient, step: float) -> System:
    """A system with a coefficient of one medium larger by a step, 1/unit."""
    changed = dict(by_label(system.media))
    changed[label] = _add(changed[label], coefficient, step)
    if isinstance(system.medium, Mapping):
        return replace(system, medium=changed)
    regions = tuple(replace(region, medium=changed[number]) for number, region in enumerate(system.regions, 1))
    return replace(system, medium=changed[0], regions=regions)


def _add(medium: AnyMedium, coefficient: Coefficient, step: float) -> AnyMedium:
    if isinstance(medium, VaryingMedium):
        varying, base = getattr(medium, coefficient), _add(medium.base, coefficient, step)
        assert isinstance(base, Medium)
        return replace(medium, base=base, **({} if varying is None else {coefficient: lambda at: varying(at) + step}))
    if coefficient == "sigma_s_prime" and medium.sigma_s is not None:
        return replace(medium, sigma_s=medium.sigma_s + step / (1.0 - medium.mean_cosine))
    if coefficient == "sigma_s_prime":
        return replace(medium, sigma_s_prime=medium.reduced_scattering + step)
    return replace(medium, sigma_a=medium.sigma_a + step)


def has_rest(deposit: Deposit) -> bool:
    """Whether a deposit has points or beams, or anything that only a mesh tells."""
    return len(deposit.terms.points) > 0 or len(deposit.terms.segments) > 0 or deposit.on_mesh is not None


def _charges_of(split: SplitLights, light: int) -> list[Charges]:
    """The charges of a light, in the order of its patches."""
    found = [charges for charges, owner in zip(split.charges, split.owners, strict=True) if owner == light]
    return [*found, *([split.fitted[light].charges] if light in split.fitted else [])]


def has_charges_of(split: SplitLights, known: Sequence[Sequence[Charges]]) -> bool:
    """Whether each light has as many charges as those that are known of it, and fitted ones at the same places."""
    for light, own in enumerate(known):
        found = _charges_of(split, light)
        if [len(each.positions) for each in found] != [len(each.positions) for each in own]:
            return False
        if light in split.fitted and not np.array_equal(_outside(found[-1]), _outside(own[-1])):
            return False
    return True


def _outside(charges: Charges) -> FloatArray:
    return charges.positions[charges.sources :]


def power_change(known: Charges, changed: Change) -> float | None:
    """The relative derivative of power where nothing else of charges changes; None if anything does."""
    if changed.coefficient is not None or changed.placement is not None:
        return None
    change = 0.0
    for weight, each in changed.weighted:
        power = (each.strengths[0] / known.strengths[0]).item()
        change += weight * power
        if not (
            np.allclose(each.positions, known.positions, rtol=SAME, atol=0.0)
            and np.allclose(each.strengths, power * known.strengths, rtol=SAME, atol=0.0)
        ):
            return None
    return change
