"""Error bars of readings under ``model="charges"``, against series."""

import numpy as np
import pytest

from tests.benchmarks.reading_scenes import random_scene
from tests.benchmarks.readings import TOLERANCE, measure
from tests.conftest import TISSUE
from tetlux.fem import DiffuseLight, DiscDetector, Medium, PencilBeam, PointDetector, PointSource, Region, read, solve
from tetlux.fem.exact import layered_ball
from tetlux.fem.exact import sphere as exact
from tetlux.fem.meshless import ChargeSolution
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.meshing import box, sphere
from tetlux.meshing.arrays import FloatArray

GAMMA = np.array([0.1, 0.3, 0.7, 1.2, 1.8, 2.5, 3.1])


def on_ball(radius: float) -> list[PointDetector]:
    return [PointDetector((radius * float(np.sin(g)), 0.0, radius * float(np.cos(g)))) for g in GAMMA]


def check(solution: ChargeSolution, truth: FloatArray) -> FloatArray:
    """The true errors, which are within three bars, and whose bars are not far above them on average."""
    errors = np.array([reading.exitance for reading in solution.readings]) / truth - 1.0
    bars = np.array([reading.relative_error for reading in solution.readings], dtype=float)
    assert (np.abs(errors) <= 3.0 * bars).all()
    assert 0.5 < np.exp(np.log(bars / np.abs(errors)).mean()) < 10.0
    return np.abs(errors)


@pytest.mark.parametrize(("sigma_a", "tolerance"), [(0.01, 0.02), (0.15, 0.01)])
def test_bars_hold_the_errors_of_a_ball(sigma_a: float, tolerance: float) -> None:
    """From bright places to those where charges are off by far more than the tolerance of the whole."""
    medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4)
    light = [PointSource((0.0, 0.0, 11.0))]
    solution = solve(sphere(12.0), medium, light, model="charges", tolerance=tolerance, detectors=on_ball(12.0))
    errors = check(solution, exact.point_exitance(medium, radius=12.0, source_radius=11.0, gamma=GAMMA))
    assert errors[0] < tolerance < errors.max()


def test_bars_hold_the_errors_of_layers() -> None:
    core = Medium(sigma_a=0.05, sigma_s_prime=0.6, eta=1.4)
    solution = solve(
        sphere(12.0),
        TISSUE,
        [PointSource((0.0, 0.0, 11.0))],
        regions=[Region(sphere(8.0), core)],
        model="charges",
        tolerance=0.005,
        detectors=on_ball(12.0),
    )
    check(solution, layered_ball.point_exitance([core, TISSUE], [8.0, 12.0], source_radius=11.0, gamma=GAMMA))


def test_bars_under_diffuse_light_are_small_where_charges_are_exact() -> None:
    solution = solve(sphere(12.0), TISSUE, [DiffuseLight(1.0)], model="charges", detectors=on_ball(12.0))
    assert max(reading.relative_error or np.inf for reading in solution.readings) < 10.0 * solution.error_estimate


def test_corners_and_discs_have_bars_too() -> None:
    detectors: list[Detector] = [
        DiscDetector((0.0, 0.0, 5.0), 0.5),
        PointDetector((5.0, 5.0, 4.9)),
        PointDetector((5.0, 0.0, 0.0)),
    ]
    beam = [PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0))]
    solution = solve(box((10.0, 10.0, 10.0)), TISSUE, beam, model="charges", tolerance=0.05, detectors=detectors)
    fine = solve(box((10.0, 10.0, 10.0)), TISSUE, beam, model="charges", tolerance=0.0005, detectors=detectors)
    for coarse, better in zip(solution.readings, fine.readings, strict=True):
        assert coarse.relative_error is not None
        assert better.relative_error is not None
        assert abs(coarse.exitance / better.exitance - 1.0) < 3.0 * (coarse.relative_error + better.relative_error)
        assert better.relative_error < coarse.relative_error < 0.5
    assert read(detectors[1], fine).relative_error == pytest.approx(fine.readings[1].relative_error, rel=1e-6)


def test_bars_of_readings_are_about_as_large_as_their_errors() -> None:
    """Plates of which the residual far from a detector counts: two or more lie beyond where its sum is left out."""
    errors, bars = np.zeros(0), np.zeros(0)
    for number in (7, 13, 31):
        error, bar, _, _ = measure(random_scene(number), TOLERANCE, charges=True)
        errors, bars = np.append(errors, error), np.append(bars, bar)
    assert (errors <= TOLERANCE).all()
    assert (errors <= 2.0 * bars).all()
    assert 0.7 <= np.median(bars / errors) <= 4.0
