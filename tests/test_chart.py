"""`tetlux chart`: what it measures with, what it writes, and what it says."""

import csv
import importlib.util
import json
import math
import re
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.conftest import TISSUE
from tetlux import cases, fem, meshing
from tetlux.cases.chart import benchmark as chart_benchmark
from tetlux.cases.chart import command as chart_module
from tetlux.cases.chart import files, finite_elements, reference
from tetlux.cases.chart.benchmark import Benchmark, prepare_benchmark, prepare_readings_benchmark
from tetlux.cases.chart.finite_elements import FINITE_ELEMENTS, OURS, READING_METHODS
from tetlux.cases.chart.meshless import CHARGES, MESHLESS, MONTE_CARLO
from tetlux.cases.chart.methods import Method, Outcome
from tetlux.cases.chart.peers import PEERS, Peer, run_peer
from tetlux.cases.chart.picture import STYLES
from tetlux.cases.chart.planned import PLANNED
from tetlux.cases.chart.reference import Reference
from tetlux.cases.chart.runs import LONGEST_RUN, SLOW_START, Measurement, exponents, measure_methods
from tetlux.cases.chart.samples import Samples, relative_error, surface_samples
from tetlux.cases.chart.statistics import fit_exponent, pareto_front
from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.cases.shipped import find_case_file
from tetlux.fem import solve
from tetlux.fem.exact import layered_ball, slab, sphere, sphere_light
from tetlux.fem.exact.checks import Face
from tetlux.meshing import RunError, Surface, box, tetrahedralize

NO_LIGHT = (np.zeros((0, 3)), np.zeros(0))
BY_NAME = {method.name: method for method in (*MESHLESS, *FINITE_ELEMENTS, MONTE_CARLO)}


@pytest.fixture(scope="module")
def ball_benchmark() -> Benchmark:
    return prepare_benchmark(load_cases(find_case_file("sphere"))[0], quick=True)


def few(benchmark: Benchmark, count: int = 50) -> Benchmark:
    """A benchmark with a few samples, for methods whose values do not matter."""
    samples = Samples(
        *(np.asarray(getattr(benchmark.samples, name))[:count] for name in ("points", "normals", "weights"))
    )
    return replace(benchmark, samples=samples, reference=replace(benchmark.reference, exitance=np.ones(count)))


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "chart.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


# Measures


def test_samples_stand_for_the_whole_surface() -> None:
    body = box((4.0, 3.0, 2.0))
    points, normals, weights = surface_samples(body, *NO_LIGHT)
    assert weights.sum() == pytest.approx(body.area, rel=1e-12)
    assert (weights > 0).all()
    # By Gauss's theorem: 3 V, twice the first moment, 0.
    assert weights @ (points * normals).sum(axis=1) == pytest.approx(3.0 * body.volume, rel=1e-12)
    # A rule of degree 2: x² on the faces x = ±2 is 4, on the others 16/3 in the mean over the length of 4, by 3.
    assert weights @ points[:, 0] ** 2 == pytest.approx(2 * 6.0 * 4.0 + 2 * (12.0 + 8.0) * 4.0 / 3.0, rel=1e-12)


def test_samples_are_dense_where_light_is() -> None:
    """Dense enough to integrate what falls from a source like the dipole's own 1/r³, with its square."""
    body, depth = box((40.0, 40.0, 20.0)), 1.0
    source = np.array([[0.0, 0.0, 10.0 - depth]])
    points, normals, weights = surface_samples(body, source, np.array([depth]))
    top = normals[:, 2] > 0.5
    rho = np.hypot(points[top, 0], points[top, 1])
    inside = rho < 15.0
    # ∫ (rho² + 1)^-3 over a disc of radius R is pi/2 (1 - (R² + 1)^-2).
    summed = weights[top][inside] @ (rho[inside] ** 2 + depth**2) ** -3.0
    assert summed == pytest.approx(0.5 * math.pi, rel=2e-3)
    assert (rho < 2.0).sum() > 2 * (rho > 10.0).sum() / 100
    assert np.sqrt(weights[top][rho < 1.0].max()) < 0.25 * depth


