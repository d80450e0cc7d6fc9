"""`tetlux stress`: what it drives, what it measures, what counts as a violation, and what it writes."""

import csv
import ctypes
import math
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tetlux.cases.cli import main
from tetlux.cases.stress import command as stress_module
from tetlux.cases.stress.command import COLUMNS, FILES, stress
from tetlux.cases.stress.grid import PANELS
from tetlux.cases.stress.measure import Diagnostics, measure
from tetlux.cases.stress.panels import (
    CHARGES,
    CONSISTENT,
    DEFAULT,
    NOT_REFINED,
    NOTHING,
    PLANNED,
    TRUNCATED,
    Axis,
    Panel,
    Value,
    Variant,
)
from tetlux.cases.stress.report import as_markdown
from tetlux.cases.stress.rules import broken_rules, violations
from tetlux.cases.stress.scenes import of_modes, of_plans, of_points, scenarios
from tetlux.cases.stress.scenes.meshes import degrade, layered_ball
from tetlux.cases.stress.scenes.scenarios import Scenario
from tetlux.cases.stress.trials import Trial
from tetlux.fem.linear import direct, krylov
from tetlux.fem.linear import solver as linear
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.notes import Note

GOOD = Diagnostics(
    lowest=0.1,
    overshoot=None,
    ledger=1e-15,
    residual=1e-14,
    iterations=0,
    estimate=0.01,
    error=0.01,
    scaling=None,
    finite=True,
    may_be_negative=False,
    nodes=100,
    seconds=0.1,
    warnings=(),
)
OF_MODEL = Note("low-albedo", "the reduced albedo is 0.5, below the 0.9 that diffusion is good for.")
NOT_MET = Note("tolerance-missed", "the tolerance of 0.05 was not met: the estimated error is 0.2, on the mesh given.")


def panel(make: Callable[..., Any], x: Value, y: Value, *variants: Variant, name: str = "stub") -> Panel:
    return Panel(name, "a stub", Axis("x", (x,)), Axis("y", (y,)), make, variants or (DEFAULT,))


def run_of(diagnostics: Diagnostics, variant: Variant = DEFAULT) -> Trial:
    return Trial(panel(max, 1.0, 2.0, variant), 1.0, 2.0, variant, "ran", "", diagnostics)


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "stress.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


# What is driven


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("reduced albedo", 1e-3, 1.0),
        ("σ_tr h", 0.01, 1000.0),
        ("refractive index n", 0.5, 4.0),
        ("g", -0.9, 0.99),
        ("contrast", 1e-6, 1e6),
        ("depth (mean free paths)", 0.01, 10.0),
        ("thickness (mean free paths)", 0.1, 100.0),
        ("radius (mean free paths)", 0.1, 100.0),
        ("radius (units)", 1e-9, 1e9),
    ],
)
def test_axes_reach_what_is_promised(name: str, low: float, high: float) -> None:
    for panels in (PANELS, [panel.quick() for panel in PANELS]):
        values = [
            value
            for one in panels
            for axis in (one.x, one.y)
            if axis.name.startswith(name)
            for value in axis.values
            if not isinstance(value, str)
        ]
        assert (min(values), max(values)) == (low, high)


def test_bad_tetrahedra_and_hard_shapes_are_among_them() -> None:
    quick = {panel.name: panel.quick() for panel in PANELS}
    assert min(map(float, quick["bad tetrahedra"].y.values)) == 1e-4
    shapes = " ".join(map(str, quick["shapes"].x.values))
    for kind in ("needle", "plate", "touching", "cavity"):
        assert kind in shapes
    kinds = " ".join(map(str, (*quick["charges"].x.values, *quick["charges"].y.values)))
    for kind in ("thin", "edge", "core", "shallow", "albedo 0.5"):
        assert kind in kinds
    assert {"near", "far"} <= set(quick["readings"].y.values)
    variants = {variant.name for panel in PANELS for variant in panel.variants}
    assert {DEFAULT.name, NOT_REFINED.name, CONSISTENT.name, NOTHING.name} <= variants


@pytest.mark.slow
def test_every_panel_makes_its_scenes() -> None:
    """The first of each; those that are refused are refused when they are solved."""
    for one in PANELS:
        x, y = one.quick().places()[0]
        scenario = one.make(x, y)
        if scenario.truth is not None:
            samples, exitance = scenario.truth
            assert len(samples.points) == len(exitance)
            assert np.isfinite(exitance).all()


