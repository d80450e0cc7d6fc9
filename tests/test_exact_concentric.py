"""A ball with a core of another medium: against one medium, by hand, and at its limits."""

import math

import pytest

from tests.conftest import TISSUE
from tests.test_media_on_meshes import CORES, GLOW, INNER, OUTER, SHELL, from_core
from tetlux.fem import Medium
from tetlux.fem.exact import concentric, sphere_light
from tetlux.meshing import InputError

CLEAR = Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.4)


def of(sigma_a: float, sigma_s_prime: float) -> Medium:
    return Medium(sigma_a=sigma_a, sigma_s_prime=sigma_s_prime, eta=1.4)


@pytest.mark.parametrize("core_radius", [0.01, 5.0, 9.99])
def test_a_core_of_the_same_medium_is_no_core(core_radius: float) -> None:
    alike = concentric.diffuse_exitance(TISSUE, TISSUE, core_radius=core_radius, radius=10.0)
    assert alike == pytest.approx(sphere_light.diffuse_exitance(TISSUE, radius=10.0), rel=1e-12)


@pytest.mark.parametrize("name", CORES)
def test_a_glowing_core_is_what_the_equations_give(name: str) -> None:
    core = of(*CORES[name])
    value = concentric.glow_exitance(core, SHELL, core_radius=INNER, radius=OUTER)
    # What is solved as three equations loses some digits in turbid media.
    assert value == pytest.approx(from_core(core, GLOW), rel=1e-9)


def test_no_power_is_lost_without_absorption() -> None:
    for turbidity in (1e-6, 1.0, 1e6):
        core = of(0.0, turbidity)
        left = 4.0 * math.pi * 100.0 * concentric.glow_exitance(core, CLEAR, core_radius=6.0, radius=10.0)
        assert left == pytest.approx(4.0 / 3.0 * math.pi * 216.0, rel=1e-12)
        assert concentric.diffuse_exitance(core, CLEAR, core_radius=6.0, radius=10.0) == pytest.approx(1.0, rel=1e-12)


def test_a_black_core_takes_what_diffusion_lets_it() -> None:
    """``D phi' = phi/sqrt(3)`` at its surface, and ``phi = 1 - c/r`` outside it."""
    a, b = 6.0, 10.0
    c = 1.0 / (math.sqrt(3.0) * CLEAR.diffusion / a**2 + 1.0 / a)
    slope = c / b**2 / (1.0 - c / b)
    # 4/(1 - 2 C1): the fluence in a ball that takes nothing.
    most = float(sphere_light.diffuse_fluence(CLEAR, radius=b, distance=b))
    expected = 1.0 - CLEAR.diffusion * slope * most / (1.0 + CLEAR.extrapolation_length * slope)
    black = concentric.diffuse_exitance(of(1e9, 0.0), CLEAR, core_radius=a, radius=b)
    assert black == pytest.approx(expected, rel=1e-8)


def test_a_core_outside_the_ball_is_refused() -> None:
    with pytest.raises(InputError, match="not inside the ball"):
        concentric.glow_exitance(TISSUE, TISSUE, core_radius=10.0, radius=10.0)


@pytest.mark.parametrize("sigma_a", [0.0, 1e-9, 1e-7, 0.01, 1.0, 50.0])
def test_a_ball_that_glows_throughout(sigma_a: float) -> None:
    """A core and a shell that both glow, of one medium; what leaves without absorption is what is emitted."""
    medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4)
    found = sphere_light.glow_exitance(medium, radius=5.0)
    if sigma_a == 0:
        assert found == pytest.approx(5.0 / 3.0, rel=1e-12)
        return
    nearly = concentric.glow_exitance(medium, medium, core_radius=5.0 * (1 - 1e-9), radius=5.0)
    assert found == pytest.approx(nearly, rel=1e-6)
