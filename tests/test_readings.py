"""Readings: quadratic elements, error bars, tolerances for detectors, in Python and in case files."""

import csv
import json
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.conftest import TISSUE
from tests.meshes_made import cube_of_cubes
from tetlux.cases.cli import main
from tetlux.fem import DiffuseLight, Medium, PencilBeam, PointDetector, PointSource, Region, Solution, read, solve
from tetlux.fem.exact import layered
from tetlux.fem.exact import sphere as exact
from tetlux.fem.media.coefficients import coefficients_of
from tetlux.fem.quadratic.measurement import Measurement
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.meshing import InputError, TetMesh, box, sphere, tetrahedralize
from tetlux.meshing.arrays import FloatArray

MEDIUM = Medium(sigma_a=0.012, sigma_s_prime=1.1, eta=1.4)
RADIUS, DEPTH = 20.0, 0.9


def on_ball(arcs: FloatArray) -> list[PointDetector]:
    angles = arcs / RADIUS
    return [PointDetector((RADIUS * float(np.sin(g)), 0.0, RADIUS * float(np.cos(g)))) for g in angles]


ARCS = np.array([2.0, 6.0, 10.0, 14.0, 20.0, 26.0, 34.0])


@pytest.fixture(scope="module")
def far() -> Solution:
    """A ball solved for detectors alone."""
    light = PointSource((0.0, 0.0, RADIUS - DEPTH), 1.0)
    return solve(sphere(RADIUS), MEDIUM, [light], tolerance=None, detectors=on_ball(ARCS), detector_tolerance=0.01)


def truth(arcs: FloatArray) -> FloatArray:
    return exact.point_exitance(MEDIUM, radius=RADIUS, source_radius=RADIUS - DEPTH, gamma=arcs / RADIUS)


def test_readings_far_from_the_light_meet_their_tolerance(far: Solution) -> None:
    """Over six decades; linear elements on the same mesh are off by several per cent."""
    found = np.array([reading.exitance for reading in far.readings])
    bars = np.array([reading.relative_error for reading in far.readings])
    errors = np.abs(found / truth(ARCS) - 1.0)
    assert errors.max() < 0.01
    assert bars.max() <= 0.01
    assert (errors < 3.0 * bars).all()
    linear = np.array([far.exitance_on(np.array([reading.position]))[0] for reading in far.readings])
    assert np.abs(linear / truth(ARCS) - 1.0).max() > 3.0 * errors.max()
    assert len(far.mesh.tetrahedra) < 30_000


def test_a_reading_that_was_not_asked_for_has_its_bar(far: Solution) -> None:
    reading = read(on_ball(np.array([12.0]))[0], far)
    assert reading.relative_error is not None
    assert abs(reading.exitance / truth(np.array([12.0]))[0] - 1.0) < 3.0 * reading.relative_error < 0.1
    assert reading.model_error is not None
    assert 0.0 < reading.model_error < 0.2
    assert read(on_ball(ARCS)[2], far) == far.readings[2]


def test_fluence_inside_has_a_bar(far: Solution) -> None:
    points = np.array([[0.0, 0.0, 10.0], [8.0, 0.0, 12.0], [0.0, 0.0, 30.0]])
    right = exact.point_fluence(MEDIUM, radius=RADIUS, source_radius=RADIUS - DEPTH, points=points[:2])
    fluence, error = far.fluence_with_error(points)
    assert fluence[:2] == pytest.approx(right, rel=0.02)
    assert (np.abs(fluence[:2] / right - 1.0) < 4.0 * error[:2]).all()
    assert np.isnan([fluence[2], error[2]]).all()


def test_a_solution_that_was_pickled_reads_the_same(far: Solution) -> None:
    detector = on_ball(np.array([8.0]))[0]
    received = pickle.loads(pickle.dumps(far))
    assert read(detector, received).exitance == pytest.approx(read(detector, far).exitance, rel=1e-9)
    top = np.array([[0.0, 0.0, RADIUS]])
    assert received.exitance_at(top) == far.exitance_at(top)


