"""Deposits are plain data: what a worker receives of one loads its mesh as the original does."""

import pickle

import numpy as np
import pytest

from tests.conftest import TISSUE, block
from tests.lights_made import lights_of_every_kind
from tetlux.fem import Medium
from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import AnyMedium, coefficients_on
from tetlux.fem.media.varying import VaryingMedium
from tetlux.fem.operators.loads import load_vector
from tetlux.fem.sources.deposit import Deposit, merge_deposits
from tetlux.meshing.arrays import FloatArray

CUBE = block((4, 4, 4), (4.0, 4.0, 4.0))
FORWARD = Medium(sigma_a=0.05, sigma_s=2.0, g=0.8, eta=1.4)
LIGHTS = lights_of_every_kind((0.1, 0.2, -1.3), (0.1, 0.2, -1.0))


def sent(deposit: Deposit) -> Deposit:
    received = pickle.loads(pickle.dumps(deposit))
    assert isinstance(received, Deposit)
    return received


def load_of(deposit: Deposit, medium: AnyMedium) -> tuple[Deposit, FloatArray]:
    coefficients = coefficients_on(CUBE, {0: medium})
    found = deposit.evaluate_on(CUBE, CUBE.surface, coefficients)
    return found, load_vector(CUBE, coefficients, found.terms)


def check_same(deposit: Deposit, medium: AnyMedium) -> None:
    here, load = load_of(deposit, medium)
    there, other_load = load_of(sent(deposit), medium)
    assert np.abs(load).max() > 0
    np.testing.assert_array_equal(load, other_load)
    assert here.ledger == there.ledger


@pytest.mark.parametrize("varying", [False, True], ids=["one medium", "varying"])
@pytest.mark.parametrize("name", LIGHTS)
def test_a_pickled_deposit_loads_a_mesh_as_the_deposit_does(name: str, *, varying: bool) -> None:
    medium: AnyMedium = FORWARD
    if varying:
        medium = VaryingMedium(base=FORWARD, sigma_a=lambda p: 0.05 * (1.0 + p[:, 2] ** 2))
    deposit = LIGHTS[name].deposit_in(Body(CUBE.surface, (medium,)))
    check_same(deposit, medium)
    received = sent(deposit)
    assert [(type(w), getattr(w, "code", w)) for w in received.warnings] == [
        (type(w), getattr(w, "code", w)) for w in deposit.warnings
    ]
    footprint = deposit.footprint
    assert received.footprint.radius == footprint.radius
    assert received.footprint.beams_as_points == footprint.beams_as_points


def test_a_sum_of_deposits_is_pickled_too() -> None:
    body = Body(CUBE.surface, (TISSUE,))
    check_same(merge_deposits([light.deposit_in(body) for light in LIGHTS.values()]), TISSUE)