def test_a_known_perturbation_is_the_error() -> None:
    rng = np.random.default_rng(0)
    truth, weights = rng.uniform(1.0, 2.0, 200), rng.uniform(0.5, 1.5, 200)
    assert relative_error(1.03 * truth, truth, weights) == pytest.approx(0.03, rel=1e-12)
    off = truth.copy()
    off[7] += 0.4
    expected = math.sqrt(weights[7] * 0.4**2 / (weights * truth**2).sum())
    assert relative_error(off, truth, weights) == pytest.approx(expected, rel=1e-12)
    assert relative_error(off, truth, 3.0 * weights) == pytest.approx(expected, rel=1e-12)


def test_the_front_is_what_nothing_beats() -> None:
    seconds = [1.0, 2.0, 3.0, 2.0, 1.0, 4.0]
    errors = [0.5, 0.2, 0.3, 0.1, 0.6, 0.1]
    assert pareto_front(seconds, errors).tolist() == [True, False, False, True, False, False]
    assert pareto_front([], []).tolist() == []


def test_exponents_are_fitted_to_three_runs_or_more() -> None:
    x = [100.0, 1000.0, 20000.0]
    assert fit_exponent(x, [3.0 * value**-0.7 for value in x]) == pytest.approx(-0.7, abs=1e-12)
    assert fit_exponent(x[:2], [1.0, 2.0]) is None
    assert fit_exponent([5.0] * 3, [1.0, 2.0, 3.0]) is None
    assert fit_exponent(x, [1.0, 0.0, 2.0]) is None


# Benchmarks


def test_the_sphere_is_measured_on_the_true_sphere(ball_benchmark: Benchmark) -> None:
    """Power that leaves, by the samples and by the closed form."""
    points, weights = ball_benchmark.samples.points, ball_benchmark.samples.weights
    assert np.allclose(np.linalg.norm(points, axis=1), 10.0, rtol=1e-12)
    # The triangles' own area is 0.12 % less.
    assert weights.sum() == pytest.approx(400.0 * math.pi, rel=1e-6)
    ((source, power),) = ball_benchmark.sources
    total = power * sphere.point_total(TISSUE, radius=10.0, source_radius=float(np.linalg.norm(source)))
    assert weights @ ball_benchmark.reference.exitance == pytest.approx(total, rel=1e-4)
    assert ball_benchmark.reference.kind == "closed form"


def test_the_slab_is_measured_on_both_faces() -> None:
    benchmark = prepare_benchmark(load_cases(find_case_file("slab"))[0], quick=True)
    ((source, power),) = benchmark.sources
    emitted = benchmark.samples.weights * benchmark.reference.exitance
    front = benchmark.samples.normals[:, 2] > 0
    assert np.allclose(benchmark.samples.points[:, 2], np.where(front, 0.0, -10.0), atol=1e-9)
    depth = -float(source[2])
    sides: list[tuple[np.ndarray, Face]] = [(front, "front"), (~front, "back")]
    for side, face in sides:
        total = power * slab.point_total(TISSUE, thickness=10.0, depth=depth, face=face)
        # The rest leaves beyond the samples: 0.09 % of the front's, 0.56 % of the back's.
        assert 0.993 * total < emitted[side].sum() < total


def test_without_a_closed_form_the_reference_is_a_finer_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference, "QUICK_TOLERANCES", (0.1,))
    (tmp_path / "block.yaml").write_text(
        "surface: {box: {size: [10, 10, 10]}}\n"
        "medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}\n"
        "lights:\n  - diffuse: {irradiance: 1.0}\n"
    )
    benchmark = prepare_benchmark(load_cases(tmp_path / "block.yaml")[0], quick=True)
    assert benchmark.reference.kind == "finer run"
    assert benchmark.reference.description.startswith("tetlux itself on ")
    assert 0 < benchmark.reference.error <= 0.1
    assert benchmark.samples.weights.sum() == pytest.approx(600.0, rel=1e-12)
    # Diffuse light is deposited in no point: what needs one does not do this benchmark.
    fitting = {name for name, method in BY_NAME.items() if method.fits(benchmark)}
    assert fitting == {"P1, uniform", "P1, adaptive", OURS}
    assert not any(method.fits(benchmark) for peer in PEERS for method in peer.methods)


