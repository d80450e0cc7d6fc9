"""Phase functions: moments, normalisation, and what a medium makes of them."""

import math
import pickle

import numpy as np
import pytest

from tetlux.fem import Medium
from tetlux.fem.media.phase import PhaseFunction, henyey_greenstein, table, two_term
from tetlux.meshing import InputError

DEGREES = np.linspace(0.0, 180.0, 361)
RAYLEIGH = 3.0 / (16.0 * np.pi) * (1.0 + np.cos(np.radians(DEGREES)) ** 2)


def moments(phase: PhaseFunction) -> tuple[float, float, float]:
    """The first three Legendre moments, by the midpoint rule in the angle."""
    angle = (np.arange(400_000) + 0.5) * np.pi / 400_000
    mu = np.cos(angle)
    weight = 2.0 * np.pi * np.sin(angle) * phase(mu) * np.pi / len(angle)
    return float(weight.sum()), float(weight @ mu), float(weight @ (1.5 * mu**2 - 0.5))


@pytest.mark.parametrize(
    ("phase", "g", "second"),
    [
        (henyey_greenstein(0.0), 0.0, 0.0),
        (henyey_greenstein(0.9), 0.9, 0.81),
        (henyey_greenstein(-0.4), -0.4, 0.16),
        (two_term(0.9, -0.5, 0.8), 0.62, 0.698),
        (table([0, 180], [0.25 / math.pi] * 2), 0.0, 0.0),
        # Linear in the angle: 2 pi ∫ (1 - theta/pi)/(2 pi) sin cos = 1/4.
        (table([0, 180], [0.5 / math.pi, 0.0]), 0.25, 0.0),
    ],
)
def test_moments_agree_with_plain_summation(phase: PhaseFunction, g: float, second: float) -> None:
    assert (phase.mean_cosine, phase.second_moment) == pytest.approx((g, second), abs=1e-14)
    assert moments(phase) == pytest.approx((1.0, g, second), abs=1e-8)


def test_tables_of_known_functions() -> None:
    rayleigh = table(DEGREES, RAYLEIGH)
    assert (rayleigh.mean_cosine, rayleigh.second_moment) == pytest.approx((0.0, 0.1), abs=1e-5)
    assert rayleigh([1.0, 0.0, -1.0]) == pytest.approx(np.array([2, 1, 2]) * 3 / (16 * np.pi), rel=1e-4)
    lobe = henyey_greenstein(0.8)
    copy = table(DEGREES, lobe(np.cos(np.radians(DEGREES))))
    assert (copy.mean_cosine, copy.second_moment) == pytest.approx((0.8, 0.64), abs=1e-4)


def test_a_table_is_normalised() -> None:
    plain, brighter = table(DEGREES, RAYLEIGH), table(DEGREES, 1.019 * RAYLEIGH)
    assert brighter.mean_cosine == pytest.approx(plain.mean_cosine, abs=1e-15)
    assert brighter(0.3) == pytest.approx(plain(0.3), rel=1e-12)


@pytest.mark.parametrize(
    ("angles", "values", "message"),
    [
        (
            DEGREES,
            1.021 * RAYLEIGH,
            r"integrates to 1\.021 over all directions, not to 1; multiply .* by 0\.9794",
        ),
        (DEGREES, 0.979 * RAYLEIGH, r"integrates to 0\.979"),
        ([0, 180], [0, 0], "is 0 at all angles"),
        ([0, 90], [1, 1], "ascend from 0 to 180"),
        ([10, 180], [1, 1], "ascend from 0 to 180"),
        ([0, 90, 90, 180], [1, 1, 1, 1], "ascend from 0 to 180"),
        ([0, math.nan, 180], [1, 1, 1], "ascend from 0 to 180"),
        ([0, 90, 180], [1, -1, 1], "is -1 at 90 degrees"),
        ([0, 90, 180], [1, 1, math.nan], "is nan at 180 degrees"),
        ([0, 90, 180], [1, 1], "as many values as angles, at least two: it has 2 and 3"),
        ([0], [1], "at least two"),
    ],
)
def test_tables_that_cannot_be(angles: list[float], values: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        table(angles, values)


def test_lobes_that_cannot_be() -> None:
    with pytest.raises(InputError, match="g is 1; a mean cosine is"):
        henyey_greenstein(1.0)
    with pytest.raises(InputError, match="g2 is -1"):
        two_term(0.9, -1.0, 0.5)
    with pytest.raises(InputError, match=r"share is 1\.2; give the share"):
        two_term(0.9, -0.3, 1.2)


def medium(phase: PhaseFunction) -> Medium:
    return Medium(sigma_a=0.02, sigma_s=10.0, phase=phase, eta=1.4)


def test_a_medium_takes_a_phase_function_for_g() -> None:
    plain = Medium(sigma_a=0.02, sigma_s=10.0, g=0.9, eta=1.4)
    same = medium(henyey_greenstein(0.9))
    assert same.mean_cosine == plain.mean_cosine == 0.9
    assert same.reduced_scattering == plain.reduced_scattering
    assert same.delta_eddington == pytest.approx(plain.delta_eddington, rel=1e-15)
    assert pickle.loads(pickle.dumps(same)) == same
    assert len({same, medium(henyey_greenstein(0.9)), medium(table(DEGREES, RAYLEIGH))}) == 2


def test_delta_eddington_takes_out_the_second_moment() -> None:
    """Joseph 1976: what is left has the first two moments of ``2 f delta(1 - mu) + (1 - f)(1 + 3 g* mu)``."""
    given = medium(two_term(0.9, -0.2, 0.9))
    scattering, cosine = given.delta_eddington
    f, g = 0.9 * 0.81 + 0.1 * 0.04, 0.9 * 0.9 - 0.1 * 0.2
    assert (scattering, cosine) == pytest.approx((10 * (1 - f), (g - f) / (1 - f)))
    assert scattering * (1 - cosine) == pytest.approx(given.reduced_scattering)
    # The second moment, 0.698, is more than g = 0.62: no more than g is taken out.
    assert medium(two_term(0.9, -0.5, 0.8)).delta_eddington == pytest.approx((3.8, 0.0), abs=1e-12)
    # No forward peak: Rayleigh's even lobes, backward scattering, and scattering to the sides.
    for phase in (table(DEGREES, RAYLEIGH), henyey_greenstein(-0.3), table([0, 90, 180], [0.0, 0.125, 0.0])):
        assert medium(phase).delta_eddington == pytest.approx((10.0, phase.mean_cosine), abs=1e-9)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"sigma_s": 1.0, "g": 0.0, "phase": henyey_greenstein(0.0)}, "g is given together with phase"),
        ({"sigma_s_prime": 1.0, "phase": henyey_greenstein(0.0)}, "phase is given together with sigma_s_prime"),
        ({"phase": henyey_greenstein(0.0)}, "scattering is missing"),
        ({"sigma_s": 1.0}, "g is missing; sigma_s needs it .*, or a phase function"),
    ],
)
def test_a_phase_function_goes_with_sigma_s_and_without_g(given: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Medium(sigma_a=0.1, eta=1.4, **given)  # type: ignore[arg-type]
