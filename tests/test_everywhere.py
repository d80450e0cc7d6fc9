"""Tolerances of exitance and fluence everywhere: met against series, told where missed, in Python and in case files."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import TISSUE
from tetlux.cases.cli import main
from tetlux.fem import DiffuseLight, Medium, PointDetector, PointSource, Region, Solution, solve
from tetlux.fem.error.tolerance import splits_for_fields, splits_for_readings
from tetlux.fem.exact import sphere as exact
from tetlux.fem.quadratic.field_error import DARKEST, field_errors
from tetlux.fem.quadratic.reading_error import ReadingError
from tetlux.meshing import InputError, box, sphere
from tetlux.meshing.arrays import FloatArray

DIM = Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4)
RADIUS, DEPTH = 16.0, 1.0
SOURCE = (0.0, 0.0, RADIUS - DEPTH)


def from_pole(gamma: FloatArray) -> FloatArray:
    """Points of the ball at angles (q,) from the light, all around it."""
    around = 2.4 * np.arange(len(gamma))
    return RADIUS * np.column_stack([np.sin(gamma) * np.cos(around), np.sin(gamma) * np.sin(around), np.cos(gamma)])


@pytest.fixture(scope="module")
def dim() -> Solution:
    """A ball in which light fades by eight decades."""
    return solve(sphere(RADIUS), DIM, [PointSource(SOURCE)], tolerance=None, everywhere_tolerance=0.1)


# Up to where there is a millionth of the largest exitance, and somewhat beyond.
GAMMA = np.linspace(0.0, 1.6, 400)


def relative_errors(found: FloatArray) -> FloatArray:
    truth = exact.point_exitance(DIM, radius=RADIUS, source_radius=RADIUS - DEPTH, gamma=GAMMA)
    return np.asarray(np.abs(found - truth) / np.maximum(truth, DARKEST * truth.max()))


def test_exitance_is_within_the_tolerance_at_almost_every_point(dim: Solution) -> None:
    errors = relative_errors(dim.exitance_at(from_pole(GAMMA)))
    assert np.mean(errors <= 0.1) > 0.97
    assert dim.everywhere_error <= 0.1
    assert 0.5 < dim.everywhere_error / np.percentile(errors, 99) < 8.0
    assert not [warning for warning in dim.warnings if "tolerance" in warning]
    assert np.isnan(dim.volume_error)
    # Without a tolerance of the L2 error, the one everywhere is one too.
    assert dim.error_estimate <= 0.1


def test_the_mesh_that_meets_it_is_needed(dim: Solution) -> None:
    """At the default tolerance dark points are off by more than themselves, and that is what bands say of it."""
    plain = solve(sphere(RADIUS), DIM, [PointSource(SOURCE)])
    assert np.isnan(plain.everywhere_error)
    assert plain.quadratic is not None
    bands = [band.relative for band in field_errors(plain.quadratic, "surface")]
    assert bands[0] < 0.05
    assert max(bands) > 0.2
    assert np.mean(relative_errors(plain.exitance_at(from_pole(GAMMA))) > 0.1) > 0.04
    assert len(dim.mesh.tetrahedra) < 40_000


def test_nodes_and_points_show_the_same_exitance(dim: Solution) -> None:
    at_nodes = dim.exitance_on(dim.mesh.points[dim.mesh.boundary_nodes])
    bright = dim.exitance > DARKEST * dim.exitance.max()
    assert at_nodes[bright] == pytest.approx(dim.exitance[bright], rel=1e-6)
    assert dim.exitance.min() >= 0.0
    assert dim.exitance_at(from_pole(GAMMA)).min() >= 0.0
    assert dim.power.balance_error < 1e-9


def test_fluence_is_within_the_tolerance_in_every_region() -> None:
    """A small region of the medium around it, and lights on either side."""
    lights = [PointSource((0.0, 0.0, 7.0)), PointSource((0.0, 0.0, -7.0))]
    regions = [Region(sphere(2.0), TISSUE)]
    solution = solve(sphere(8.0), TISSUE, lights, regions=regions, tolerance=None, volume_tolerance=0.05)
    assert solution.volume_error <= 0.05
    rng = np.random.default_rng(3)
    for radii in ((0.0, 1.9), (2.1, 6.5)):
        away = rng.normal(size=(100, 3))
        points = away / np.linalg.norm(away, axis=1)[:, None] * rng.uniform(*radii, 100)[:, None]
        truth = sum(
            exact.point_fluence(TISSUE, radius=8.0, source_radius=7.0, points=points * [1.0, 1.0, mirror])
            for mirror in (1.0, -1.0)
        )
        assert np.mean(np.abs(solution.fluence_at(points) / truth - 1.0) <= 0.05) > 0.95
    parts = sum(part.fluence_at(points) for part in solution.of_lights)
    assert solution.fluence_at(points) == pytest.approx(parts, rel=1e-6)
    assert np.isnan(solution.fluence_at(np.array([[0.0, 0.0, 8.5]]))).all()


def test_layers_that_quadratic_elements_overshoot_in_stay_linear_and_say_so() -> None:
    absorber = Medium(sigma_a=3.0, sigma_s_prime=1.0, eta=1.4)
    body = sphere(10.0)
    solution = solve(body, absorber, [DiffuseLight(1.0)], tolerance=0.9, everywhere_tolerance=0.5, most_tetrahedra=1)
    top = np.array([[0.0, 0.0, 10.0]])
    assert not solution.is_quadratic
    assert solution.quadratic is not None
    assert solution.exitance_at(top) != pytest.approx(solution.quadratic.exitance_on(top, np.zeros(1)), rel=0.05)
    assert solution.everywhere_error > 0.1


def test_a_tolerance_that_is_missed_is_told() -> None:
    light, mesh = [PointSource((0.0, 0.0, 9.0))], None
    for tolerance in (0.5, 1e-4):
        solution = solve(
            sphere(10.0), TISSUE, light, mesh=mesh, everywhere_tolerance=tolerance, volume_tolerance=tolerance
        )
        mesh = solution.mesh
        told = [warning for warning in solution.warnings if f"the tolerance of {tolerance:g} of the" in warning]
        if tolerance > solution.everywhere_error:
            assert told == []
        else:
            assert [warning.split(" of the ")[1].split(" was")[0] for warning in told] == [
                "exitance everywhere",
                "fluence inside",
            ]
            assert "on the mesh given" in told[0]
    assert told


def test_tolerances_of_different_things_go_together() -> None:
    solution = solve(
        box((6.0, 6.0, 6.0)),
        TISSUE,
        [PointSource((0.0, 0.0, 2.0))],
        tolerance=0.02,
        detectors=[PointDetector((0.0, 0.0, -3.0))],
        detector_tolerance=0.02,
        everywhere_tolerance=0.1,
        volume_tolerance=0.1,
    )
    reading = solution.readings[0]
    assert reading.relative_error is not None
    assert reading.relative_error <= 0.02
    assert max(solution.everywhere_error, solution.volume_error) <= 0.1
    assert reading.exitance == pytest.approx(solution.exitance_at(np.array([[0.0, 0.0, -3.0]]))[0], rel=1e-4)


def test_dark_bodies_have_no_error() -> None:
    solution = solve(sphere(10.0), TISSUE, [PointSource((0.0, 0.0, 9.0), 1e-50)], everywhere_tolerance=0.1)
    assert 0.0 <= solution.everywhere_error <= 0.1


@pytest.mark.parametrize("split", [splits_for_readings, splits_for_fields])
def test_errors_that_do_not_cancel_are_refined_for(split: object) -> None:
    """The sum of contributions alone is above the tolerance, their squares are far below."""
    assert callable(split)
    squares = np.full(100, 1e-8)
    squares[:10] = 1e-6
    splits = split([ReadingError(1.0, squares, 0.2, 0.0)], 0.1, 100)
    assert splits[:10].min() > 0
    assert not split([ReadingError(1.0, squares, 0.02, 0.0)], 0.1, 100).any()
    assert not split([ReadingError(1.0, np.zeros(100), 0.2, 0.0)], 0.1, 100).any()


@pytest.mark.parametrize("name", ["everywhere_tolerance", "volume_tolerance"])
def test_tolerances_out_of_range(name: str) -> None:
    with pytest.raises(InputError, match=f"{name} is 2; give a relative error between 0.0001 and 1"):
        solve(sphere(10.0), TISSUE, [PointSource((0, 0, 9.0))], tolerance=None, **{name: 2.0})  # type: ignore[call-overload]


CASE = """
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights: [{pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 1.0}}]
tolerance: {everywhere: 0.1, volume: 0.2}
outputs: [volume]
"""


def test_a_case_with_tolerances_everywhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "ball.yaml").write_text(CASE)
    assert main(["run", str(tmp_path / "ball.yaml"), "--out", str(tmp_path / "out")]) == 0
    assert ", everywhere " in capsys.readouterr().out
    summary = json.loads((tmp_path / "out" / "ball" / "summary.json").read_text())
    assert summary["tolerance"] is None
    assert (summary["everywhere_tolerance"], summary["volume_tolerance"]) == (0.1, 0.2)
    assert 0.0 < summary["channels"][0]["everywhere_error"] <= 0.1
    assert 0.0 < summary["channels"][0]["volume_error"] <= 0.2


def test_charges_refuse_tolerances_everywhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "ball.yaml").write_text(CASE.replace("{everywhere", "{exitance: 0.1, everywhere") + "model: charges\n")
    assert main(["check", str(tmp_path / "ball.yaml")]) == 2
    assert 'tolerance.everywhere is for finite elements, not for model "charges"' in capsys.readouterr().err