def benchmark_of(name: str, *, readings: bool) -> Benchmark:
    (case,) = load_cases(find_case_file(name))
    return (prepare_readings_benchmark if readings else prepare_benchmark)(case, quick=True)


def test_a_beam_on_an_index_matched_ball_has_a_closed_form() -> None:
    benchmark = benchmark_of("daylight", readings=False)
    assert benchmark.reference.kind == "closed form"
    points, exitance = benchmark.samples.points[::500], benchmark.reference.exitance[::500]
    truth = sphere_light.beam_exitance(benchmark.case.medium, radius=10.0, gamma=np.arccos(points[:, 2] / 10.0))
    assert exitance == pytest.approx(truth, rel=1e-9)
    fitting = {name for name, method in BY_NAME.items() if method.fits(benchmark)}
    assert {"P1, uniform", "P1, adaptive", OURS} <= fitting


def test_readings_of_a_head_are_held_against_its_series() -> None:
    benchmark = benchmark_of("head", readings=True)
    media = [benchmark.case.medium, *(region.medium for region in benchmark.regions)]
    gamma = np.arccos(benchmark.samples.points[:, 2] / 36.8)
    ((source, power),) = benchmark.sources
    truth = power * layered_ball.point_exitance(
        media[::-1],  # type: ignore[arg-type]
        (31.2, 32.0, 34.8, 36.8),
        source_radius=float(source[2]),
        gamma=gamma,
    )
    assert benchmark.reference.exitance == pytest.approx(truth, rel=1e-6)
    # The detectors are 20 to 40 mean free paths from the light.
    away = np.linalg.norm(benchmark.samples.points - [0.0, 0.0, 36.8], axis=1) / benchmark.case.medium.mean_free_path
    assert (away.min(), away.max()) == pytest.approx((20.0, 40.0), rel=1e-3)


def test_the_error_of_readings_is_their_median() -> None:
    benchmark = benchmark_of("fibres", readings=True)
    assert benchmark.reference.kind == "closed form"
    assert benchmark.quantity == "median relative error of readings"
    factors = np.ones(11)
    factors[:6] = 1.07
    factors[6] = 100.0
    assert benchmark.error_of(factors * benchmark.reference.exitance) == pytest.approx(0.07)
    ours = next(method for method in READING_METHODS if method.name == OURS)
    outcome = ours.run(benchmark, 0.1)
    # Measured .0004; linear elements at the same tolerance are off by .25.
    assert benchmark.error_of(outcome.exitance) < 0.02
    assert outcome.estimate is not None
    assert outcome.estimate < 0.1
    assert CHARGES.fits(benchmark)


@pytest.fixture
def dark_core(tmp_path: Path) -> Benchmark:
    """A ball with a dark core, and two detectors."""
    (tmp_path / "core.yaml").write_text(
        "surface: {sphere: {radius: 4}}\n"
        "medium: {sigma_a: 0.02, sigma_s_prime: 1.0, eta: 1.4}\n"
        "regions:\n"
        "  - surface: {sphere: {radius: 2}}\n"
        "    medium: {sigma_a: 0.6, sigma_s_prime: 1.5, eta: 1.4}\n"
        "lights:\n  - point: {position: [0, 0, 3]}\n"
        "detectors:\n  - {name: a, point: [0, 0, -4]}\n  - {name: b, point: [0, 4, 0]}\n"
    )
    return prepare_readings_benchmark(load_cases(tmp_path / "core.yaml")[0], quick=True)


def test_regions_reach_the_methods_of_readings(dark_core: Benchmark) -> None:
    """Without the core, readings behind it would be off by a factor."""
    assert dark_core.reference.kind == "closed form"
    by_name = {method.name: method for method in READING_METHODS}
    for method in (CHARGES, by_name["P1, graded"], by_name[OURS]):
        error = dark_core.error_of(method.run(dark_core, method.values[0]).exitance)
        # Measured .0009 to .032; without the region 2.9.
        assert error < 0.3, method.name