def test_lights_add_up_in_readings() -> None:
    lights = [PointSource((0.0, 0.0, 9.0), 1.0), PointSource((5.0, 0.0, 0.0), 2.0)]
    whole = solve(sphere(10.0), TISSUE, lights, tolerance=0.1, detectors=[PointDetector((0.0, 10.0, 0.0))])
    parts = [read(PointDetector((0.0, 10.0, 0.0)), each) for each in whole.of_lights]
    assert whole.readings[0].exitance == pytest.approx(sum(part.exitance for part in parts), rel=1e-6)
    # One light alone does not say how far diffusion is to be trusted.
    assert parts[0].model_error is None
    assert parts[0].relative_error is not None


@pytest.mark.parametrize("upper_is_region", [True, False])
def test_a_plate_of_two_layers_reads_the_same_whichever_is_the_region(upper_is_region: bool) -> None:
    """At 10 mm linear elements read 8.9e-6 and 3.9e-6."""
    upper = Medium(sigma_a=0.05, sigma_s_prime=2.0, eta=1.4)
    lower = Medium(sigma_a=0.002, sigma_s_prime=0.4, eta=1.4)
    top, bottom = box((40, 40, 6), center=(0, 0, -3)), box((40, 40, 6), center=(0, 0, -9))
    body, regions = (lower, [Region(top, upper)]) if upper_is_region else (upper, [Region(bottom, lower)])
    depth = upper.mean_free_path
    solution = solve(
        box((40, 40, 12), center=(0, 0, -6)),
        body,
        [PointSource((0.0, 0.0, -depth), 1.0)],
        regions=regions,
        tolerance=None,
        detectors=[PointDetector((rho, 0.0, 0.0)) for rho in (2.0, 5.0, 10.0)],
        detector_tolerance=0.02,
    )
    right = layered.point_exitance([upper, lower], [6.0, 6.0], depth=depth, rho=[2.0, 5.0, 10.0])
    assert [reading.exitance for reading in solution.readings] == pytest.approx(right.tolist(), rel=0.02)


def curve(points: FloatArray) -> FloatArray:
    """``x² + y z``."""
    return np.asarray(points[..., 0] ** 2 + points[..., 1] * points[..., 2])


def cubes(count: int) -> QuadraticOperator:
    points, tetrahedra, _ = cube_of_cubes(count, 10.0)
    mesh = TetMesh(points, tetrahedra)
    return QuadraticOperator(mesh, mesh.surface, (), coefficients_of(TISSUE))


def test_quadratic_functions_are_integrated_exactly() -> None:
    """``a(u, u)`` of u = x² + y z, by hand: gradients, absorption and boundary of a cube."""
    operator = cubes(2)
    space, mesh = operator.space, operator.mesh
    u = space.interpolate(curve(mesh.points), curve(space.middles))
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    axes = [0.5 * (a + b) + 0.5 * (b - a) * nodes for a, b in zip(low, high, strict=True)]
    sides = 0.5 * (high - low)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    volume = np.einsum("i,j,k->ijk", weights, weights, weights) * np.prod(sides)
    x, y, z = np.moveaxis(grid, -1, 0)
    expected = TISSUE.diffusion * (volume * (4 * x**2 + z**2 + y**2)).sum()
    expected += TISSUE.sigma_a * (volume * curve(grid) ** 2).sum()
    for axis in range(3):
        for end in (low[axis], high[axis]):
            face = grid.take([0], axis=axis).copy()
            face[..., axis] = end
            area = volume.sum(axis=axis, keepdims=True) / (2.0 * sides[axis])
            expected += 0.5 / TISSUE.boundary_factor * (area * curve(face) ** 2).sum()
    assert u @ operator.matrix @ u == pytest.approx(expected, rel=1e-10)


def test_duals_read_what_solutions_show() -> None:
    """``d . u = z . f``, for loads that have nothing to do with each other."""
    operator = cubes(3)
    measurement = Measurement(np.array([[5.0, 1.0, 0.5]]), np.ones(1))
    load = operator.discretise(Measurement(np.array([[-2.0, 1.0, 3.0]]), np.ones(1), inside=True)).load
    u, z = operator.solve(load[:, None])[:, 0], operator.duals([measurement])[0]
    assert operator.discretise(measurement).load @ u == pytest.approx(load @ z, rel=1e-5)


