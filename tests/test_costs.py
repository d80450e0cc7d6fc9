"""Predictions of plans are refined by what past runs took."""

import json
import math
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tetlux.fem import DiffuseLight, Medium, PointSource, plan, solve
from tetlux.fem.planner import charges, costs, effort
from tetlux.fem.planner.costs import FILE, LARGEST_FACTOR, Costs, PastRun, read_costs
from tetlux.fem.stopwatch import Stopwatch
from tetlux.meshing import box, sphere
from tetlux.meshing.mesher.api import is_cached

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
CUBE = box((20.0, 20.0, 20.0))
SOURCE = PointSource((0.0, 0.0, 8.0))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache directory from which runs learn."""
    monkeypatch.setenv("TETLUX_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("TETLUX_LEARN", "1")
    return tmp_path


def test_without_past_runs_the_built_in_predictions_hold() -> None:
    assert read_costs().factors("full fitted on box") == (1.0, 1.0)
    assert plan(CUBE, TISSUE, [SOURCE])["full"].learned == (1.0, 1.0)


def test_past_runs_of_a_kind_correct_its_seconds_and_error() -> None:
    before = plan(CUBE, TISSUE, [SOURCE])["full"]
    for _ in range(20):
        read_costs().learn(before.kind, 3.0, 0.25)
    after = plan(CUBE, TISSUE, [SOURCE])["full"]
    assert 2.5 * before.seconds < after.seconds < 3.1 * before.seconds
    assert 0.25 * before.error < after.error < 0.4 * before.error


def test_other_kinds_tell_how_fast_the_machine_is_and_nothing_of_errors() -> None:
    for _ in range(20):
        read_costs().learn("full spot on scan", 3.0, 0.25)
    seconds, error = read_costs().factors("full fitted on box")
    assert 2.5 < seconds < 3.1
    assert error == 1.0


def test_a_kind_that_is_predicted_badly_does_not_tell_of_the_machine() -> None:
    for number in range(9):
        read_costs().learn(f"kind {number}", 1.0 if number % 3 else 8.0, 1.0)
    assert read_costs().factors("another")[0] == pytest.approx(1.0)


def test_the_last_runs_count_and_none_counts_too_much() -> None:
    past = read_costs()
    for ratio in (2.0,) * 40 + (0.5,) * 40 + (1e9,) * 1:
        past.learn("kind", ratio, 1.0)
    assert read_costs().factors("kind")[0] == pytest.approx(0.5, rel=0.15)
    assert max(run.seconds for run in read_costs().runs) == pytest.approx(math.log(LARGEST_FACTOR))


def test_plans_follow_a_slower_machine_also_for_kinds_that_have_not_run_on_it() -> None:
    rng, past = np.random.default_rng(0), read_costs()
    own = {"full spot on box": 1.5, "charges on scan": 0.6, "full beam on torus": 1.0}
    for host, kinds in ((1.0, list(own)), (2.0, list(own)[1:])):
        for number in range(30):
            kind = kinds[number % len(kinds)]
            past.learn(kind, host * own[kind] * float(np.exp(rng.normal(0.0, 0.1))), 1.0)
    now = read_costs()
    for kind, ratio in own.items():
        assert now.factors(kind)[0] == pytest.approx(2.0 * ratio, rel=0.3)


def test_seconds_of_waiting_for_other_programs_are_not_learned() -> None:
    watch = Stopwatch()
    time.sleep(0.3)
    assert watch.read_undisturbed() < 0.2
    assert watch.read()["total"] >= 0.3


@pytest.mark.parametrize(
    "text",
    [b"", b"\xff\xfe\x00", b'["kind", 1.0', b"{}\n[]\n3\nnull\n", b'["kind", 0, 1]\n["kind", "a", 2]\n["kind", NaN]'],
)
def test_what_cannot_be_read_does_not_count(text: bytes, folder: Path) -> None:
    (folder / FILE).write_bytes(text + b'\n["good", 2.0, 1.0]\n')
    assert list(read_costs().runs) == [PastRun("good", math.log(2.0), 0.0)]
    assert plan(CUBE, TISSUE, [SOURCE]).chosen == "charges"


def test_a_folder_in_place_of_the_file_is_no_error(folder: Path) -> None:
    (folder / FILE).mkdir()
    read_costs().learn("kind", 2.0, 1.0)
    assert list(read_costs().runs) == []


def test_figures_that_are_no_ratios_are_not_written(folder: Path) -> None:
    for seconds, error in ((0.0, 1.0), (math.inf, 1.0), (1.0, math.nan), (1.0, -1.0)):
        read_costs().learn("kind", seconds, error)
    assert not (folder / FILE).exists()


def test_processes_write_at_the_same_time(folder: Path) -> None:
    text = (
        "from tetlux.fem.planner.costs import read_costs\nimport sys\n"
        "for number in range(200): read_costs().learn(sys.argv[1], 2.0, 1.0)"
    )
    running = [subprocess.Popen([sys.executable, "-c", text, f"kind {number}"]) for number in range(3)]
    assert [each.wait() for each in running] == [0, 0, 0]
    lines = (folder / FILE).read_text(encoding="utf-8").splitlines()
    assert sorted(json.loads(line)[0] for line in lines) == sorted(
        f"kind {number}" for number in range(3) for _ in range(200)
    )


def test_the_file_does_not_grow_for_ever(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(costs, "LARGEST_FILE", 1_000)
    past = read_costs()
    for number in range(200):
        past.learn("kind", 1.0 + number / 100.0, 1.0)
    assert (folder / FILE).stat().st_size <= 1_030
    last = [json.loads(line)[1] for line in (folder / FILE).read_text(encoding="utf-8").splitlines()]
    assert last[-1] == 2.99
    assert last == sorted(last)
    assert [path.name for path in folder.iterdir()] == [FILE]


def test_runs_teach_what_charges_take_and_are_off_by(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine forty times slower than the built-in figures say: after some runs the plan knows."""
    for name in ("SECONDS_OF_ANY", "SECONDS_OF_300"):
        monkeypatch.setattr(charges, name, getattr(charges, name) / 40.0)
    before = plan(CUBE, TISSUE, [SOURCE])["charges"]
    for _ in range(6):
        solution = solve(CUBE, TISSUE, [SOURCE], model="auto")
    after = plan(CUBE, TISSUE, [SOURCE])["charges"]
    assert solution.model == "charges"
    assert after.seconds > 3.0 * before.seconds
    kinds = {json.loads(line)[0] for line in (folder / FILE).read_text(encoding="utf-8").splitlines()}
    assert kinds == {"charges on box"}


