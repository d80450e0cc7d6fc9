"""Deposits are plain data: what a worker receives of one loads its mesh as the original does."""

import pickle

import numpy as np
import pytest

from tests.conftest import TISSUE, block
from tetlux.fem import (
    CollimatedBeam,
    DiffuseLight,
    DiffusePatch,
    Disc,
    Emission,
    EnvironmentLight,
    Gaussian,
    Image,
    Light,
    Medium,
    PencilBeam,
    PointSource,
    Rectangle,
)
from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import AnyMedium, coefficients_on
from tetlux.fem.media.varying import VaryingMedium
from tetlux.fem.operators.loads import load_vector
from tetlux.fem.sources.deposit import Deposit, together

CUBE = block((4, 4, 4), (4.0, 4.0, 4.0))
PIXELS = np.random.default_rng(4).random((5, 7))
FORWARD = Medium(sigma_a=0.05, sigma_s=2.0, g=0.8, eta=1.4)
CENTER, DOWN = (0.1, 0.13, 5.0), (0.1, 0.2, -1.0)
LIGHTS: dict[str, Light] = {
    "point": PointSource((0.1, 0.2, -1.3)),
    "pencil": PencilBeam(CENTER, DOWN),
    "line": PencilBeam(CENTER, DOWN, deposit="line"),
    "round pencil": PencilBeam(CENTER, DOWN, radius=0.5),
    "round line": PencilBeam(CENTER, DOWN, radius=0.5, deposit="line"),
    "whole": CollimatedBeam(DOWN),
    "disc": CollimatedBeam(DOWN, 1.0, Disc(CENTER, 0.7)),
    "gaussian": CollimatedBeam(DOWN, 1.0, Gaussian(CENTER, 0.5)),
    "rectangle": CollimatedBeam(DOWN, 1.0, Rectangle(CENTER, 1.0, 0.5)),
    "image": CollimatedBeam(DOWN, 1.0, Image(CENTER, 1.0, PIXELS)),
    "diffuse": DiffuseLight(1.0),
    "patch": DiffusePatch((0.1, 0.2, 0.0), 0.8, 1.0),
    "environment": EnvironmentLight(PIXELS),
    "glow": Emission(1.0),
    "glow of a region": Emission(1.0, region=0),
}


def sent(deposit: Deposit) -> Deposit:
    received = pickle.loads(pickle.dumps(deposit))
    assert isinstance(received, Deposit)
    return received


def load_of(deposit: Deposit, medium: AnyMedium) -> tuple[Deposit, object]:
    coefficients = coefficients_on(CUBE, {0: medium})
    found = deposit.on(CUBE, CUBE.surface, coefficients)
    return found, load_vector(CUBE, coefficients, found)


def check_same(deposit: Deposit, medium: AnyMedium) -> None:
    here, load = load_of(deposit, medium)
    there, other_load = load_of(sent(deposit), medium)
    assert np.abs(np.asarray(load)).max() > 0
    np.testing.assert_array_equal(load, other_load)
    for share in ("incident", "specular", "absorbed", "ballistic"):
        assert getattr(here, share) == getattr(there, share)


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
    assert (received.breadth, received.beams_as_points) == (deposit.breadth, deposit.beams_as_points)


def test_a_sum_of_deposits_is_pickled_too() -> None:
    body = Body(CUBE.surface, (TISSUE,))
    check_same(together([light.deposit_in(body) for light in LIGHTS.values()]), TISSUE)