def test_tolerances_below_the_reference_are_left_out(ball_benchmark: Benchmark) -> None:
    rough = replace(
        ball_benchmark, reference=Reference("finer run", "", ball_benchmark.reference.exitance, error=0.004)
    )
    assert BY_NAME[OURS].values_for(ball_benchmark) == BY_NAME[OURS].values
    assert BY_NAME[OURS].values_for(rough) == (0.05, 0.02)
    assert BY_NAME["P1, uniform"].values_for(rough) == BY_NAME["P1, uniform"].values


# Methods


def test_closed_forms_of_the_half_space_on_the_sphere(ball_benchmark: Benchmark) -> None:
    """Both differ from the sphere's own closed form by what the curvature does, and the dipole by its boundary."""
    forms = [method for method in MESHLESS if not method.parameter]
    errors = {form.name: ball_benchmark.error_of(form.run(ball_benchmark, 0.0).exitance) for form in forms}
    assert errors["dipole alone"] == pytest.approx(0.402, abs=0.01)
    assert errors["half-space alone"] == pytest.approx(0.113, abs=0.005)


def test_tetlux_meets_its_tolerance_on_the_sphere(ball_benchmark: Benchmark) -> None:
    outcome = BY_NAME[OURS].run(ball_benchmark, 0.02)
    assert 0.0001 < ball_benchmark.error_of(outcome.exitance) < 0.02
    assert outcome.estimate is not None
    assert outcome.estimate <= 0.02
    assert outcome.unknowns is not None
    assert outcome.tetrahedra is not None
    assert 300 < outcome.unknowns < outcome.tetrahedra


def test_charges_meet_their_tolerance_on_the_sphere(ball_benchmark: Benchmark) -> None:
    method = BY_NAME["charges"]
    assert method.fits(ball_benchmark)
    outcome = method.run(ball_benchmark, 0.005)
    assert ball_benchmark.error_of(outcome.exitance) < 0.005
    assert outcome.tetrahedra is None
    assert outcome.unknowns is not None
    assert 50 < outcome.unknowns < 500


def test_monte_carlo_sees_the_same_power(ball_benchmark: Benchmark) -> None:
    """Transfer and diffusion differ near the source by a third, in all that leaves by little."""
    outcome = MONTE_CARLO.run(ball_benchmark, 50_000)
    assert 0.3 < ball_benchmark.error_of(outcome.exitance) < 0.45
    weights = ball_benchmark.samples.weights
    # Two runs of 50,000 and 1,000,000: 1.033.
    assert weights @ outcome.exitance == pytest.approx(weights @ ball_benchmark.reference.exitance, rel=0.06)


def fake(name: str, seconds: list[float], off: list[float], *, comparable: bool = True) -> Method:
    """A method that takes so long and errs by so much."""

    def run(benchmark: Benchmark, value: float) -> Outcome:
        index = int(value)
        if math.isnan(off[index]):
            raise RunError("the mesher failed.")
        return Outcome((1.0 + off[index]) * benchmark.reference.exitance, seconds[index], 10 * (index + 1), 40)

    return Method(name, "step", tuple(map(float, range(len(seconds)))), run, comparable=comparable, quick=1)


def test_runs_go_from_coarse_to_fine_until_one_is_too_long(ball_benchmark: Benchmark) -> None:
    methods = [
        fake("slow", [5.0, 4.9 + LONGEST_RUN, 5.1 + LONGEST_RUN, 1.0], [0.6, 0.5, 0.1, 0.0]),
        fake("slow at once", [1.1 * SLOW_START, 1.0], [0.5, 0.0]),
        fake("broken", [1.0, 2.0, 3.0], [0.4, math.nan, 0.2]),
        fake("other model", [1e-3], [0.01], comparable=False),
    ]
    lines: list[str] = []
    runs = measure_methods(few(ball_benchmark), methods, quick=False, report=lines.append)
    assert [(run.method, run.parameter, run.on_front) for run in runs] == [
        ("slow", "step=0", False),
        ("slow", "step=1", False),
        ("slow", "step=2", True),
        ("slow at once", "step=0", False),
        ("broken", "step=0", True),
        ("broken", "step=2", True),
        ("other model", "step=0", None),
    ]
    assert [run.error for run in runs] == pytest.approx([0.6, 0.5, 0.1, 0.5, 0.4, 0.2, 0.01])
    assert "  broken step=1: failed: the mesher failed." in lines
    assert [run.method for run in measure_methods(few(ball_benchmark), methods, quick=True, report=lines.append)] == [
        "slow",
        "slow at once",
        "broken",
        "other model",
    ]


