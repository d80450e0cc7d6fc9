"""Derivatives of fields of charges in closed form, against differences."""

import numpy as np
import pytest

from tetlux.fem.charges.derivative import ChargeDerivatives
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.kernel import Equation
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
