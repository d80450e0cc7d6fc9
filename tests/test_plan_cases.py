"""Plans of case files: ``model: auto``, ``tetlux plan``, the summary, and batches."""

import json
from pathlib import Path
from typing import Any

import pytest

from tetlux.cases.batch.grouping import make_plan
from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.cases.file.reader import FilesRead
from tetlux.cases.planning import plan_groups, plan_models
from tetlux.cases.run import run_case

BALL = "surface: {sphere: {radius: 10}}"
SLAB = "surface: {slab: {width: 40, depth: 10}}"
MEDIUM = "medium: {sigma_a: 0.02, sigma_s_prime: 1.0, eta: 1.4}"
BEAM = "lights: [{pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 1.0}}]"
SUN = "lights: [{collimated: {direction: [0, 0, -1], irradiance: 1.0}}]"
AUTO = "model: auto"


def write(folder: Path, *lines: str, name: str = "scene") -> Path:
    path = folder / f"{name}.yaml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def summary_of(path: Path, out: Path) -> tuple[dict[str, Any], list[str]]:
    (case,) = load_cases(path)
    said: list[str] = []
    folder = run_case(case, out, said.append)
    return json.loads((folder / "summary.json").read_text(encoding="utf-8")), said


def test_a_ball_is_solved_by_its_series(tmp_path: Path) -> None:
    path = write(
        tmp_path, BALL, MEDIUM, BEAM, AUTO, "outputs: [surface]", "detectors: [{name: side, point: [0, 10, 0]}]"
    )
    summary, said = summary_of(path, tmp_path / "out")
    assert summary["model"] == summary["plan"]["chosen"] == "closed-form"
    assert "mesh" not in summary
    assert summary["left_out"]["mesh"] == "model closed-form makes none; write model: full"
    assert set(summary["left_out"]) == {"mesh", "fluence", "validity"}
    assert [each["model"] for each in summary["plan"]["candidates"]] == ["closed-form", "charges", "truncated", "full"]
    assert summary["plan"]["measured"]["error"] == summary["channels"][0]["error_estimate"] < 1e-9
    assert 0.0 < summary["plan"]["measured"]["seconds"] < summary["seconds"]["total"]
    assert 0.0 < summary["detectors"][0]["relative_error"] < 1e-8
    assert (tmp_path / "out" / "scene" / "surface.ply").is_file()
    printed = [line for line in said if line.startswith(("plan: closed-form", "  "))]
    assert len(printed) <= 6
    assert any("diffusion itself is off by about" in line for line in printed)


def test_the_volume_needs_a_mesh(tmp_path: Path) -> None:
    path = write(tmp_path, BALL, MEDIUM, BEAM, AUTO, "outputs: [volume]", "tolerance: 0.05")
    summary, _ = summary_of(path, tmp_path / "out")
    assert summary["model"] == "fem"
    assert summary["plan"]["chosen"] == "full"
    assert "left_out" not in summary
    assert "volume" in summary["plan"]["candidates"][0]["reason"]


def test_a_closed_form_can_be_named(tmp_path: Path) -> None:
    path = write(tmp_path, BALL, MEDIUM, BEAM, "model: closed-form", "outputs: []")
    summary, _ = summary_of(path, tmp_path / "out")
    assert summary["model"] == "closed-form"
    assert "plan" not in summary
    assert summary["channels"][0]["closed_form"]["name"] == "exact series of a ball"


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        (
            [BALL, MEDIUM, SUN, "model: closed-form"],
            "line 4: model: there is no closed form for beams along lines, spots, or light that is not uniform; write "
            "model: auto, or full.",
        ),
        (
            [BALL, MEDIUM, BEAM, "model: closed-form", "outputs: [volume]"],
            'volume needs finite elements, which model "closed-form" does not use; leave it out, or write model: full',
        ),
        (
            [BALL, MEDIUM, BEAM, "model: closed-form", "tolerance: {exitance: 0.1, everywhere: 0.1}"],
            'tolerance.everywhere is for finite elements, not for model "closed-form"; leave it out',
        ),
        ([BALL, MEDIUM, BEAM, "model: quick"], "model: "),
    ],
)
def test_what_has_no_closed_form_is_refused(
    lines: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(write(tmp_path, *lines))]) == 2
    assert sentence in capsys.readouterr().err