def test_exponents_by_method() -> None:
    def row(n: int) -> Measurement:
        return Measurement("c", "m", "", 1e-3 * n**1.2, n, 5 * n, 2.0 * n**-0.5, None, False, "closed form")

    plain = replace(row(1), method="dipole alone", unknowns=None)
    found = exponents([row(100), row(1000), row(5000), plain])
    assert found["m"] == pytest.approx({"error": -0.5, "seconds": 1.2})
    assert found["dipole alone"] == {"error": None, "seconds": None}


def test_every_method_has_a_look() -> None:
    assert {*BY_NAME, PLANNED.name, *(method.name for peer in PEERS for method in peer.methods)} == set(STYLES)
    assert len({(look.color, look.marker) for look in STYLES.values()}) == len(STYLES)


# Peers


def test_peers_are_never_imported_here() -> None:
    """redbirdpy is under the GPL: the program that imports it imports nothing of tetlux, nor is it imported."""
    assert not {"ngsolve", "netgen", "redbirdpy"} & set(sys.modules)
    scripts = 0
    for package in (meshing, fem, cases):
        assert package.__file__ is not None
        for path in Path(package.__file__).parent.rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            imports = re.findall(r"^\s*(?:from|import) ([\w.]+)", text, re.MULTILINE)
            assert not any("_peer_" in name for name in imports), path
            if "redbirdpy" in imports:
                scripts += 1
                assert not any(name.startswith("tetlux") for name in imports), path
    assert scripts == 1


def test_a_peer_that_fails_is_an_error_of_one_line() -> None:
    with pytest.raises(RunError, match="can't open file"):
        run_peer("_peer_of_nobody.py", {"points": np.zeros(3)})
    with pytest.raises(RunError, match=r"KeyError|No module named") as failure:
        run_peer("_peer_redbird.py", {"points": np.zeros(3)})
    assert "\n" not in str(failure.value)