def test_bad_tetrahedra_are_as_bad_as_asked_for_and_the_same_each_time() -> None:
    good = layered_ball(1.0, 2, 5)
    assert good.quality.min() > 0.3
    mesh = degrade(good, 1e-4)
    assert mesh.quality.min() == pytest.approx(1e-4, rel=0.01)
    assert (mesh.quality < 2e-4).sum() > 20
    assert mesh.volume == pytest.approx(good.volume, rel=1e-12)
    assert np.array_equal(mesh.points, degrade(good, 1e-4).points)


def test_a_core_of_layers_is_a_region_of_its_own() -> None:
    mesh = layered_ball(2.0, 2, 5, core=3)
    radii = np.linalg.norm(mesh.points[mesh.tetrahedra], axis=2)
    assert (radii[mesh.regions == 1] < 1.2 + 1e-9).all()
    assert (radii[mesh.regions == 0].max(axis=1) > 1.2 + 1e-9).all()


# What is measured


def test_a_run_is_measured_against_the_closed_form() -> None:
    diagnostics = measure(scenarios.diffuse_by_decay_and_albedo(1.0, 0.99), DEFAULT)
    assert diagnostics.error is not None
    # Measured .03; twice as much absorption would be .4.
    assert 0.001 < diagnostics.error < 0.1
    assert diagnostics.overshoot is not None
    assert diagnostics.overshoot < 0
    assert diagnostics.ledger is not None
    assert abs(diagnostics.ledger) < 1e-12
    assert diagnostics.residual is not None
    assert 0 < diagnostics.residual < 1e-10


def test_residuals_are_those_of_the_solution(monkeypatch: pytest.MonkeyPatch) -> None:
    """A solver that believes in its answer and is off by a millionth is found out."""

    def sloppy(product: krylov.Product) -> krylov.Method:
        exact = direct.direct(product)

        def solve_once(loads: FloatArray) -> tuple[FloatArray, int]:
            # Loads come with a norm of 1; what is left of them to be mended is not.
            off = np.zeros_like(loads)
            off[:2] = 1e-6 * np.sqrt([[0.5], [0.5]]) * [[1.0], [-1.0]]
            return exact(loads - off) if np.linalg.norm(loads) > 0.5 else (np.zeros_like(loads), 0)

        return solve_once

    for module in ("operators.assembly", "operators.operator"):
        monkeypatch.setattr(f"tetlux.fem.{module}.solver_for", lambda matrix, *_: linear.Solver(matrix, [sloppy]))
    monkeypatch.setattr(linear, "REFUSED", 1e-3)
    diagnostics = measure(scenarios.diffuse_by_decay_and_albedo(1.0, 0.99), DEFAULT)
    assert diagnostics.residual == pytest.approx(1e-6, rel=1e-3)
    assert "residual" in broken_rules(run_of(diagnostics))


def test_a_large_residual_is_a_violation(monkeypatch: pytest.MonkeyPatch) -> None:
    solve_truly = linear.Solver.solve
    monkeypatch.setattr(
        linear.Solver, "solve", lambda self, load: replace(solve_truly(self, load), residual=1e-6, iterations=7)
    )
    diagnostics = measure(scenarios.diffuse_by_decay_and_albedo(1.0, 0.99), DEFAULT)
    assert (diagnostics.residual, diagnostics.iterations) == (1e-6, 7)
    assert "residual" in broken_rules(run_of(diagnostics))


def test_iterations_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    def iterate(matrix: Any, *_: Any) -> linear.Solver:
        return linear.Solver(matrix, [krylov.jacobi])

    for module in ("operators.assembly", "operators.operator"):
        monkeypatch.setattr(f"tetlux.fem.{module}.solver_for", iterate)
    assert 5 < measure(scenarios.diffuse_by_decay_and_albedo(1.0, 0.99), DEFAULT).iterations < 200


def test_charges_are_measured_against_the_closed_form() -> None:
    scenario = of_points.charges_by_body_and_light("box, by an edge", "1 deep")
    found = measure(scenario, CHARGES)
    assert found.error is not None
    assert found.bound is not None
    # Measured .0021, estimate .0042, bound .012.
    assert 1e-4 < found.error < 0.01
    assert found.error < found.bound < 0.1
    assert (found.lowest, found.ledger, found.residual) == (None, None, None)
    assert broken_rules(run_of(found, CHARGES)) == {}
    assert list(violations(run_of(replace(found, bound=0.5 * found.error), CHARGES))) == ["bound"]


