"""How runs are grouped, shared out and put back, without solving."""

import itertools
import json
from pathlib import Path

import pytest

from tetlux.cases.batch.grouping import OTHER_DEPTH, make_plan, spread
from tetlux.cases.batch.jobs import MeshData, MeshJob, MeshMade, MeshNotMade, SolveJob
from tetlux.cases.batch.mesh_store import MeshStore
from tetlux.cases.batch.requests import load_all
from tetlux.cases.batch.schedule import Batch, Schedule
from tetlux.cases.cli import main
from tetlux.cases.file.case import Case
from tetlux.meshing import sphere
from tetlux.meshing.mesher.api import tetrahedralize

BALL = """
unit: mm
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 1.0}
tolerance: 0.1
outputs: []
"""
GRID = """
sweep:
  medium.sigma_a: [0.01, 0.02, 0.03, 0.04, 0.05]
  medium.sigma_s_prime: [0.5, 0.7, 1.0, 1.4, 2.0]
  lights.0.pencil.power: [1.0, 2.0]
"""


def read(folder: Path, **files: str) -> list[Case]:
    for name, text in files.items():
        (folder / f"{name}.yaml").write_text(text)
    return load_all([str(folder / f"{name}.yaml") for name in files])


def batch_of(cases: list[Case], folder: Path, done: frozenset[int] = frozenset()) -> Batch:
    plan = make_plan(cases)
    return Batch(plan, cases, done, str(folder), False, MeshStore(folder, plan, [case.name for case in cases]))


def test_a_sweep_shares_one_surface_and_one_mesh(tmp_path: Path) -> None:
    cases = read(tmp_path, ball=BALL + GRID)
    plan = make_plan(cases)
    assert len(plan.surfaces) == 1
    (mesh,) = plan.meshes
    assert mesh.runs == 50
    assert {0, 49} <= set(mesh.pilots)
    assert sorted(run for task in plan.tasks for run in task.runs) == list(range(50))
    assert plan.right_hand_sides == 50


def test_runs_of_equal_media_follow_each_other_in_a_task(tmp_path: Path) -> None:
    cases = read(tmp_path, ball=BALL + GRID)
    plan = make_plan(cases)
    order = [cases[run].medium for task in plan.tasks for run in task.runs]
    changes = sum(one != other for one, other in itertools.pairwise(order))
    assert changes == 24


def test_the_leader_of_a_run_has_its_lights_and_a_similar_depth(tmp_path: Path) -> None:
    cases = read(tmp_path, ball=BALL + GRID)
    plan = make_plan(cases)
    for run, leader in enumerate(plan.leaders):
        ratio = cases[run].medium.mean_free_path / cases[leader].medium.mean_free_path
        assert ratio * 1.0001 >= 1.0 / OTHER_DEPTH
        assert ratio <= OTHER_DEPTH * 1.0001
        assert cases[run].lights == cases[leader].lights
        assert plan.leaders[leader] == leader
    # Depths of a ratio of 4 in two bands, for either light.
    assert len(set(plan.leaders)) == 4


def test_tolerances_and_bodies_have_meshes_of_their_own(tmp_path: Path) -> None:
    few = "sweep: {medium.sigma_a: [0.01, 0.02, 0.03, 0.04]}\n"
    fine, large = BALL.replace("0.1\n", "0.05\n"), BALL.replace("radius: 10", "radius: 11")
    plan = make_plan(read(tmp_path, ball=BALL + few, same=BALL + few, fine=fine + few, large=large + few))
    assert len(plan.surfaces) == 2
    assert sorted(mesh.runs for mesh in plan.meshes) == [4, 4, 8]


def test_few_runs_make_their_own_meshes(tmp_path: Path) -> None:
    plan = make_plan(read(tmp_path, ball=BALL + "sweep: {medium.sigma_a: [0.01, 0.02, 0.03]}\n"))
    assert [mesh.pilots for mesh in plan.meshes] == [()]


def test_spread_has_first_and_last() -> None:
    assert spread(list(range(100)), 3) == [0, 50, 99]
    assert spread([4, 7], 5) == [4, 7]


def test_the_mesh_comes_before_its_tasks(tmp_path: Path) -> None:
    batch = batch_of(read(tmp_path, ball=BALL + GRID), tmp_path)
    schedule = Schedule(batch)
    first = schedule.next_job()
    assert isinstance(first, MeshJob)
    assert [case.name for case in first.cases[: first.pilots]] == [
        batch.plan.names[run] for run in batch.plan.meshes[0].pilots
    ]
    assert schedule.next_job() is None
    schedule.take_mesh(MeshNotMade(first.mesh))
    jobs = []
    while (job := schedule.next_job()) is not None:
        assert isinstance(job, SolveJob)
        jobs.append(job)
    assert sorted(run.run for job in jobs for run in job.runs) == list(range(50))
    assert all(run.leader in job.leaders for job in jobs for run in job.runs)


def test_finished_runs_are_left_out_and_the_mesh_is_kept(tmp_path: Path) -> None:
    cases = read(tmp_path, ball=BALL + GRID)
    data = MeshData.of(tetrahedralize(sphere(10.0)))
    before = Schedule(batch_of(cases, tmp_path))
    before.next_job()
    before.take_mesh(MeshMade(0, data))
    batch = batch_of(cases, tmp_path, frozenset(range(48)))
    after, left = Schedule(batch), []
    while (job := after.next_job()) is not None:
        assert isinstance(job, SolveJob)
        assert job.start is not None
        assert (job.start.points == data.points).all()
        left += [run.run for run in job.runs]
    assert sorted(left) == [48, 49]
    batch.store.clear()
    assert not (tmp_path / ".meshes").exists()


def test_work_of_a_dead_worker_is_done_again_once(tmp_path: Path) -> None:
    schedule = Schedule(batch_of(read(tmp_path, ball=BALL + GRID), tmp_path))
    schedule.next_job()
    schedule.take_mesh(MeshNotMade(0))
    job = schedule.next_job()
    assert isinstance(job, SolveJob)
    (only,) = (run.run for run in job.runs)
    assert schedule.put_back(job, set(), only) is None
    again = schedule.next_job()
    assert isinstance(again, SolveJob)
    assert [run.run for run in again.runs] == [only]
    assert schedule.put_back(again, set(), only) == only
    following = schedule.next_job()
    assert isinstance(following, SolveJob)
    assert only not in [run.run for run in following.runs]


def test_check_counts_and_prints_the_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    read(tmp_path, ball=BALL + GRID)
    assert main(["check", str(tmp_path / "ball.yaml")]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("50 runs, 1 surface, 1 mesh, ")
    assert "50 right-hand sides; about " in last
    assert main(["check", "--plan", str(tmp_path / "ball.yaml")]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert len(plan["names"]) == 50
    assert plan["meshes"][0]["runs"] == 50