def installed(package: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    return pytest.mark.skipif(importlib.util.find_spec(package) is None, reason=f"{package} is not installed")


@installed("ngsolve")
def test_ngsolve_on_the_exact_sphere(ball_benchmark: Benchmark) -> None:
    third = next(m for peer in PEERS for m in peer.methods if m.name == "NGSolve P3")
    outcome = third.run(ball_benchmark, 0.5)
    # Five runs: 0.0055 to 0.0065.
    assert 0.002 < ball_benchmark.error_of(outcome.exitance) < 0.01


@installed("ngsolve")
def test_ngsolve_on_nested_spheres(dark_core: Benchmark) -> None:
    third = next(m for peer in PEERS for m in peer.methods if m.name == "NGSolve P3")
    assert third.fits(dark_core)
    # Measured .033; without the core 2.9.
    assert dark_core.error_of(third.run(dark_core, 0.5).exitance) < 0.1


@installed("redbirdpy")
def test_redbirdpy_on_a_mesh_with_a_region(dark_core: Benchmark) -> None:
    redbird = next(m for peer in PEERS for m in peer.methods if m.name == "redbirdpy P1")
    # Measured .05; without the core 2.9.
    assert dark_core.error_of(redbird.run(dark_core, 1.0).exitance) < 0.3


@installed("redbirdpy")
def test_redbirdpy_solves_the_same_system(ball_benchmark: Benchmark) -> None:
    """Linear elements with consistent masses on one mesh are one answer, whoever finds it."""
    case = ball_benchmark.case
    mesh = tetrahedralize(case.surface)
    ours = solve(case.surface, case.medium, case.lights, mesh=mesh, mass="consistent", subtract="nothing")
    source, power = ball_benchmark.sources[0]
    theirs = run_peer(
        "_peer_redbird.py",
        {
            "nodes": mesh.points,
            "tetrahedra": mesh.tetrahedra,
            "regions": mesh.regions,
            "diffusion": np.array([case.medium.diffusion]),
            "sigma_a": np.array([case.medium.sigma_a]),
            "robin": 1.0 / (2.0 * case.medium.boundary_factor),
            "eta": case.medium.eta,
            "points": source[None],
            "powers": np.array([power]),
            "repeats": 1,
            "repeat_seconds": 0.0,
        },
    )
    assert np.allclose(theirs["fluence"], ours.fluence, rtol=1e-5, atol=1e-9 * ours.fluence.max())


# The command

LITTLE = (
    fake("half-space alone", [0.01], [0.2]),
    fake(OURS, [0.5, 1.0], [0.02, 0.005]),
    fake("P1, graded", [2.0], [0.1]),
)
ABSENT = (Peer("NGSolve", "no_such_package", ()),)


@pytest.fixture
def little(monkeypatch: pytest.MonkeyPatch) -> None:
    """A chart of methods that take no time."""
    monkeypatch.setattr(chart_module, "PLANNED", fake(PLANNED.name, [0.01], [1e-13], comparable=False))
    monkeypatch.setattr(chart_module, "MESHLESS", LITTLE[:1])
    monkeypatch.setattr(chart_module, "FINITE_ELEMENTS", LITTLE[1:])
    monkeypatch.setattr(chart_module, "PEERS", ABSENT)
    monkeypatch.setattr(chart_module, "has_monte_carlo", lambda: False)
    monkeypatch.setattr(chart_module, "_warm_up", lambda: None)


@pytest.mark.usefixtures("little")
def test_a_chart_is_three_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["chart", "sphere", "slab", "--out", str(tmp_path / "out")]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["chart.csv", "chart.json", "chart.png"]
    rows = table(tmp_path / "out")
    columns = "case,method,parameter,seconds,unknowns,tetrahedra,error,estimate,on_front,reference"
    assert ",".join(rows[0]) == columns
    assert [(row["case"], row["method"]) for row in rows[:4]] == [
        ("sphere", "half-space alone"),
        ("sphere", OURS),
        ("sphere", OURS),
        ("sphere", "P1, graded"),
    ]
    assert [float(row["error"]) for row in rows[:4]] == pytest.approx([0.2, 0.02, 0.005, 0.1])
    assert [row["on_front"] for row in rows[:4]] == ["True", "True", "True", "False"]
    data = json.loads((tmp_path / "out" / "chart.json").read_text())
    assert len(data["runs"]) == len(rows) == 10
    assert data["runs"][2]["error"] == pytest.approx(0.005)
    assert data["cases"]["slab"]["reference"]["kind"] == "closed form"
    assert data["cases"]["slab"]["exponents"][OURS] == {"error": None, "seconds": None}
    assert data["machine"]["cores"] >= 1
    assert {"python", "tetlux", "numpy"} <= set(data["versions"])
    picture = np.asarray(Image.open(tmp_path / "out" / "chart.png").convert("RGB")).astype(int)
    assert picture.shape[1] == 2000
    for name in (OURS, "P1, graded", PLANNED.name):
        color = [int(STYLES[name].color[i : i + 2], 16) for i in (1, 3, 5)]
        assert (np.abs(picture - color).max(axis=2) < 8).sum() > 300, name
    said = capsys.readouterr().out
    assert 'NGSolve is left out, since it is not installed; pip install "tetlux[peers]" installs it.' in said
    assert (
        'Monte Carlo is left out, since numba is not installed; pip install "tetlux[montecarlo]" installs it.' in said
    )


def test_the_plan_is_a_line_of_the_chart(ball_benchmark: Benchmark) -> None:
    """On a ball it takes the series, which is the reference; what it takes contains the planning."""
    outcome = PLANNED.run(ball_benchmark, 0.02)
    assert ball_benchmark.error_of(outcome.exitance) < 1e-9
    assert outcome.unknowns is None
    assert 0.0 < outcome.seconds < 2.0
    assert PLANNED in chart_module._methods(lambda _: None, readings=False)


@pytest.mark.usefixtures("little")
def test_a_chart_of_readings_has_files_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(chart_module, "CHARGES_FOR_READINGS", fake("charges", [0.1], [0.3]))
    monkeypatch.setattr(chart_module, "READING_METHODS", LITTLE[1:])
    assert main(["chart", "--readings", "fibres", "--out", str(tmp_path)]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"chart-readings.{x}" for x in ("csv", "json", "png")]
    data = json.loads((tmp_path / "chart-readings.json").read_text())
    assert [run["method"] for run in data["runs"]] == ["charges", OURS, OURS, "P1, graded"]
    assert data["runs"][0]["error"] == pytest.approx(0.3)
    assert data["error"].startswith("median relative error of readings")
    assert "fibres: 11 detectors; the reference is " in capsys.readouterr().out
    assert main(["chart", "--readings", "sphere", "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err == (
        "tetlux: sphere failed: a chart of readings needs detectors that are points; give some, and no others.\n"
    )


@pytest.mark.usefixtures("little")
def test_a_chart_that_cannot_be_written_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "chart.csv").write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files, "draw_chart", full)
    assert main(["chart", "sphere", "--out", str(tmp_path)]) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["chart.csv"]
    assert (tmp_path / "chart.csv").read_text() == "old"
    assert capsys.readouterr().err == (
        f"tetlux: sphere failed: results cannot be written to {tmp_path}: No space left on device; "
        "make room, or choose another folder with --out.\n"
    )


