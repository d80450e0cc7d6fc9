"""The planner: which model it chooses and why, and closed forms as solutions."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from tetlux.fem import (
    ChargeSolution,
    ClosedFormSolution,
    CollimatedBeam,
    DiffuseLight,
    Emission,
    Light,
    Medium,
    PencilBeam,
    Plan,
    PointDetector,
    PointSource,
    Region,
    Solution,
    plan,
    solve,
)
from tetlux.fem.exact import box as exact_box
from tetlux.fem.exact import slab as exact_slab
from tetlux.fem.exact import sphere as exact_sphere
from tetlux.fem.exact import sphere_light
from tetlux.fem.planner import charges as charges_of_planner
from tetlux.meshing import Surface, box, slab, sphere, tetrahedralize, torus
from tetlux.meshing.errors import InputError

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
BALL, PLATE = sphere(10.0), slab(60.0, 10.0)
BEAM = PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0), power=2.0)


def test_a_ball_is_its_series() -> None:
    solution = solve(BALL, TISSUE, [PointSource((0.0, 0.0, 9.0), power=2.0)], model="auto")
    assert isinstance(solution, ClosedFormSolution)
    assert solution.plan is not None
    assert solution.model == solution.plan.chosen == "closed-form"
    assert solution.mesh is None
    angles = np.array([0.0, 0.3, 2.0, 3.1])
    places = 10.0 * np.column_stack([np.sin(angles), 0.0 * angles, np.cos(angles)])
    exact = 2.0 * exact_sphere.point_exitance(TISSUE, radius=10.0, source_radius=9.0, gamma=angles)
    np.testing.assert_allclose(solution.exitance_at(places), exact, rtol=1e-9)
    inside = np.array([[0.0, 3.0, -4.0], [0.0, 0.0, 0.0], [0.0, 0.0, 11.0]])
    fluence = 2.0 * exact_sphere.point_fluence(TISSUE, radius=10.0, source_radius=9.0, points=inside[:2])
    np.testing.assert_allclose(solution.fluence_at(inside), [*fluence, math.nan], rtol=1e-9)
    exited = 2.0 * exact_sphere.point_total(TISSUE, radius=10.0, source_radius=9.0)
    assert solution.power.exited == pytest.approx(exited, rel=1e-12)
    assert solution.power.absorbed == pytest.approx(2.0 - exited, rel=1e-12)


def test_the_fluence_meets_the_boundary_condition_of_the_exitance() -> None:
    """``M = phi/(2A)`` for points, on bodies whose triangles lie beside the surface."""
    for surface in (sphere(10.0, center=(1.0, 2.0, 3.0)), PLATE):
        place = np.array([[1.0, 2.0, 13.0]]) if surface is not PLATE else np.array([[1.0, 2.0, 0.0]])
        source = PointSource((1.0, 1.0, 9.0)) if surface is not PLATE else PointSource((1.0, 1.0, -2.0))
        solution = solve(surface, TISSUE, [source], model="closed-form")
        expected = solution.fluence_at(place) / (2.0 * TISSUE.boundary_factor)
        np.testing.assert_allclose(solution.exitance_at(place), expected, rtol=1e-8)


def test_a_wide_slab_is_the_series_of_an_endless_one() -> None:
    solution = solve(PLATE, TISSUE, [BEAM], model="auto")
    assert isinstance(solution, ClosedFormSolution)
    depth = float(-solution.deposits[0].terms.points[0, 2])
    power = float(solution.deposits[0].terms.powers[0])
    rho = np.array([0.0, 5.0, 12.0])
    front = np.column_stack([rho, 0.0 * rho, 0.0 * rho])
    for face, z in (("front", 0.0), ("back", -10.0)):
        exact = power * exact_slab.point_exitance(TISSUE, thickness=10.0, depth=depth, rho=rho, face=face)  # type: ignore[arg-type]
        np.testing.assert_allclose(solution.exitance_at(front + np.array([0.0, 0.0, z])), exact, rtol=1e-6)
    assert solution.power.balance_error == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("width", [20.0, 40.0, 60.0])
def test_the_error_of_a_finite_slab_is_bounded(width: float) -> None:
    """The bound holds against the series of the finite slab, on its faces and its rim."""
    source = (3.0, 0.0, -1.0)
    solution = solve(slab(width, 10.0), TISSUE, [PointSource(source)], tolerance=0.9, model="closed-form")
    rng = np.random.default_rng(1)
    places = np.vstack([rng.uniform(-0.5 * width, 0.5 * width, (40, 3)), np.full((20, 3), 0.5 * width)])
    places[:40, 2] = rng.choice([0.0, -10.0], 40)
    places[40:, 1:] = np.column_stack([rng.uniform(-3.0, 3.0, 20), rng.uniform(-10.0, 0.0, 20)])
    exact = exact_box.point_exitance(
        TISSUE, size=(width, width, 10.0), source=(3.0, 0.0, 4.0), points=places + np.array([0.0, 0.0, 5.0])
    )
    errors = np.abs(solution.exitance_at(places) - exact)
    assert 0.02 * solution.exact.bound < errors.max() < solution.exact.bound


def test_lights_of_a_closed_form_add_up() -> None:
    lights: list[Light] = [PointSource((0.0, 0.0, 9.0)), DiffuseLight(irradiance=0.1)]
    solution = solve(BALL, TISSUE, lights, model="closed-form")
    first, second = solution.of_lights
    place = np.array([[0.0, 10.0, 0.0]])
    np.testing.assert_allclose(first.exitance_at(place) + second.exitance_at(place), solution.exitance_at(place))
    transmitted = float(second.deposits[0].terms.transmitted_irradiance)
    expected = transmitted * sphere_light.diffuse_exitance(TISSUE, radius=10.0)
    np.testing.assert_allclose(second.exitance_at(place), expected, rtol=1e-12)
    assert solution.power.incident == pytest.approx(1.0 + 0.1 * 400.0 * math.pi)
    assert solution.power.balance_error == pytest.approx(0.0, abs=1e-12)


def test_channels_are_solved_one_by_one() -> None:
    dark = Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4)
    bright, dim = solve(BALL, [TISSUE, dark], [BEAM], model="auto")
    assert bright.model == dim.model == "closed-form"
    assert bright.power.exited > 1.5 * dim.power.exited


DISC = Region(sphere(3.0), Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4))
SOURCE = PointSource((0.0, 0.0, -1.0))


@pytest.mark.parametrize(
    ("surface", "lights", "options", "chosen", "reason"),
    [
        (BALL, [BEAM], {}, "closed-form", "exact series of a ball"),
        (PLATE, [SOURCE], {}, "closed-form", "series of an endless slab"),
        # The bound of this slab is .040 %.
        (PLATE, [BEAM], {"tolerance": 4.1e-4}, "closed-form", "series of an endless slab"),
        (PLATE, [BEAM], {"tolerance": 3.9e-4}, "charges", "ends too near the light"),
        (slab(15.0, 10.0), [SOURCE], {}, "charges", "ends too near the light"),
        (PLATE, [SOURCE], {"everywhere_tolerance": 0.05}, "full", "does not hold where it is dark"),
        (BALL, [SOURCE], {"everywhere_tolerance": 0.05}, "closed-form", "exact series of a ball"),
        (box((20.0, 20.0, 20.0)), [SOURCE], {}, "charges", "no ball and no slab"),
        # Charges would have to be closer together than the light fades in.
        (box((20.0, 20.0, 20.0)), [DiffuseLight(1.0)], {"tolerance": 0.02}, "charges", "no ball and no slab"),
        (box((20.0, 20.0, 20.0)), [DiffuseLight(1.0)], {"tolerance": 0.001}, "full", "no ball and no slab"),
        (BALL, [BEAM], {"regions": [DISC]}, "charges", "one homogeneous medium"),
        (BALL, [CollimatedBeam((0.0, 0.0, -1.0), 1.0)], {}, "full", "no closed form for beams along lines"),
        (BALL, [Emission(0.1)], {}, "full", "no closed form of the fluence of a ball that emits"),
    ],
)
def test_the_simplest_model_that_suits_is_chosen(
    surface: Surface, lights: Sequence[Light], options: dict[str, Any], chosen: str, reason: str
) -> None:
    found = plan(surface, TISSUE, lights, **options)
    assert found.chosen == chosen
    assert reason in found["closed-form"].reason
    assert found.best.suits
    assert found.best.seconds == min(each.seconds for each in found.candidates if each.suits)


def test_a_detector_near_the_rim_needs_more_than_the_endless_slab() -> None:
    def chosen(x: float) -> str:
        detectors = [PointDetector((x, 0.0, 0.0))]
        return plan(PLATE, TISSUE, [BEAM], tolerance=None, detectors=detectors, detector_tolerance=0.01).chosen

    assert [chosen(3.0), chosen(28.0)] == ["closed-form", "charges"]


def test_a_detector_of_a_closed_form_has_an_error_bar() -> None:
    (reading,) = solve(BALL, TISSUE, [BEAM], detectors=[PointDetector((0.0, 0.0, 10.0))], model="auto").readings
    assert reading.relative_error is not None
    assert 0.0 < reading.relative_error < 1e-9


def test_a_given_mesh_is_solved_on() -> None:
    found = plan(BALL, TISSUE, [BEAM], mesh=tetrahedralize(BALL, edge_length=4.0))
    assert found.chosen == "full"
    assert found["closed-form"].reason == found["charges"].reason == "a mesh is given"


def test_a_plan_has_at_most_six_lines_with_figures_and_reasons() -> None:
    text = str(plan(PLATE, TISSUE, [BEAM], tolerance=0.02))
    lines = text.splitlines()
    assert len(lines) <= 6
    assert max(map(len, lines)) <= 120
    assert lines[0] == "plan: closed-form for a tolerance of 0.02"
    assert "error 0.0" in lines[1]
    assert "diffusion itself is off by about 30 % a mean free path from the light" in lines[-1]


def test_a_plan_is_silent_on_diffusion_where_it_is_good_enough() -> None:
    white = Medium(sigma_a=0.001, sigma_s_prime=1.0, eta=1.0)
    found = plan(sphere(60.0), white, [DiffuseLight(1.0)], tolerance=0.05)
    assert found.near_error == 0.0
    assert found.model_error < 0.05
    assert "diffusion itself" not in str(found)
    grey = Medium(sigma_a=0.4, sigma_s_prime=0.6, eta=1.4)
    assert "diffusion itself is off by 22 %" in str(plan(sphere(60.0), grey, [DiffuseLight(1.0)], tolerance=0.05))


def test_charges_are_kept_where_they_are_good_enough() -> None:
    solution = solve(box((20.0, 20.0, 20.0)), TISSUE, [PointSource((0.0, 0.0, 7.0))], tolerance=0.02, model="auto")
    assert isinstance(solution, ChargeSolution)
    assert solution.plan is not None
    assert solution.plan.chosen == solution.model == "charges"
    assert solution.error_estimate <= 0.02


def test_charges_that_miss_the_tolerance_are_dropped_and_the_plan_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(charges_of_planner, "ERROR_OF_SHAPE", 1e-9)
    monkeypatch.setattr(charges_of_planner, "MOST_CHARGES", 100)
    said: list[str] = []
    body, light = torus(10.0, 4.0), PencilBeam((10.0, 0.0, 20.0), (0.0, 0.0, -1.0))
    solution = solve(body, TISSUE, [light], tolerance=0.002, model="auto", report=said.append)
    assert isinstance(solution, Solution)
    assert isinstance(solution.plan, Plan)
    assert solution.plan.chosen == solution.model == "full"
    assert not solution.plan["charges"].suits
    assert solution.plan["charges"].reason.startswith("tried in ")
    assert "estimated error" in solution.plan["charges"].reason
    assert said[0].startswith("plan: charges")
    assert any(line.startswith("tried in ") and line.endswith("going on with full") for line in said)
    assert solution.error_estimate <= 0.002


@pytest.mark.parametrize(
    ("surface", "lights", "options", "sentence"),
    [
        (
            box((20.0, 20.0, 20.0)),
            [SOURCE],
            {},
            'the body is no ball and no slab, of which closed forms are known; give model="auto" or "full".',
        ),
        (
            BALL,
            [SOURCE],
            {"regions": [DISC]},
            'closed forms are those of one homogeneous medium; give model="auto" or "full".',
        ),
        (
            BALL,
            [SOURCE],
            {"limit": False},
            'model "closed-form" does not take limit; leave out what it does not take, or give model="full".',
        ),
        (BALL, [], {}, "there is no light; give at least one."),
        (BALL, [SOURCE], {"tolerance": 2.0}, None),
    ],
)
def test_what_has_no_closed_form_is_refused_in_a_sentence(
    surface: Surface, lights: Sequence[Light], options: dict[str, Any], sentence: str | None
) -> None:
    with pytest.raises(InputError) as caught:
        solve(surface, TISSUE, lights, model="closed-form", **options)
    assert sentence is None or str(caught.value) == sentence


def test_an_unknown_model_is_refused() -> None:
    with pytest.raises(InputError, match='give one of "full", "auto", "closed-form", "charges", "truncated"'):
        solve(BALL, TISSUE, [BEAM], model="fem")  # type: ignore[call-overload]


def test_a_slab_that_ends_too_near_says_so() -> None:
    solution = solve(slab(15.0, 10.0), TISSUE, [SOURCE], model="closed-form")
    assert any("the tolerance of 0.02 may be missed" in warning for warning in solution.warnings)
