"""Reflection at the boundary, and the coefficients that follow from a medium's."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tetlux.fem import Medium
from tetlux.fem.media.fresnel import moments, reflectance
from tetlux.meshing import InputError


@pytest.mark.parametrize(
    ("eta", "exact", "classic"),
    [
        (1.0, 1.0, 1.00321),
        (1.3, 2.340532, 2.602064),
        (1.33, 2.515361, 2.790444),
        (1.4, 2.948493, 3.250697),
        (1.5, 3.627933, 3.959497),
    ],
)
def test_boundary_factors(eta: float, exact: float, classic: float) -> None:
    medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=eta)
    assert medium.boundary_factor == pytest.approx(exact, abs=1e-6)
    assert replace(medium, boundary="classic").boundary_factor == pytest.approx(classic, abs=1e-5)


def test_boundary_factor_below_one() -> None:
    assert Medium(sigma_a=0.1, sigma_s_prime=1, eta=0.75).boundary_factor == pytest.approx(1.113895, abs=1e-6)


def test_reflectance_at_its_known_angles() -> None:
    assert reflectance(1.0, 1.4) == pytest.approx((0.4 / 2.4) ** 2)
    assert reflectance(1.0, 1 / 1.4) == pytest.approx((0.4 / 2.4) ** 2)
    critical = math.sqrt(1 - 1 / 1.4**2)
    assert reflectance([0.0, 0.5 * critical, 0.999 * critical], 1.4).tolist() == [1.0, 1.0, 1.0]
    # At Brewster's angle only one polarisation is reflected.
    brewster = math.cos(math.atan(1 / 1.4))
    assert reflectance(brewster, 1.4) == pytest.approx(0.5 * ((1.4**2 - 1) / (1.4**2 + 1)) ** 2)
    assert reflectance([0.0, 0.3, 1.0], 1.0).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("eta", [0.6, 1.0, 1.1, 1.4, 3.0])
def test_moments_agree_with_plain_summation(eta: float) -> None:
    mu = (np.arange(400_000) + 0.5) / 400_000
    plain = reflectance(mu, eta)
    assert moments(eta) == pytest.approx(((plain * mu).mean(), (plain * mu**2).mean()), abs=1e-7)


def test_coefficients() -> None:
    medium = Medium(sigma_a=0.02, sigma_s=10.0, g=0.9, eta=1.4)
    assert medium.reduced_scattering == pytest.approx(1.0)
    assert medium.diffusion == pytest.approx(1 / 3.06)
    assert medium.sigma_tr == pytest.approx(math.sqrt(3 * 0.02 * 1.02))
    assert medium.albedo == pytest.approx(1 / 1.02)
    assert medium.extrapolation_length == pytest.approx(2 * 2.948493 / 3.06, rel=1e-6)


def test_delta_eddington_keeps_the_reduced_coefficient() -> None:
    scattering, cosine = Medium(sigma_a=0.02, sigma_s=10.0, g=0.9, eta=1.4).delta_eddington
    assert scattering == pytest.approx(10 * (1 - 0.81))
    assert scattering * (1 - cosine) == pytest.approx(1.0)
    assert Medium(sigma_a=0.02, sigma_s_prime=1.3, eta=1.4).delta_eddington == (1.3, 0.0)
    # Without a forward peak there is nothing to take out.
    assert Medium(sigma_a=0.02, sigma_s=2.0, g=-0.3, eta=1.4).delta_eddington == (2.0, -0.3)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"sigma_a": -0.1, "sigma_s_prime": 1.0, "eta": 1.4}, "sigma_a is -0.1"),
        ({"sigma_a": 0.1, "sigma_s_prime": -1.0, "eta": 1.4}, "sigma_s_prime is -1"),
        ({"sigma_a": math.nan, "sigma_s_prime": 1.0, "eta": 1.4}, "sigma_a is nan"),
        ({"sigma_a": 0.1, "sigma_s_prime": 1.0, "eta": 0.0}, "eta is 0; give a refractive index between 0.1 and 10"),
        ({"sigma_a": 0.1, "eta": 1.4}, "scattering is missing"),
        ({"sigma_a": 0.1, "sigma_s": 1.0, "eta": 1.4}, "g is missing"),
        ({"sigma_a": 0.1, "sigma_s": 1.0, "g": 1.0, "eta": 1.4}, "g is 1"),
        ({"sigma_a": 0.1, "sigma_s": 1.0, "g": -1.0, "eta": 1.4}, "g is -1"),
        ({"sigma_a": 0.1, "sigma_s": 1.0, "sigma_s_prime": 1.0, "eta": 1.4}, "sigma_s is given together"),
        ({"sigma_a": 0.1, "g": 0.5, "sigma_s_prime": 1.0, "eta": 1.4}, "g is given together"),
        ({"sigma_a": 0.0, "sigma_s_prime": 0.0, "eta": 1.4}, "neither scatters nor absorbs"),
        ({"sigma_a": 0.1, "sigma_s_prime": 1.0, "eta": 0.8, "boundary": "classic"}, "refractive indices of 1"),
        ({"sigma_a": 0.1, "sigma_s_prime": 1.0, "eta": 1.4, "boundary": "best"}, 'boundary is "best"'),
    ],
)
def test_media_that_cannot_be(given: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Medium(**given)  # type: ignore[arg-type]
