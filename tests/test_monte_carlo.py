"""Radiative transfer by Monte Carlo, held against closed forms, published figures and another Monte Carlo."""

import dataclasses
import math
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
import pytest

from tetlux.fem import Medium
from tetlux.fem.exact import monte_carlo
from tetlux.fem.exact.monte_carlo import Ledger, SampleMean
from tetlux.fem.exact.transfer import photons
from tetlux.fem.media.fresnel import reflectance
from tetlux.meshing.errors import InputError

# A seed fixes the result; four standard errors leave room for another numpy or another processor.
SIGMAS = 4.0

VAN_DE_HULST = Medium(sigma_a=0.1, sigma_s=0.9, g=0.75, eta=1.0)
TISSUE = Medium(sigma_a=0.01, sigma_s=5.0, g=0.8, eta=1.4)


@dataclass(frozen=True)
class Scene:
    """Another Monte Carlo's figures: for each bin its start in degrees, exitance and standard error."""

    medium: Medium
    radius: float
    light: monte_carlo.LightKind
    photons: int
    bins: tuple[tuple[int, float, float], ...]
    specular: float
    absorbed: float
    ballistic: float
    exited: float


SCENES = {
    "uniform thick": Scene(
        Medium(sigma_a=0.01, sigma_s=0.99, g=0.0, eta=1.3),
        5.0,
        "beam",
        6_400_000,
        (
            (0, 5.02604e-01, 1.5e-03),
            (10, 4.90605e-01, 8.7e-04),
            (30, 4.47993e-01, 5.4e-04),
            (60, 3.13229e-01, 3.6e-04),
            (80, 1.85900e-01, 2.6e-04),
            (110, 8.31021e-02, 1.8e-04),
            (170, 4.27361e-02, 4.2e-04),
        ),
        specular=0.061106,
        absorbed=0.100184,
        ballistic=0.000295,
        exited=0.838414,
    ),
    "pencil tissue": Scene(
        TISSUE,
        10.0,
        "pencil",
        3_200_000,
        (
            (0, 2.39574e-02, 2.4e-05),
            (10, 6.67249e-03, 7.2e-06),
            (30, 1.17241e-03, 2.0e-06),
            (60, 2.17358e-04, 6.5e-07),
            (80, 1.01522e-04, 4.0e-07),
            (110, 4.47826e-05, 2.6e-07),
            (170, 2.40790e-05, 5.7e-07),
        ),
        specular=0.027709,
        absorbed=0.207482,
        ballistic=0.000000,
        exited=0.764808,
    ),
    "uniform thin": Scene(
        Medium(sigma_a=0.01, sigma_s=0.99, g=0.0, eta=1.0),
        1.0,
        "beam",
        6_400_000,
        (
            (0, 2.30179e-01, 1.1e-03),
            (10, 2.27503e-01, 6.2e-04),
            (30, 2.23392e-01, 4.0e-04),
            (60, 2.07484e-01, 3.1e-04),
            (80, 1.86440e-01, 2.8e-04),
            (110, 1.40911e-01, 2.6e-04),
            (170, 9.96904e-02, 7.1e-04),
        ),
        specular=0.000000,
        absorbed=0.013205,
        ballistic=0.297092,
        exited=0.689703,
    ),
    "uniform absorbing": Scene(
        Medium(sigma_a=0.5, sigma_s=0.5, g=0.0, eta=1.0),
        5.0,
        "beam",
        6_400_000,
        (
            (0, 1.15740e-01, 4.9e-04),
            (10, 1.14133e-01, 2.8e-04),
            (30, 1.07611e-01, 1.8e-04),
            (60, 8.37695e-02, 1.3e-04),
            (80, 4.99436e-02, 9.5e-05),
            (110, 3.73174e-03, 2.5e-05),
            (170, 1.81942e-04, 1.5e-05),
        ),
        specular=0.000000,
        absorbed=0.794785,
        ballistic=0.019964,
        exited=0.185250,
    ),
}


def agree(found: SampleMean, expected: float, error: float = 0.0) -> bool:
    return abs(found.value - expected) <= SIGMAS * math.hypot(found.standard_error, error)


def closes(ledger: Ledger) -> bool:
    parts = (ledger.specular, ledger.absorbed, ledger.exited, ledger.ballistic)
    return abs(sum(part.value for part in parts) - 1.0) < 1e-12


# The parts come first: with a wrong one the runs below may not end.


