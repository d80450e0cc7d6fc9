"""``solve(..., model="charges", detector_tolerance=)``: far, dim readings are right to their tolerance and bars."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.benchmarks.reading_scenes import places_on_ball, random_scene
from tests.benchmarks.readings import TOLERANCE, measure
from tests.conftest import TISSUE
from tetlux.cases.file.load import load_cases
from tetlux.cases.shipped import library_folder
from tetlux.fem import ChargeSolution, DiffuseLight, Medium, PencilBeam, PointDetector, PointSource, solve
from tetlux.fem.exact import cylinder as exact_cylinder
from tetlux.fem.exact import sphere as exact
from tetlux.fem.meshless import solve_with_charges
from tetlux.fem.outcome.detectors import drop_perpendiculars
from tetlux.fem.sources.light import Light
from tetlux.meshing import InputError, Surface, cylinder, sphere, torus
from tetlux.meshing.arrays import FloatArray


def points(places: FloatArray) -> list[PointDetector]:
    return [PointDetector((x, y, z)) for x, y, z in places.tolist()]


def read_by_charges(
    surface: Surface, medium: Medium, lights: Sequence[Light], places: FloatArray, tolerance: float
) -> tuple[ChargeSolution, FloatArray, FloatArray]:
    """The solution, what is read, and the bars."""
    solution = solve(
        surface,
        medium,
        lights,
        model="charges",
        tolerance=None,
        detectors=points(places),
        detector_tolerance=tolerance,
    )
    read = np.array([reading.exitance for reading in solution.readings])
    return solution, read, np.array([reading.relative_error for reading in solution.readings], dtype=float)


def test_ten_fibres_on_a_ball_are_within_their_tolerance_and_bars() -> None:
    """The last of them reads 1e-11 of the light beside the beam."""
    medium = Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4)
    gamma, places = places_on_ball(80.0, np.arange(5.0, 51.0, 5.0))
    inside = 80.0 - medium.mean_free_path
    light = [PointSource((0.0, 0.0, inside))]
    truth = exact.point_exitance(medium, radius=80.0, source_radius=inside, gamma=gamma)
    solution, read, bars = read_by_charges(sphere(80.0), medium, light, places, 0.01)
    errors = np.abs(read / truth - 1.0)
    assert errors.max() < 0.003
    assert (errors <= 2.0 * bars).all()
    assert bars.max() < 0.01
    assert solution.charges < 400
    assert not solution.warnings


def test_a_fit_by_finite_differences_finds_the_coefficients() -> None:
    """Absorption and scattering, from a start a factor of two off."""
    radius, right = 20.0, np.array([0.012, 1.1])
    gamma, places = places_on_ball(radius, np.linspace(2.0, 20.0, 10))
    surface, beam = sphere(radius), PencilBeam((0.0, 0.0, 50.0), (0.0, 0.0, -1.0))
    medium = Medium(sigma_a=right[0], sigma_s_prime=right[1], eta=1.4)
    power = medium.albedo * (1.0 - (0.4 / 2.4) ** 2)
    depth = radius - medium.mean_free_path
    truth = power * exact.point_exitance(medium, radius=radius, source_radius=depth, gamma=gamma)

    def residuals(logarithms: FloatArray) -> FloatArray:
        sigma_a, sigma_s = np.exp(logarithms)
        own = Medium(sigma_a=sigma_a, sigma_s_prime=sigma_s, eta=1.4)
        return np.asarray(np.log(read_by_charges(surface, own, [beam], places, 0.005)[1] / truth))

    found = least_squares(residuals, np.log(right * [2.0, 0.5]), diff_step=[0.02, 0.02], x_scale=1.0, xtol=1e-4)
    assert np.exp(found.x) == pytest.approx(right, rel=0.002)


def test_readings_along_a_rod_are_those_of_its_series() -> None:
    z, theta = np.array([3.0, 10.0, 20.0, 30.0]), np.array([0.3, 0.0, 1.0, 3.0])
    places = np.column_stack([6.0 * np.cos(theta), 6.0 * np.sin(theta), z])
    truth = exact_cylinder.point_exitance(TISSUE, radius=6.0, source_radius=5.0, theta=theta, z=z)
    _, read, bars = read_by_charges(cylinder(6.0, 120.0), TISSUE, [PointSource((5.0, 0.0, 0.0))], places, 0.01)
    assert (np.abs(read / truth - 1.0) <= np.minimum(2.0 * bars, 0.01)).all()


def test_a_long_rod_takes_no_more_charges_than_others() -> None:
    """Charges closest together on ways that are narrow beside the rod were 4,600 in place of 100."""
    errors, bars, _, size = measure(random_scene(6021), TOLERANCE, charges=True)
    assert int(size.split()[0]) < 400
    assert errors.max() < TOLERANCE
    assert (errors <= 2.0 * bars).all()


def test_few_and_many_charges_read_within_their_bars_on_the_far_side_of_a_torus() -> None:
    """Down to 1e-7 of what is read beside the beam."""
    beam, angle = PencilBeam((40.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), np.linspace(0.4, 2.6, 6)
    places = 26.0 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    coarse, fine = (read_by_charges(torus(20.0, 6.0), TISSUE, [beam], places, own) for own in (0.1, 0.02))
    assert coarse[0].charges < fine[0].charges < 1200
    assert fine[1].min() < 1e-6 * fine[1].max()
    assert fine[2].max() < 0.02
    assert (np.abs(coarse[1] / fine[1] - 1.0) <= 2.0 * (coarse[2] + fine[2])).all()


def test_few_and_many_charges_read_within_their_bars_on_a_hare() -> None:
    (case,) = load_cases(library_folder() / "hare.yaml")
    lights = list(case.channels[0].lights.values())
    detectors = points(case.surface.points[np.random.default_rng(1).choice(len(case.surface.points), 12)])
    few, many = (
        solve_with_charges(
            case.surface, TISSUE, lights, tolerance=None, detectors=detectors, detector_tolerance=0.01, most=most
        ).readings
        for most in (300, 700)
    )
    assert min(reading.exitance for reading in many) < 1e-3 * max(reading.exitance for reading in many)
    for one, other in zip(few, many, strict=True):
        assert one.relative_error is not None
        assert other.relative_error is not None
        assert abs(one.exitance / other.exitance - 1.0) <= 2.0 * (one.relative_error + other.relative_error)


def test_a_tolerance_that_is_missed_is_said() -> None:
    detectors = [PointDetector((10.0, 0.0, 0.0)), PointDetector((0.0, 0.0, -10.0))]
    light = [PointSource((0.0, 0.0, 9.9))]
    missed = solve_with_charges(
        sphere(10.0), TISSUE, light, tolerance=None, detectors=detectors, detector_tolerance=1e-4, most=30
    )
    (warning,) = missed.warnings
    assert warning.startswith("the tolerance of 0.0001 for detectors was not met by reading")
    assert 'charges; solve it with model "full".' in warning


def test_both_tolerances_are_met() -> None:
    """The exitance beside a shallow source needs more charges than a reading on the other side."""
    light, places = [PointSource((0.0, 0.0, 9.7))], np.array([[0.0, 0.0, -10.0]])
    alone, _, _ = read_by_charges(sphere(10.0), TISSUE, light, places, 0.01)
    both = solve(
        sphere(10.0),
        TISSUE,
        light,
        model="charges",
        tolerance=1e-4,
        detectors=points(places),
        detector_tolerance=0.01,
    )
    assert both.error_estimate <= 1e-4 < alone.error_estimate


def test_diffuse_light_is_read_too() -> None:
    _, read, bars = read_by_charges(sphere(12.0), TISSUE, [DiffuseLight(1.0)], np.array([[0.0, 12.0, 0.0]]), 0.01)
    truth = solve(sphere(12.0), TISSUE, [DiffuseLight(1.0)], model="charges", tolerance=1e-4)
    assert abs(read[0] / truth.exitance_on(np.array([[0.0, 12.0, 0.0]]))[0] - 1.0) < 2.0 * bars[0] < 0.02


@pytest.mark.parametrize("number", [30022, 30052])
def test_regions_are_read_within_the_tolerance(number: int) -> None:
    """Balls in balls against their series; in the second, jumps at the inner ball are most of the bars."""
    errors, bars, _, size = measure(random_scene(number), TOLERANCE, charges=True)
    assert int(size.split()[0]) < 700
    assert errors.max() < TOLERANCE
    assert (errors <= 2.0 * bars).all()
    assert bars.max() < TOLERANCE


def test_detectors_are_read_where_they_are() -> None:
    """Points of a ball are not moved along it by its triangles."""
    rng = np.random.default_rng(0)
    places = rng.normal(size=(200, 3))
    places *= 30.0 / np.linalg.norm(places, axis=1)[:, None]
    found, _ = drop_perpendiculars(sphere(30.0), places)
    assert np.abs(found - places).max() < 1e-4
    assert np.abs(sphere(30.0).project(places)[0] - places).max() > 3e-4


CASE = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.1, sigma_s_prime: 1, eta: 1.4}
lights: [{point: {position: [0, 0, 9]}}]
model: charges
tolerance: {detectors: 0.01}
detectors: [{name: far, point: [0, 0, -10]}]
"""