def test_the_command_prints_a_plan_for_each_group(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = write(tmp_path, BALL, MEDIUM, BEAM, AUTO, "sweep: {medium.sigma_a: [0.01, 0.02, 0.03]}")
    second = write(tmp_path, BALL, MEDIUM, SUN, name="sun")
    third = write(tmp_path, BALL, MEDIUM, BEAM, name="meshed", *["model: full"])  # noqa: B026
    assert main(["plan", str(first), str(second), str(third)]) == 0
    printed = capsys.readouterr().out
    heads = [line for line in printed.splitlines() if not line.startswith("  ")]
    assert heads == [
        "scene/medium.sigma_a=0.01 and 2 others: plan: closed-form for a tolerance of 0.02, for each of 3 runs",
        "sun: plan: full for a tolerance of 0.02",
        "meshed: plan: closed-form for a tolerance of 0.02",
    ]
    assert printed.splitlines()[-1] == "  the case names model full, which is taken"


def test_runs_of_a_group_share_one_plan(tmp_path: Path) -> None:
    sweep = "sweep: {medium.sigma_a: {start: 0.01, stop: 0.02, num: 8}}"
    meshed = write(tmp_path, BALL, MEDIUM, SUN, AUTO, sweep, name="meshed")
    series = write(tmp_path, BALL, MEDIUM, BEAM, AUTO, sweep, name="series")
    cases = plan_models([*load_cases(meshed), *load_cases(series)])
    plans = {id(case.plan): case.plan for case in cases}
    assert [(plan.chosen, plan.runs) for plan in plans.values() if plan] == [("full", 8), ("closed-form", 8)]
    # Runs that are planned to be meshed share a mesh, the others make none.
    assert sorted((mesh.runs, bool(mesh.pilots)) for mesh in make_plan(cases).meshes) == [(1, False)] * 8 + [(8, True)]


def test_runs_with_and_without_dyes_have_plans_of_their_own(tmp_path: Path) -> None:
    """Both have two channels, with media and lights of the same kinds, on one surface."""
    lamp = "lights: [{point: {position: [0, 0, 8]}}]"
    two = write(tmp_path, BALL, "medium: {sigma_a: [0.02, 0.03], sigma_s_prime: 1.0, eta: 1.4}", lamp, name="two")
    dye = "dyes: [{absorption: 0.001, quantum_yield: 0.5}]"
    emission = f"fluorescence: {{emission: {{sigma_a: 0.02, sigma_s_prime: 0.9, eta: 1.4}}, {dye}}}"
    dyed = write(tmp_path, BALL, MEDIUM, lamp, emission, name="dyed")
    files = FilesRead()
    cases = [case for path in (two, dyed) for case in load_cases(path, files)]
    assert cases[0].surface is cases[1].surface
    assert [(case.name, plan.chosen) for case, plan in plan_groups(cases)] == [("two", "closed-form"), ("dyed", "full")]


def test_a_run_that_the_plan_of_its_group_does_not_suit_goes_on(tmp_path: Path) -> None:
    """The series of this slab suits a dark medium, and misses the tolerance in a bright one."""
    sweep = "sweep: {medium.sigma_a: [0.1, 0.0001]}"
    path = write(tmp_path, SLAB, MEDIUM, BEAM, AUTO, "outputs: []", "tolerance: 0.001", sweep)
    dark, bright = plan_models(load_cases(path))
    assert dark.plan is bright.plan
    assert dark.plan is not None
    assert dark.plan.chosen == "closed-form"
    said: list[str] = []
    folder = run_case(bright, tmp_path / "out", said.append)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["model"] == "charges"
    assert summary["channels"][0]["error_estimate"] <= 0.001
    assert any("ends too near the light: going on with charges" in line for line in said)