@pytest.mark.parametrize("g", [-0.6, 0.0, 0.8])
def test_scattering_has_the_mean_cosine_it_should(g: float) -> None:
    """And the second Legendre moment of Henyey and Greenstein, g²; measured after the turn."""
    rng = np.random.default_rng(11)
    start = (0.6, -0.64, 0.48)
    cosines = np.empty(20_000)
    for i in range(len(cosines)):
        cosine = photons.sample_henyey_greenstein(rng, g)
        way = photons.rotate(start, cosine, 2.0 * math.pi * rng.random())
        assert math.hypot(*way) == pytest.approx(1.0, abs=1e-12)
        cosines[i] = np.dot(start, way)
    for moment, expected in ((cosines, g), (1.5 * cosines**2 - 0.5, g**2)):
        assert abs(moment.mean() - expected) < SIGMAS * moment.std() / math.sqrt(len(moment))


def test_roulette_is_fair() -> None:
    rng = np.random.default_rng(12)
    after = np.array([photons.roulette(rng, 0.004) for _ in range(20_000)])
    assert set(after) == {0.0, 0.04}
    assert abs(after.mean() - 0.004) < SIGMAS * after.std() / math.sqrt(len(after))
    assert photons.roulette(rng, 0.3) == 0.3


@pytest.mark.parametrize("pole", [1.0, -1.0])
def test_a_turn_at_the_pole(pole: float) -> None:
    way = photons.rotate((0.0, 0.0, pole), 0.3, 1.0)
    assert way[2] == pytest.approx(0.3 * pole)
    assert math.hypot(*way) == pytest.approx(1.0)


@pytest.mark.parametrize("eta", [1.0, 1.4, 1.0 / 1.4])
def test_one_reflectance_for_all(eta: float) -> None:
    cosines = np.linspace(0.0, 1.0, 41)
    found = [photons.fresnel(float(mu), eta) for mu in cosines]
    np.testing.assert_allclose(found, reflectance(cosines, eta), atol=1e-14)


@pytest.mark.parametrize("name", SCENES)
def test_two_monte_carlos_agree(name: str) -> None:
    scene = SCENES[name]
    run = monte_carlo.sphere(scene.medium, radius=scene.radius, light=scene.light, photons=300_000, seed=1)
    assert closes(run)
    squares = []
    for start, exitance, error in scene.bins:
        index = start // 10
        found = SampleMean(run.exitance[index], run.standard_error[index])
        assert agree(found, exitance, error), (start, found, exitance, error)
        squares.append((found.value - exitance) ** 2 / (found.standard_error**2 + error**2))
    # A common factor in all bins would hide below four standard errors of each.
    assert np.mean(squares) < 2.5
    for part in ("specular", "absorbed", "ballistic", "exited"):
        expected = getattr(scene, part)
        # The other one counted whole packets, so its error is at most that of a count.
        counted = math.sqrt(expected * (1.0 - expected) / scene.photons)
        assert agree(getattr(run, part), expected, counted), part
    area = 2.0 * np.pi * scene.radius**2 * -np.diff(np.cos(run.edges))
    incident = np.pi * scene.radius**2 if scene.light == "beam" else 1.0
    assert area @ run.exitance == pytest.approx(incident * run.exited.value, rel=1e-12)


def test_the_slab_of_van_de_hulst() -> None:
    """Optical thickness 2, albedo 0.9 (van de Hulst 1980); his transmittance is the total one."""
    run = monte_carlo.slab(VAN_DE_HULST, thickness=2.0, light="beam", photons=1_000_000, seed=2)
    assert closes(run)
    assert agree(run.reflectance, 0.09739)
    assert agree(run.ballistic, math.exp(-2.0))
    total = run.transmittance.value + run.ballistic.value
    assert total == pytest.approx(0.66096, abs=SIGMAS * run.transmittance.standard_error)
    np.testing.assert_allclose([run.front[0], run.back[0]], [run.reflectance.value, run.transmittance.value])


@pytest.mark.parametrize(
    ("albedo", "expected"), [(0.5, 0.11523), (0.8, 0.28525), (0.9, 0.41495), (0.95, 0.53554), (0.99, 0.75272)]
)
def test_a_half_space_is_a_thick_slab(albedo: float, expected: float) -> None:
    """Isotropic scattering, matched indices, a wide beam at right angles."""
    medium = Medium(sigma_a=1.0 - albedo, sigma_s_prime=albedo, eta=1.0)
    run = monte_carlo.slab(medium, thickness=60.0, light="beam", photons=100_000, seed=3)
    # The figure has a standard error of its own, below 0.0002.
    assert agree(run.reflectance, expected, 0.0002)
    assert run.transmittance.value < 1e-4