@pytest.mark.usefixtures("little")
def test_a_case_that_fails_does_not_take_the_others_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def failing(*_: object, **__: object) -> Reference:
        raise RunError("the mesher failed.")

    monkeypatch.setattr(chart_benchmark, "finer_run_reference", failing)
    assert main(["chart", "torus", "sphere", "--out", str(tmp_path)]) == 1
    assert {row["case"] for row in table(tmp_path)} == {"sphere"}
    assert capsys.readouterr().err == "tetlux: torus failed: the mesher failed.\n"


SWEEP = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - point: {position: [0, 0, 9]}
sweep: {medium.sigma_a: [0.01, 0.1]}
"""


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["ball"],
            'ball: did you mean "sphere"? it is neither a file nor one of the shipped cases: '
            "candle, daylight, fibres, finger, finger-fit, hare, head, inclusion, laser, marble, slab, sphere, torus.",
        ),
        (["sweep.yaml"], "sweep.yaml has a sweep, but a chart takes single scenes; leave sweep out."),
        (
            ["sphere", "--out", "sweep.yaml"],
            "results cannot be written to sweep.yaml: Not a directory; choose another folder with --out.",
        ),
    ],
)
def test_a_wrong_request_is_one_sentence(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sweep.yaml").write_text(SWEEP)
    assert main(["chart", *arguments]) == 2
    assert capsys.readouterr().err == f"tetlux: {said}\n"
    assert [path.name for path in tmp_path.iterdir()] == ["sweep.yaml"]


def test_nothing_is_remembered_from_run_to_run(ball_benchmark: Benchmark, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that found what an earlier one had prepared would be timed too short."""
    seen: list[tuple[set[str], object]] = []

    def stopped(surface: Surface, *_: object, cache: bool = True, **__: object) -> None:
        seen.append((set(vars(surface)), cache))
        raise RunError("seen")

    monkeypatch.setattr(finite_elements, "tetrahedralize", stopped)
    monkeypatch.setattr(finite_elements, "solve", stopped)
    redbird = next(m for peer in PEERS for m in peer.methods if m.name == "redbirdpy P1")
    assert ball_benchmark.case.surface.diagonal > 0
    for name in ("P1, uniform", "P1, adaptive", "free-space subtracted, adaptive", OURS):
        with pytest.raises(RunError, match="seen"):
            BY_NAME[name].run(ball_benchmark, 0.0)
    with pytest.raises(RunError, match="seen"):
        redbird.run(ball_benchmark, 1.0)
    assert seen == [({field.name for field in fields(Surface)}, False)] * 5