def test_a_part_is_measured_where_the_light_is() -> None:
    scenario = of_plans.part_by_body_and_albedo("ball of 300", 0.9)
    found = measure(scenario, TRUNCATED)
    assert found.error is not None
    # Measured .0013, estimate .0012; the whole ball would take a hundred times as many nodes.
    assert 1e-4 < found.error < 0.01
    assert found.nodes < 3000
    assert broken_rules(run_of(found, TRUNCATED)) == {}


def test_the_plan_solves_a_plate_by_its_closed_form() -> None:
    found = measure(of_plans.plan_by_scene_and_albedo("plate, point", 0.99), PLANNED)
    assert (found.nodes, found.ledger, found.lowest) == (0, None, None)
    assert found.error is not None
    assert found.error < 1e-12


def test_the_report_says_the_regret_of_the_plan() -> None:
    trials = [
        run_of(replace(GOOD, seconds=seconds, estimate=estimate), variant)
        for variant, seconds, estimate in ((PLANNED, 3.0, 0.01), (DEFAULT, 2.0, 0.01), (CHARGES, 1.0, 0.2))
    ]
    # Charges are fastest, but miss the tolerance.
    assert "1.50 in the median of 1, 1.50 in the worst" in as_markdown(trials)
    assert "Regret" not in as_markdown(trials[1:])


def test_readings_are_measured_and_a_miss_is_found() -> None:
    scenario = of_points.readings_by_body_and_place("ball", "behind")
    found = measure(scenario, DEFAULT)
    assert found.error is not None
    # Measured .0005, bar .0006.
    assert 1e-5 < found.error < 0.03
    assert 1e-5 < found.estimate < 0.05
    assert broken_rules(run_of(found)) == {}
    assert scenario.readings is not None
    places, truth = scenario.readings
    other = measure(replace(scenario, readings=(places, truth * np.array([1.0, 1.0, 1.2, 1.0]))), DEFAULT)
    assert other.error == pytest.approx(1.0 - 1.0 / 1.2, abs=0.03)
    assert list(violations(run_of(other))) == ["silent error"]


@pytest.mark.parametrize(
    "scenario",
    [
        of_modes.modulated_by_frequency_and_place(0.1, "near"),
        of_modes.modulated_by_wave_number_and_ratio(0.3, 10.0),
        of_modes.sensitivity_by_albedo_and_place(0.99, "near"),
    ],
)
def test_modes_are_measured_and_a_miss_is_found(scenario: Scenario) -> None:
    found = measure(scenario, DEFAULT)
    assert found.of_readings
    assert found.finite
    assert found.error is not None
    assert found.error < 0.01
    assert scenario.readings is not None
    places, truth = scenario.readings
    missed = measure(replace(scenario, readings=(places, truth * 1.2)), DEFAULT)
    (rule,) = broken_rules(Trial(PANELS[0], 0.1, 0.1, DEFAULT, "ran", "", missed))
    assert rule == "silent error"


@pytest.mark.parametrize("kind", scenarios.LENGTH_KINDS[:4])
def test_lengths_are_compared_with_scale_1(kind: str) -> None:
    scenario = scenarios.ball_by_length_and_light(1e3, kind)
    diagnostics = measure(scenario, DEFAULT)
    assert diagnostics.scaling is not None
    assert diagnostics.scaling < 1e-8
    assert scenario.unit_scale is not None
    other = replace(
        scenario, unit_scale=replace(scenario.unit_scale, medium=scenarios.medium_of_albedo(0.98, free_path=0.1))
    )
    assert (measure(other, DEFAULT).scaling or 0.0) > 1e-3