@pytest.mark.parametrize("eta", [1.4, 0.8])
def test_a_clear_slab_is_two_mirrors(eta: float) -> None:
    """Light that is not scattered goes back and forth: a geometric series, the front's share left out."""
    medium = Medium(sigma_a=0.5, sigma_s=0.0, g=0.0, eta=eta)
    run = monte_carlo.slab(medium, thickness=1.0, light="pencil", photons=500_000, seed=4)
    mirror, fade = ((eta - 1.0) / (eta + 1.0)) ** 2, math.exp(-0.5)
    assert run.specular.value == pytest.approx(mirror, rel=1e-12)
    assert agree(run.ballistic, (1.0 - mirror) ** 2 * fade / (1.0 - mirror * fade))
    assert run.exited.value == 0.0
    assert closes(run)


@pytest.mark.parametrize("eta", [1.4, 0.8])
def test_a_clear_ball_in_a_beam(eta: float) -> None:
    """Every chord of one ray meets the surface at one angle, so each ray is a geometric series."""
    medium = Medium(sigma_a=0.5, sigma_s=0.0, g=0.0, eta=eta)
    run = monte_carlo.sphere(medium, radius=1.0, light="beam", photons=500_000, seed=5)
    # Rays by the square of their distance from the axis, to total reflection or to the rim.
    nodes, weights = np.polynomial.legendre.leggauss(200)
    rim = min(1.0, eta**2)
    t = 0.5 * (nodes + 1.0)
    height_squared, weight = rim * (1.0 - t**2), weights * rim * t
    mirror = reflectance(np.sqrt(1.0 - height_squared), 1.0 / eta)
    fade = np.exp(-0.5 * 2.0 * np.sqrt(1.0 - height_squared / eta**2))
    assert agree(run.specular, float(weight @ mirror) + 1.0 - rim)
    assert agree(run.ballistic, float(weight @ ((1.0 - mirror) ** 2 * fade / (1.0 - mirror * fade))))
    assert closes(run)


def test_a_point_seen_through_an_absorber() -> None:
    """Rays from the point that are not scattered: ``M = e^{-sigma d} cos/(4 pi d²)``, mean over each bin."""
    medium = Medium(sigma_a=0.3, sigma_s=0.0, g=0.0, eta=1.0)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    ball = monte_carlo.sphere(medium, radius=2.0, light="point", depth=0.8, photons=500_000, seed=6)
    # Photons that are not scattered are counted with what exits, for a point has no ballistic light.
    assert ball.ballistic.value == 0.0
    height = np.cos(ball.edges)
    z = 2.0 * (height[:-1, None] + np.diff(height)[:, None] * nodes)
    rho_squared = 4.0 - z**2
    distance = np.sqrt(rho_squared + (z - 1.2) ** 2)
    along_normal = (rho_squared + z * (z - 1.2)) / 2.0
    exact = np.exp(-0.3 * distance) * along_normal / (4.0 * np.pi * distance**3) @ weights
    assert np.all(np.abs(ball.exitance - exact) < SIGMAS * ball.standard_error)

    edges = [0.0, 0.5, 1.0, 2.0, 4.0]
    slab = monte_carlo.slab(medium, thickness=3.0, light="point", depth=0.8, edges=edges, photons=500_000, seed=7)
    squared = np.square(edges)
    rho_squared = squared[:-1, None] + np.diff(squared)[:, None] * nodes
    for z0, found, error in ((0.8, slab.front, slab.front_error), (2.2, slab.back, slab.back_error)):
        distance = np.sqrt(rho_squared + z0**2)
        exact = np.exp(-0.3 * distance) * z0 / (4.0 * np.pi * distance**3) @ weights
        assert np.all(np.abs(found - exact) < SIGMAS * error)
    assert closes(slab)


def test_a_pencil_gives_back_what_a_wide_beam_does() -> None:
    pencil = monte_carlo.slab(TISSUE, thickness=5.0, light="pencil", photons=20_000, seed=8)
    beam = monte_carlo.slab(TISSUE, thickness=5.0, light="beam", photons=20_000, seed=9)
    assert agree(pencil.reflectance, *beam.reflectance)
    assert agree(pencil.transmittance, *beam.transmittance)
    area = np.pi * np.diff(pencil.edges**2)
    assert 0.8 * pencil.reflectance.value < area @ pencil.front < pencil.reflectance.value
    np.testing.assert_allclose(pencil.edges, np.arange(11) / 1.01)


