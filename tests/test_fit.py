"""Fits of coefficients to readings: values, covariance, what is not determined, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from tetlux.fem import FitProblem, Medium, PencilBeam, PointDetector, PointSource, Region, fit, solve, tissue
from tetlux.fem.inverse.parameters import unknowns_of
from tetlux.fem.lights import Light
from tetlux.fem.sensitivity.sensitivity import sensitivity
from tetlux.fem.system import System
from tetlux.meshing import InputError, Surface, TetMesh, sphere, torus
from tetlux.meshing.arrays import FloatArray

START = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
BEAM = PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0))
ANGLES = np.radians([20.0, 45.0, 70.0, 100.0, 140.0])
DETECTORS = [PointDetector((10.0 * float(np.sin(a)), 0.0, 10.0 * float(np.cos(a)))) for a in ANGLES]
COEFFICIENTS = ["sigma_a", "sigma_s_prime"]
NOISE = 0.01


def spread(count: int) -> FloatArray:
    """Unit vectors evenly spread over all directions, (count, 3)."""
    number = np.arange(count) + 0.5
    height, angle = 1.0 - 2.0 * number / count, np.pi * (1.0 + np.sqrt(5.0)) * number
    ring = np.sqrt(1.0 - height**2)
    return np.column_stack([ring * np.cos(angle), ring * np.sin(angle), height])


def problem_on(mesh: TetMesh, surface: Surface, readings: FloatArray, names: list[str]) -> FitProblem:
    measured = readings.reshape(1, 1, -1)
    unknowns = unknowns_of(names, START, (), [BEAM])
    return FitProblem(surface, mesh, [BEAM], DETECTORS, (), unknowns, measured, np.full(measured.shape, NOISE))


@pytest.mark.slow
def test_coefficients_of_a_torus_are_found_again() -> None:
    """By ten detectors from a start a factor of 3 off, of readings that are not those of the mesh."""
    truth = Medium(sigma_a=0.02, sigma_s_prime=1.1, eta=1.4)
    body, beam = torus(20.0, 8.0), PencilBeam((20.0, 0.0, 20.0), (0.0, 0.0, -1.0))
    angles = np.radians(np.linspace(8.0, 50.0, 10))
    there = [PointDetector((20.0 * float(np.cos(a)), 20.0 * float(np.sin(a)), 8.0)) for a in angles]
    read = solve(body, truth, [beam], model="charges", detectors=there, detector_tolerance=0.002).readings
    start = replace(truth, sigma_a=0.06, sigma_s_prime=0.37)
    found = fit(body, [beam], there, read, COEFFICIENTS, start, noise=NOISE)
    assert found.values["sigma_a"] == pytest.approx(truth.sigma_a, rel=0.005)
    assert found.values["sigma_s_prime"] == pytest.approx(truth.reduced_scattering, rel=0.005)
    assert found.undetermined == ()
    assert found.evaluations < 16


def test_gradient_is_that_of_the_value(ball: Surface, ball_mesh: TetMesh) -> None:
    problem = problem_on(ball_mesh, ball, np.geomspace(1e-2, 1e-4, 5), ["light1.y", *COEFFICIENTS, "gain"])
    # By the mesh of one place the readings of others are found as smoothly.
    problem.residuals(problem.start)
    place, step = problem.unknowns.parameters(np.array([0.7, 0.012, 0.9, 1.2])), 1e-4
    _, gradient = problem.value_and_gradient(place)
    for number in range(4):
        way = step * np.eye(4)[number]
        sides = [problem.value_and_gradient(place + side * way)[0] for side in (1.0, -1.0)]
        assert gradient[number] == pytest.approx((sides[0] - sides[1]) / (2.0 * step), rel=1e-5)


def test_covariance_is_that_of_repeated_fits(ball: Surface) -> None:
    """Of 300 draws of noise, each fitted by one step from the result: 68 % lie within one standard deviation."""
    readings = solve(ball, START, [BEAM], tolerance=None, detectors=DETECTORS, detector_tolerance=0.02).readings
    start = replace(START, sigma_a=0.011)
    found = fit(ball, [BEAM], DETECTORS, readings, COEFFICIENTS, start, noise=NOISE, detector_tolerance=0.02)
    values = np.array(list(found.values.values()))
    exact = np.array([reading.exitance for reading in readings])
    problem = problem_on(found.mesh, ball, exact, COEFFICIENTS)
    jacobian = problem.jacobian(np.log(values))
    draws = np.random.default_rng(3).standard_normal((300, 5))
    spread = values * (np.linalg.pinv(jacobian) @ draws.T).T
    share = (np.abs(spread) < np.array(list(found.errors.values()))).mean(axis=0)
    assert ((share > 0.60) & (share < 0.75)).all()
    correlations = np.asarray(np.corrcoef(spread.T))
    assert correlations[0, 1] == pytest.approx(found.covariance[0, 1] / np.prod(list(found.errors.values())), abs=0.1)


@pytest.mark.slow
def test_places_of_lights_are_found(ball: Surface) -> None:
    """A point from 4 mm away with the absorption, and a beam from 2 mm away, with readings of charges."""
    truth = replace(START, sigma_a=0.02)
    there = [PointDetector((10.0 * x, 10.0 * y, 10.0 * z)) for x, y, z in spread(12).tolist()]
    point, beam = PointSource((1.0, 2.0, 3.0)), PencilBeam((1.0, 2.0, 20.0), (0.0, 0.0, -1.0))
    read = [
        [each.exitance for each in solve(ball, truth, [light], model="charges", detectors=there).readings]
        for light in (point, beam)
    ]
    begin: list[Light] = [replace(point, position=(0.0, 0.0, 0.0)), replace(beam, origin=(-1.0, 2.0, 20.0))]
    names = ["light1.x", "light2.x", "sigma_a", "light1.z", "light1.y"]
    found = fit(ball, begin, there, read, names, replace(truth, sigma_a=0.014), noise=NOISE, detector_tolerance=0.02)
    assert [found.values[f"light1.{axis}"] for axis in "xyz"] == pytest.approx([1.0, 2.0, 3.0], abs=0.02)
    assert found.values["light2.x"] == pytest.approx(1.0, abs=0.02)
    assert found.values["sigma_a"] == pytest.approx(0.02, rel=0.02)
    x, y, z = (found.values[f"light1.{axis}"] for axis in "xyz")
    assert found.lights[0] == replace(point, position=(x, y, z))
    assert found.undetermined == ()


@pytest.mark.slow
def test_moves_along_a_beam_are_not_told(ball: Surface, ball_mesh: TetMesh) -> None:
    readings = sensitivity(System(ball_mesh, START, ball), [BEAM], DETECTORS[:3], per="region").readings
    begin, names = replace(BEAM, origin=(0.1, 0.0, 20.0)), ["light1.x", "light1.z"]
    found = fit(ball, [begin], DETECTORS[:3], readings, names, START, noise=NOISE, detector_tolerance=0.1)
    assert found.values["light1.x"] == pytest.approx(0.0, abs=0.05)
    assert found.values["light1.z"] == 20.0
    assert found.undetermined == ("the readings do not tell light1.z.",)


def test_a_light_outside_of_the_body_is_no_step(ball: Surface, ball_mesh: TetMesh) -> None:
    point = PointSource((0.0, 0.0, 9.0))
    measured = np.geomspace(1e-2, 1e-4, 5).reshape(1, 1, -1)
    unknowns = unknowns_of(["light1.z"], START, (), [point])
    problem = FitProblem(ball, ball_mesh, [point], DETECTORS, (), unknowns, measured, np.full(measured.shape, NOISE))
    outside = unknowns.parameters(np.array([10.5]))
    with pytest.raises(InputError, match="lies outside the body"):
        problem.residuals(outside)
    assert np.isfinite(problem.residuals(problem.start)).all()
    assert np.isinf(problem.residuals(outside)).all()


@pytest.mark.slow
def test_a_region_is_fitted(ball: Surface) -> None:
    medium = Medium(sigma_a=0.03, sigma_s_prime=1.3, eta=1.4)
    inner = Region(sphere(5.0, center=(0.0, 1.0, 0.0)), medium)
    lights = [BEAM, PencilBeam((0.0, 0.0, -20.0), (0.0, 0.0, 1.0))]
    solution = solve(ball, START, lights, regions=[inner], tolerance=None, detectors=DETECTORS, detector_tolerance=0.02)
    found = sensitivity(System(solution.mesh, START, ball, regions=(inner,)), lights, DETECTORS, per="region")
    start = replace(inner, medium=replace(medium, sigma_a=0.015))
    names = ["1.sigma_a", "sigma_a"]
    result = fit(
        ball, lights, DETECTORS, found.readings, names, START, regions=[start], noise=NOISE, detector_tolerance=0.02
    )
    assert result.values["1.sigma_a"] == pytest.approx(0.03, rel=0.1)
    assert result.values["sigma_a"] == pytest.approx(0.01, rel=0.03)


@pytest.mark.slow
def test_oxygen_is_found_at_two_wavelengths_with_modulated_light(ball: Surface) -> None:
    given = {"wavelengths": [690.0, 830.0], "hbo2": 60e-6, "hhb": 40e-6, "water": 0.7, "a": 1.2, "b": 1.3, "eta": 1.4}
    media = tissue(**given)  # type: ignore[arg-type]
    options = {"tolerance": None, "detectors": DETECTORS, "detector_tolerance": 0.02, "frequency": 100e6}
    solutions = solve(ball, media, [BEAM], **options)  # type: ignore[call-overload]
    readings = [[reading.exitance for reading in solution.readings] for solution in solutions]
    start = {**given, "hbo2": 40e-6, "hhb": 55e-6, "a": 1.5}
    found = fit(
        ball, [BEAM], DETECTORS, readings, ["hbo2", "hhb", "a"], start, frequency=100e6, detector_tolerance=0.02
    )
    assert found.values["hbo2"] == pytest.approx(60e-6, rel=0.05)
    assert found.values["hhb"] == pytest.approx(40e-6, rel=0.05)
    assert found.values["a"] == pytest.approx(1.2, rel=0.02)


def test_what_readings_do_not_tell_is_said(ball: Surface, ball_mesh: TetMesh) -> None:
    """At one wavelength ``a`` and ``b`` have one effect."""
    given = {"wavelengths": [690.0], "hbo2": 60e-6, "hhb": 40e-6, "a": 1.2, "b": 1.3, "eta": 1.4}
    system = System(ball_mesh, tissue(**given)[0], ball)  # type: ignore[arg-type]
    readings = sensitivity(system, [BEAM], DETECTORS, per="region").readings
    found = fit(ball, [BEAM], DETECTORS, readings, ["a", "b"], given, noise=NOISE, detector_tolerance=0.05)
    assert found.undetermined == ("the readings do not tell a and b apart: a product of their powers is free.",)


def test_what_cannot_be_fitted_is_refused(ball: Surface) -> None:
    readings = [1e-2, 1e-3, 1e-3, 1e-4, 1e-4]

    def refused(match: str, **changes: object) -> None:
        arguments = {"readings": readings, "unknowns": COEFFICIENTS, "start": START, **changes}
        with pytest.raises(InputError, match=match):
            fit(ball, [BEAM], DETECTORS, **arguments)  # type: ignore[arg-type]

    refused(
        "there are 3 unknowns and 2 readings", readings=[1e-2, 1e-3, *[np.nan] * 3], unknowns=[*COEFFICIENTS, "gain"]
    )
    refused('"sigma_s" is no unknown of this fit; give some of sigma_a, sigma_s_prime, gain, l', unknowns=["sigma_s"])
    refused('"hbo2" is no unknown', unknowns=["hbo2"])
    refused('the unknown "gain" is given twice', unknowns=["gain", "gain"])
    refused("unknowns are given in a list of names, and there is none", unknowns=[])
    refused("that detector is in the dark", readings=[1e-2, 1e-3, 1e-3, 1e-4, -1e-9])
    refused(r"readings have shape \(2,\); give 1 x 1 x 5 numbers", readings=[1e-2, 1e-3])
    refused("noise is a relative standard deviation", noise=0.0)
    refused(r"noise has shape \(2,\)", noise=[0.1, 0.1])
    refused("noise is 'high'; give a relative standard deviation", noise="high")
    refused("the light is steady; give real readings", readings=[1j] * 5)
    refused("the light is modulated; give complex readings", frequency=1e8)
    refused("bounds of sigma_a are 0.1 and 0.01; give two values", bounds={"sigma_a": (0.1, 0.01)})
    refused("bounds of light1.x are 1 and 0; give two coord", unknowns=["light1.x"], bounds={"light1.x": (1.0, 0.0)})
    refused('"light2.x" is no unknown', unknowns=["light2.x"])
    refused("bounds of sigma_a are 3; give two values", bounds={"sigma_a": 3})
    refused("start is 3.0; give a Medium, or the arguments of tissue", start=3.0)
    refused("start has 2 entries; give one for the body", start=[START, START])
    given = {"wavelengths": [690.0], "hbo2": 60e-6, "a": 1.2, "b": 1.3, "eta": 1.4}
    refused("start lacks a, eta; give what tissue needs", unknowns=["hbo2"], start={"wavelengths": [690.0], "b": 1.3})
    refused('start has "oxygen"; the arguments of tissue are', unknowns=["hbo2"], start={**given, "oxygen": 1.0})
    refused("the wavelength 500 nm is outside", unknowns=["hbo2"], start={**given, "wavelengths": [500.0]})
    refused("start has the unit cm, and the body is in mm", unknowns=["hbo2"], start={**given, "unit": "cm"})
    refused("sigma_a begins at 0; begin with a value greater than 0", start=replace(START, sigma_a=0.0))