def test_curved_edges_hold_volume_and_area_of_a_ball() -> None:
    """A hundred times better than flat facets."""
    ball = sphere(10.0)
    mesh = tetrahedralize(ball)
    operator = QuadraticOperator(mesh, ball, (), coefficients_of(Medium(sigma_a=1.0, sigma_s_prime=1.0, eta=1.0)))
    ones = np.zeros(operator.space.size)
    ones[: len(mesh.points)] = 1.0
    right = 4.0 / 3.0 * np.pi * 1000.0 + 4.0 * np.pi * 100.0 / 2.0
    assert ones @ operator.matrix @ ones == pytest.approx(right, rel=1e-4)
    assert mesh.volume + mesh.area / 2.0 < 0.99 * right


def test_given_meshes_are_read_with_bars_that_tell_how_coarse_they_are() -> None:
    light = [PointSource((0.0, 0.0, 9.0), 1.0)]
    coarse = solve(sphere(10.0), TISSUE, light, mesh=tetrahedralize(sphere(10.0)), detectors=on_ten())
    right = exact.point_exitance(TISSUE, radius=10.0, source_radius=9.0, gamma=np.radians([30.0, 90.0, 180.0]))
    for reading, true in zip(coarse.readings, right, strict=True):
        assert reading.relative_error is not None
        assert abs(reading.exitance / true - 1.0) < 4.0 * reading.relative_error
    missed = solve(
        sphere(10.0), TISSUE, light, mesh=coarse.mesh, detectors=on_ten(), detector_tolerance=1e-4, tolerance=None
    )
    assert any("tolerance of 0.0001 for detectors was not met" in warning for warning in missed.warnings)


def on_ten() -> list[PointDetector]:
    angles = np.radians([30.0, 90.0, 180.0])
    return [PointDetector((10.0 * float(np.sin(g)), 0.0, 10.0 * float(np.cos(g)))) for g in angles]


def test_a_reading_is_smooth_in_the_coefficients_where_patches_are_kept(far: Solution) -> None:
    """Second differences of logarithms over steps of .5 %: rounding and curvature, and no jumps."""
    detector = on_ball(np.array([14.0]))[0]
    light = [PointSource((0.0, 0.0, RADIUS - DEPTH), 1.0)]
    factors = 1.0 + 0.005 * np.arange(5)
    media = [Medium(sigma_a=0.012 * factor, sigma_s_prime=1.1, eta=1.4) for factor in factors.tolist()]
    found = [
        solve(sphere(RADIUS), medium, light, mesh=far.mesh, detectors=[detector]).readings[0].exitance
        for medium in media
    ]
    gamma = 14.0 / RADIUS
    right = [exact.point_exitance(medium, radius=RADIUS, source_radius=RADIUS - DEPTH, gamma=gamma) for medium in media]
    assert np.diff(np.log(found)) == pytest.approx(np.diff(np.log(right)), rel=0.03)


@pytest.mark.parametrize("kept", [True, False])
def test_neighbouring_scenes_agree_within_their_bars(far: Solution, kept: bool) -> None:
    """Media and positions that differ by a hundredth: on ten meshes by .17 bars of both at most, and by 2e-5."""
    gamma, errors, bars = ARCS / RADIUS, [], []
    for sigma_a, depth in ((0.012, DEPTH), (0.01212, DEPTH), (0.012, 1.01 * DEPTH)):
        medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.1, eta=1.4)
        detectors = on_ball(ARCS)
        light = [PointSource((0.0, 0.0, RADIUS - depth), 1.0)]
        readings = solve(
            sphere(RADIUS),
            medium,
            light,
            tolerance=None,
            detectors=detectors,
            detector_tolerance=0.01,
            mesh=far.mesh if kept else None,
            cache=kept,
        ).readings
        right = exact.point_exitance(medium, radius=RADIUS, source_radius=RADIUS - depth, gamma=gamma)
        errors.append([reading.exitance for reading in readings] / right - 1.0)
        bars.append([reading.relative_error for reading in readings])
    apart = np.abs(np.array(errors) - errors[0])
    assert (apart <= 0.5 * (np.array(bars) + bars[0])).all()
    assert apart.max() < 1e-4


