"""Derivatives of fields of charges in closed form, against differences."""

from dataclasses import replace

import numpy as np
import pytest

from tetlux.fem.charges.adapt import LightSources, fit_for_remainder, fit_strengths
from tetlux.fem.charges.change import differentiate_strengths
from tetlux.fem.charges.derivative import ChargeDerivatives
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.kernel import Equation
from tetlux.meshing import Surface
from tetlux.meshing.arrays import NumberArray

RANDOM = np.random.default_rng(3)
PLACES = RANDOM.uniform(-1.0, 1.0, (7, 3))
POINTS = 3.0 + RANDOM.uniform(-1.0, 1.0, (40, 3))


def field_at(way: float, wave_number: complex, closest: float) -> ChargeField:
    """Charges that all depend on one number."""
    random = np.random.default_rng(4)
    moved, stronger = random.uniform(-1.0, 1.0, (7, 3)), random.uniform(-1.0, 1.0, 7)
    equation = Equation(wave_number * (1.0 + way), 0.3 * (1.0 - 2.0 * way), 2.5)
    return ChargeField(equation, PLACES + way * moved, 1.0 + way * stronger, closest * (1.0 + way))


def derivative_of(wave_number: complex, closest: float) -> ChargeDerivatives:
    random = np.random.default_rng(4)
    moved, stronger = random.uniform(-1.0, 1.0, (7, 3)), random.uniform(-1.0, 1.0, 7)
    known = field_at(0.0, wave_number, closest)
    # The second is half of the first.
    halves = np.array([1.0, 0.5])
    return ChargeDerivatives(
        known,
        np.multiply.outer(halves, moved),
        np.multiply.outer(halves, stronger),
        wave_number * halves,
        -0.6 * halves,
        closest * halves,
    )


@pytest.mark.parametrize("wave_number", [0.4, 0.4 + 0.3j])
def test_fluence_and_flux_have_the_slopes_of_differences(wave_number: complex) -> None:
    step = 1e-4
    before, after = (field_at(way, wave_number, 0.0) for way in (-step, step))
    found = derivative_of(wave_number, 0.0)

    def slope(of: str) -> NumberArray:
        return np.asarray((getattr(after, of)(POINTS) - getattr(before, of)(POINTS)) / (2.0 * step))

    fluence, flux = found.fluence_and_flux(POINTS)
    pairs = zip(before.fluence_and_flux(POINTS), after.fluence_and_flux(POINTS), strict=True)
    slope_of_flux = [(b - a) / (2.0 * step) for a, b in pairs][1]
    for number, share in enumerate((1.0, 0.5)):
        assert found.fluence(POINTS)[:, number] == pytest.approx(share * slope("fluence"), rel=1e-6, abs=1e-8)
        assert found.potential(POINTS)[:, number] == pytest.approx(share * slope("potential"), rel=1e-6, abs=1e-8)
        assert fluence[:, number] == pytest.approx(share * slope("fluence"), rel=1e-6, abs=1e-8)
        assert flux[..., number] == pytest.approx(share * slope_of_flux, rel=1e-5, abs=1e-8)


def test_points_next_to_a_charge_have_the_slope_at_the_least_distance() -> None:
    step, beside = 1e-4, PLACES + 1e-3
    before, after = (field_at(way, 0.4, 0.05) for way in (-step, step))
    slope = (after.fluence(beside) - before.fluence(beside)) / (2.0 * step)
    assert derivative_of(0.4, 0.05).fluence(beside)[:, 0] == pytest.approx(slope, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize("attenuation", [0.2, 0.2 + 0.05j])
def test_strengths_change_as_those_of_fits_nearby(ball: Surface, attenuation: complex) -> None:
    """By what they give inside: where charges outweigh each other, strengths alone hardly matter.

    So few charges leave a residual that matters too.
    """
    step, wide = 1e-4, 1e-2
    inside = np.random.default_rng(5).uniform(-5.0, 5.0, (50, 3))
    rough = fit_for_remainder(ball, Equation(0.2, 0.3, 2.5), lights_at(0.0), tolerance=0.1)
    assert rough is not None
    placement = replace(rough.placement, charges=rough.placement.charges[::8])
    count = len(placement.charges)

    def fitted(way: float) -> ChargeField:
        equation = Equation(attenuation * (1.0 + way), 0.3 * (1.0 - 2.0 * way), 2.5)
        field, _ = fit_strengths(placement, equation, lights_at(way))
        return replace(field, strengths=field.strengths[:, 0])

    known, before, after = fitted(0.0), fitted(-step), fitted(step)
    # Strengths of charges nearby do not count.
    pair = [(0.5 * sign / step, replace(each, strengths=sources_of(each))) for sign, each in ((-1, before), (1, after))]
    nothing = [(weight, known) for weight in (-1.0, 1.0)]
    found = differentiate_strengths(placement, known, [pair, nothing])

    def inner(strengths: NumberArray) -> NumberArray:
        return known.equation.fluence(inside, placement.charges, strengths)

    slope = inner((fitted(wide).strengths - fitted(-wide).strengths)[-count:]) / (2.0 * wide)
    assert inner(found[0]) == pytest.approx(slope, rel=2e-3, abs=1e-3 * np.abs(slope).max())
    assert inner(found[1]) == pytest.approx(0.0, abs=1e-9 * np.abs(slope).max())


def lights_at(way: float) -> LightSources:
    """Two sources that move and change as everything does."""
    points = np.array([[0.0, 0.0, 8.0 + way], [1.0, way, 7.0]])
    return LightSources(points, np.array([[1.0 + way], [0.5]]), np.zeros(1))


def sources_of(field: ChargeField) -> NumberArray:
    return np.concatenate([field.strengths[:2], np.zeros(len(field.strengths) - 2)])