def test_where_charges_were_off_by_more_than_predicted_more_of_them_are_planned() -> None:
    before = plan(CUBE, TISSUE, [SOURCE], tolerance=0.001)["charges"]
    for _ in range(30):
        read_costs().learn("charges on box", 1.0, 6.0)
    after = plan(CUBE, TISSUE, [SOURCE], tolerance=0.001)["charges"]
    assert after.seconds > 1.5 * before.seconds
    assert max(before.error, after.error) <= 0.001


def test_finite_elements_are_learned_from_and_their_mesh_is_found_in_the_cache(folder: Path) -> None:
    assert not is_cached(CUBE)
    before = plan(CUBE, TISSUE, [DiffuseLight(1.0)], everywhere_tolerance=0.3)
    solve(CUBE, TISSUE, [DiffuseLight(1.0)], everywhere_tolerance=0.3, model="auto")
    (line,) = (folder / FILE).read_text(encoding="utf-8").splitlines()
    kind, seconds, error = json.loads(line)
    assert kind == before["full"].kind == "full fitted on box"
    assert seconds > 0.0
    assert 0.0 < error < 3.0
    assert is_cached(CUBE)
    after = plan(CUBE, TISSUE, [DiffuseLight(1.0)], everywhere_tolerance=0.3)
    assert after["full"].kind == "full fitted on cached mesh"
    built_in = [each["full"].seconds / each["full"].learned[0] for each in (before, after)]
    assert built_in[0] - built_in[1] > 0.9 * effort.SECONDS_OF_MESHER["box"]


def test_plans_can_depend_on_the_scene_alone(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read_costs().learn("full fitted on box", 8.0, 1.0)
    monkeypatch.setenv("TETLUX_LEARN", "0")
    assert read_costs().runs == Costs().runs
    assert plan(CUBE, TISSUE, [SOURCE])["full"].learned == (1.0, 1.0)
    solve(sphere(10.0), TISSUE, [PointSource((0.0, 0.0, 1.0))], model="auto")
    solve(CUBE, TISSUE, [SOURCE], model="auto")
    assert len((folder / FILE).read_text(encoding="utf-8").splitlines()) == 1


def test_nothing_is_written_where_the_cache_is_not_wanted(folder: Path) -> None:
    solve(CUBE, TISSUE, [SOURCE], model="auto", cache=False)
    assert list(folder.iterdir()) == []