def test_light_that_fades_within_a_tetrahedron_is_read_by_linear_elements_and_says_so() -> None:
    """Quadratic elements overshoot by a factor of three there; linear ones are fitted to the layer."""
    absorber = Medium(sigma_a=3.0, sigma_s_prime=1.0, eta=1.4)
    solution = solve(sphere(10.0), absorber, [DiffuseLight(1.0)], tolerance=0.9, detectors=on_ten()[:1])
    (reading,) = solution.readings
    assert reading.exitance == solution.exitance_on(np.array([reading.position]))[0]
    assert reading.relative_error is not None
    assert reading.relative_error > 0.2


def test_a_mesh_that_is_too_large_is_read_by_linear_elements(far: Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tetlux.fem.outcome.detectors.MOST_TETRAHEDRA_TO_READ", 100)
    reading = read(on_ball(ARCS)[1], far)
    assert reading.relative_error is None
    assert reading.exitance == far.exitance_on(np.array([reading.position]))[0]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"tolerance": None}, "there is no tolerance; give tolerance, or detectors and a detector_tolerance"),
        ({"detector_tolerance": 0.01}, "detector_tolerance is for what detectors read, and there is none"),
        (
            {"detectors": [PointDetector((0, 0, 10))], "detector_tolerance": 2.0},
            "detector_tolerance is 2; give a relative error between",
        ),
        (
            {"detectors": PointDetector((0, 0, 10))},
            r"are given in a list, but PointDetector\(.*\) is none; write \[det",
        ),
        ({"detectors": ["top"]}, "'top' is no detector; give PointDetector, DiscDetector or FibreDetector"),
        ({"detectors": [PointDetector((0, 0, 50))]}, r"position \(0, 0, 50\) is 40 mm from the surface"),
    ],
)
def test_tolerances_that_cannot_be(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        solve(sphere(10.0), TISSUE, [PencilBeam((0, 0, 20), (0, 0, -1))], **given)


CASE = """
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights: [{pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 1.0}}]
detectors:
  - {name: near, point: [5, 0, 8.66]}
  - {name: side, fibre: {center: [10, 0, 0], radius: 0.5, numerical_aperture: 0.22}}
  - {name: below, disc: {center: [0, 0, -10], radius: 1.0}}
outputs: []
"""


def test_a_case_with_a_tolerance_for_detectors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "ball.yaml").write_text(CASE + "tolerance: {detectors: 0.02}\n")
    assert main(["run", str(tmp_path / "ball.yaml"), "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert "of readings" in printed
    assert "near: " in printed
    assert re.search(r"± [0-9.]+ %", printed)
    folder = tmp_path / "out" / "ball"
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["tolerance"] is None
    assert summary["detector_tolerance"] == 0.02
    with (folder / "detectors.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(summary["detectors"]) == 3
    for row, told in zip(rows, summary["detectors"], strict=True):
        assert float(row["relative_error"]) == pytest.approx(told["relative_error"], rel=0.01)
        assert 0.0 < told["relative_error"] <= 0.02
        assert float(row["model_error"]) == pytest.approx(told["model_error"], rel=0.01)
    with Image.open(folder / "readings.png") as image:
        assert image.size == (1400, 900)


@pytest.mark.parametrize(
    ("tolerance", "message"),
    [
        ("{detectors: 2}", "tolerance.detectors: expected a number less than 1"),
        ("{}", "give a tolerance of exitance, detectors, everywhere or volume, or leave tolerance out"),
        ("{readings: 0.01}", "unknown key; .*the keys here are exitance, detectors, everywhere, volume"),
        ("{volume: 0}", "tolerance.volume: expected a number greater than or equal to 0.0001"),
        ("[0.01]", "expected a number"),
    ],
)
def test_tolerances_of_cases_that_cannot_be(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], tolerance: str, message: str
) -> None:
    (tmp_path / "ball.yaml").write_text(CASE + f"tolerance: {tolerance}\n")
    assert main(["check", str(tmp_path / "ball.yaml")]) == 2
    found = capsys.readouterr().err
    assert "Traceback" not in found
    assert re.search(message, found), found