def test_a_lossless_ball_loses_nothing() -> None:
    medium = Medium(sigma_a=0.0, sigma_s=4.0, g=0.5, eta=1.4)
    run = monte_carlo.sphere(medium, radius=1.0, light="point", depth=1.0, photons=50_000, seed=10)
    assert run.absorbed.value == 0.0
    assert run.exited.value == pytest.approx(1.0, abs=1e-12)
    # The point is the centre.
    assert np.all(np.abs(run.exitance - 1.0 / (4.0 * np.pi)) < SIGMAS * run.standard_error)


def test_a_seed_is_a_result(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(seed: int) -> np.ndarray[Any, Any]:
        return monte_carlo.sphere(TISSUE, radius=2.0, light="pencil", photons=2000, seed=seed).exitance

    first = run(5)
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    np.testing.assert_array_equal(run(5), first)
    assert np.any(run(6) != first)


def test_standard_errors_are_right() -> None:
    """They are the scatter of runs with other seeds, and four times fewer at sixteen times the photons."""

    def run(photons: int, seed: int) -> monte_carlo.SlabResult:
        return monte_carlo.slab(VAN_DE_HULST, thickness=2.0, light="beam", photons=photons, seed=seed)

    few, many = run(20_000, 100), run(320_000, 100)
    for part in ("reflectance", "transmittance", "absorbed", "ballistic"):
        ratio = getattr(few, part).standard_error / getattr(many, part).standard_error
        # Each is known to 6 %.
        assert ratio == pytest.approx(4.0, rel=0.25)
    runs = [run(5_000, seed) for seed in range(200)]
    for part in ("reflectance", "transmittance", "absorbed"):
        values, errors = np.transpose([getattr(one, part) for one in runs])
        # The scatter of 200 values is known to 5 %.
        assert values.std(ddof=1) / np.sqrt(np.mean(errors**2)) == pytest.approx(1.0, abs=0.2)


def test_photons_are_rounded_up() -> None:
    run = monte_carlo.slab(VAN_DE_HULST, thickness=2.0, light="beam", photons=1000)
    assert run.photons == 8 * monte_carlo.BATCHES
    assert {field.name for field in dataclasses.fields(Ledger)} <= set(vars(run))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: monte_carlo.sphere(TISSUE, radius=0.0, light="pencil"), "radius is 0"),
        (lambda: monte_carlo.sphere(TISSUE, radius=1.0, light="lamp"), 'light is "lamp"'),  # type: ignore[arg-type]
        (lambda: monte_carlo.sphere(TISSUE, radius=1.0, light="point"), "a point needs its depth"),
        (lambda: monte_carlo.sphere(TISSUE, radius=1.0, light="beam", depth=0.5), "a beam has none"),
        (lambda: monte_carlo.sphere(TISSUE, radius=1.0, light="point", depth=2.0), "depth is 2"),
        (lambda: monte_carlo.sphere(TISSUE, radius=1.0, light="pencil", edges=[0.0, 4.0]), "edges holds 4"),
        (lambda: monte_carlo.sphere(TISSUE, radius=1.0, light="pencil", edges=[1.0, 0.5]), "edges do not ascend"),
        (lambda: monte_carlo.sphere(TISSUE, radius=1.0, light="pencil", photons=0), "photons is 0"),
        (lambda: monte_carlo.slab(TISSUE, thickness=1.0, light="beam", edges=[0.0, 1.0]), "edges are given"),
        (lambda: monte_carlo.slab(TISSUE, thickness=-1.0, light="beam"), "thickness is -1"),
    ],
)
def test_what_makes_no_sense_is_refused(call: Callable[[], Ledger], message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


def test_without_numba_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    with pytest.raises(InputError, match=r"pip install \"tetlux\[montecarlo\]\""):
        monte_carlo.slab(TISSUE, thickness=1.0, light="beam")


def test_no_folder_for_the_machine_code_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    njit = numba.njit

    def refuse(**options: Any) -> Any:
        def decorate(function: Callable[..., Any]) -> Any:
            if options.pop("cache", False):
                raise RuntimeError("cannot cache function: no locator available")
            return njit(**options)(function)

        return decorate

    monkeypatch.setattr(numba, "njit", refuse)
    assert photons.compile_function(lambda: 3)() == 3