def test_case_files_take_the_tolerance(tmp_path: Path) -> None:
    file = tmp_path / "ball.yaml"
    file.write_text(CASE)
    (case,) = load_cases(file)
    assert (case.tolerance, case.detector_tolerance) == (None, 0.01)
    core = "{surface: {sphere: {radius: 3}}, medium: {sigma_a: 0.2, sigma_s_prime: 1, eta: 1.4}}"
    file.write_text(f"{CASE}regions: [{core}]\n")
    assert load_cases(file)[0].detector_tolerance == 0.01
    file.write_text(CASE.replace("detectors: 0.01", "volume: 0.01"))
    with pytest.raises(InputError, match=r"tolerance.volume is for finite elements"):
        load_cases(file)


def test_readings_in_the_dark_are_told() -> None:
    """Behind ten decades of absorption, where charges resolve nothing."""
    dark = Medium(sigma_a=3.0, sigma_s_prime=1.0, eta=1.4)
    detectors = [PointDetector((0.0, 0.0, 10.0)), PointDetector((0.0, 0.0, -10.0))]
    light = [PointSource((0.0, 0.0, 9.0))]
    found = solve_with_charges(sphere(10.0), dark, light, tolerance=0.05, detectors=detectors)
    (note,) = (each for each in found.warnings if getattr(each, "code", "") == "reading-dark")
    assert note.startswith("reading 2 is in the dark: it is less than its estimated error; give a tolerance for detect")
    found = solve_with_charges(sphere(10.0), dark, light, tolerance=None, detectors=detectors, detector_tolerance=0.01)
    (note,) = (each for each in found.warnings if getattr(each, "code", "") == "reading-dark")
    assert note.endswith("leave it out, or bring light nearer to it.")