# What counts


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"lowest": -1.1e-12}, "negative fluence"),
        ({"overshoot": 1e-8}, "maximum principle"),
        ({"ledger": -2e-9}, "ledger"),
        ({"residual": 2e-8}, "residual"),
        ({"scaling": 1e-6}, "scaling"),
        ({"error": 0.051}, "silent error"),
        ({"error": math.inf}, "silent error"),
        ({"error": 0.2, "warnings": (OF_MODEL,)}, "silent error"),
        ({"error": 0.06, "estimate": 0.02, "of_readings": True}, "silent error"),
        ({"error": 0.01, "bound": 0.009}, "bound"),
        ({"finite": False}, "not a number"),
        ({"lowest": math.nan}, "not a number"),
    ],
)
def test_what_must_hold_is_named_where_it_does_not(changes: dict[str, Any], rule: str) -> None:
    bad = replace(GOOD, **changes)
    assert list(violations(run_of(bad))) == [rule]
    # Variants that are there to be compared with may break it.
    assert list(broken_rules(run_of(bad, CONSISTENT))) == [rule]
    assert violations(run_of(bad, CONSISTENT)) == {}
    words = as_markdown([run_of(GOOD), run_of(bad)])
    assert f"* stub, default, at x 1, y 2: {rule}" in words


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"lowest": -1e-13},
        {"lowest": -0.1, "may_be_negative": True},
        {"overshoot": 1e-12},
        {"error": None},
        {"error": 0.2, "warnings": (OF_MODEL, NOT_MET)},
        {"error": 0.06, "estimate": 0.04, "of_readings": True},
        {"error": 0.06, "estimate": math.inf, "of_readings": True},
        {"lowest": None, "ledger": None, "residual": None},
    ],
)
def test_what_is_allowed_is_no_violation(changes: dict[str, Any]) -> None:
    assert broken_rules(run_of(replace(GOOD, **changes))) == {}


# What is written


def test_a_map_is_written_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "map"
    grid = [
        panel(scenarios.diffuse_by_decay_and_albedo, 1.0, 0.9, DEFAULT, CONSISTENT, name="fine"),
        panel(scenarios.point_by_radius_and_depth, 0.1, 0.01, name="small"),
    ]
    assert stress(out, panels=grid) == 0
    assert sorted(path.name for path in out.iterdir()) == sorted(FILES)
    rows = table(out)
    assert [(row["panel"], row["method"], row["outcome"]) for row in rows] == [
        ("fine", "default", "ran"),
        ("fine", "consistent mass, no limiter", "ran"),
        ("small", "default", "refused"),
    ]
    assert tuple(rows[0]) == COLUMNS
    assert 0 < float(rows[0]["error"]) < 0.3
    assert "absurdly small" in rows[2]["message"]
    words = (out / "stress.md").read_text(encoding="utf-8")
    assert words in capsys.readouterr().out
    assert "* small, once: sphere is 0.346 mm" in words
    assert "## Violations\n\nNone." in words
    with Image.open(out / "stress.png") as picture:
        assert picture.width == 2125
        picture.load()


@pytest.mark.slow
def test_violations_crashes_and_hangs_fail_the_command_and_end_nothing_else(tmp_path: Path) -> None:
    grid = [
        panel(ctypes.string_at, 1, 8, name="segfault"),
        panel(wait, "", 1000.0, name="endless"),
        panel(divmod, 1.0, 0, name="exception"),
        panel(scenarios.diffuse_by_decay_and_albedo, 10.0, 0.5, replace(CONSISTENT, counts=True), name="negative"),
        panel(scenarios.diffuse_by_decay_and_albedo, 1.0, 0.9, name="fine"),
    ]
    assert stress(tmp_path, panels=grid, time_limit=10.0, report=lambda _: None) == 1
    found = {row["panel"]: row for row in table(tmp_path)}
    assert {name: row["outcome"] for name, row in found.items()} == {
        "segfault": "failed",
        "endless": "failed",
        "exception": "failed",
        "negative": "ran",
        "fine": "ran",
    }
    assert found["segfault"]["message"] == "crashed: the process died of signal 11"
    assert found["endless"]["message"] == "hung: stopped after 10 s"
    assert found["exception"]["message"].startswith("ZeroDivisionError: ")
    assert float(found["negative"]["lowest"]) < -0.01
    assert found["negative"]["broken"].startswith("negative fluence: -")
    assert [name for name, row in found.items() if row["violation"] == "False"] == ["fine"]
    words = (tmp_path / "stress.md").read_text(encoding="utf-8")
    assert "* segfault, default, at x 1, y 8: failure, crashed: the process died of signal 11." in words
    assert "* negative, consistent mass, no limiter: negative fluence in 1 of 1, at x 10 and y 0.5." in words


def test_the_command_asks_for_the_map(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    asked: list[tuple[Path, bool]] = []

    def record(out: Path, *, quick: bool) -> int:
        asked.append((out, quick))
        return 1

    monkeypatch.setattr(stress_module, "stress", record)
    assert main(["stress", "--quick", "--out", str(tmp_path)]) == 1
    assert main(["stress"]) == 1
    assert asked == [(tmp_path, True), (Path("stress"), False)]


def test_a_folder_that_cannot_be_written_to_is_refused_before_it_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    assert main(["stress", "--quick", "--out", str(tmp_path / "file")]) == 2
    assert "tetlux: " in capsys.readouterr().err
