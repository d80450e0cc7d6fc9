"""Batches as users run them: shared meshes, worker processes that die, resumption, and Ctrl-C."""

import errno
import glob
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tetlux.cases import run as runs
from tetlux.cases.batch import workshop
from tetlux.cases.batch.engine import run_batch, worker_count
from tetlux.cases.batch.events import BatchEnded, Event, MeshFinished, RunFailed, RunFinished, WorkerLost
from tetlux.cases.batch.launch import Launcher, seem_many
from tetlux.cases.batch.requests import load_all
from tetlux.cases.cli import main
from tetlux.cases.file.case import Case
from tetlux.cases.results import batch_tables
from tetlux.cases.results.batch_tables import BatchTables
from tetlux.cases.run import finish_case
from tetlux.cases.write.content import content_of
from tetlux.fem.solve_scenes import solve_each
from tetlux.meshing import box
from tetlux.meshing.errors import InputError, RunError

# A radius of its own: other tests, in other processes, may put another mesh of the same ball into the cache.
BALL = """
unit: mm
surface: {sphere: {radius: 9.97}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 1.0}
tolerance: 0.1
outputs: []
sweep: {medium.sigma_a: [0.01, 0.012, 0.014, 0.016, 0.018, 0.02]}
"""


def read(folder: Path, text: str = BALL, name: str = "ball") -> list[Case]:
    (folder / f"{name}.yaml").write_text(text)
    return load_all([str(folder / f"{name}.yaml")])


def summaries(out: Path) -> dict[str, Any]:
    """All summaries without their seconds, by folder."""
    found = {}
    for path in out.glob("*/*/summary.json"):
        summary = json.loads(path.read_text())
        del summary["seconds"]
        found[path.parent.name] = summary
    return found


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch that nothing disturbed."""
    folder = tmp_path_factory.mktemp("finished")
    run_batch(read(folder), folder / "out", jobs=1)
    return folder


def test_runs_share_a_mesh_and_hold_their_tolerance(finished: Path) -> None:
    found = summaries(finished / "out")
    assert len(found) == 6
    assert len({summary["mesh"]["nodes"] for summary in found.values()}) == 1
    for summary in found.values():
        assert summary["channels"][0]["error_estimate"] <= 0.1
    assert sorted(path.name for path in (finished / "out").iterdir()) == ["ball"]


def test_a_run_of_a_batch_finds_what_it_finds_alone(finished: Path) -> None:
    for case in load_all([str(finished / "ball.yaml")])[::5]:
        (alone,) = solve_each(case.surface, case.medium, [list(case.lights)], tolerance=0.01)
        (channel,) = summaries(finished / "out")[Path(case.name).name]["channels"]
        assert channel["power"]["exited"] == pytest.approx(alone.power.exited, rel=0.01)
        assert channel["exitance"]["max"] == pytest.approx(alone.exitance_at(np.array([[0.0, 0.0, 10.0]]))[0], rel=0.02)


def test_resume_keeps_what_is_finished_and_runs_what_has_changed(finished: Path, tmp_path: Path) -> None:
    cases = read(tmp_path, BALL.replace("0.02]", "0.021]"))
    out = tmp_path / "out"
    (finished / "out" / "ball").rename(finished / "moved")
    try:
        out.mkdir()
        (out / "ball").symlink_to(finished / "moved")
        events: list[Event] = []
        run_batch(cases, out, jobs=1, resume=True, listeners=[events.append])
        ends = [event for event in events if isinstance(event, RunFinished)]
        assert [event.run for event in ends if event.kept] == [0, 1, 2, 3, 4]
        assert [event.run for event in ends if not event.kept] == [5]
        ended = events[-1]
        assert isinstance(ended, BatchEnded)
        assert (ended.kept, ended.finished, ended.failed, ended.left) == (5, 1, 0, 0)
    finally:
        (finished / "moved").rename(finished / "out" / "ball")


def test_resume_runs_again_what_has_another_case_or_surface(tmp_path: Path) -> None:
    """Runs of the same names, whose case file, and then whose surface file, has changed."""
    three = BALL.replace("{sphere: {radius: 9.97}}", "{file: body.obj}").replace(", 0.016, 0.018, 0.02]", "]")

    def resume(text: str, side: float) -> tuple[int, int]:
        cube = box((side, side, side))
        lines = [" ".join(map(str, ("v", *point))) for point in cube.points.tolist()]
        lines += [" ".join(map(str, ("f", *face))) for face in (cube.faces + 1).tolist()]
        (tmp_path / "body.obj").write_text("\n".join(lines))
        ended = run_batch(read(tmp_path, text), tmp_path / "out", jobs=1, resume=True)
        return ended.kept, ended.finished

    assert resume(three, 12.0) == (0, 3)
    assert resume(three, 12.0) == (3, 0)
    changed = three.replace("eta: 1.4", "eta: 1.3")
    assert resume(changed, 12.0) == (0, 3)
    assert resume(changed, 12.5) == (0, 3)


def test_content_is_that_of_files_and_not_their_names(tmp_path: Path) -> None:
    (case,) = load_all(["hare"])
    copies = tmp_path / "copies"
    copies.mkdir()
    (copies / "other.stl").write_bytes((case.source.parent / "hare.stl").read_bytes())
    text = case.source.read_text().replace("hare.stl", "other.stl").replace("name: hare", "name: rabbit")
    (copy,) = read(copies, text)
    assert content_of(copy) == content_of(case)
    (other,) = read(copies, text.replace("sigma_a: 0.01", "sigma_a: 0.011"))
    assert content_of(other) != content_of(case)
    moved = bytearray((copies / "other.stl").read_bytes())
    moved[96] ^= 1  # the lowest bit of a coordinate
    (copies / "other.stl").write_bytes(moved)
    (changed,) = read(copies, text)
    assert content_of(changed) != content_of(case)


def test_one_failing_run_does_not_end_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    finish = finish_case

    def fail_twice(case: Case, *rest: Any, **options: Any) -> Any:
        if "0.012" in case.name:
            raise RunError("no luck.")
        if "0.014" in case.name:
            raise ZeroDivisionError("division by zero")
        return finish(case, *rest, **options)

    monkeypatch.setattr(workshop, "finish_case", fail_twice)
    events: list[Event] = []
    ended = run_batch(read(tmp_path), tmp_path / "out", jobs=1, listeners=[events.append])
    assert (ended.finished, ended.failed, ended.left) == (4, 2, 0)
    failures = [event for event in events if isinstance(event, RunFailed)]
    first, second = sorted(failures, key=lambda event: event.run)
    assert first.reason == "no luck."
    assert first.sweep == {"medium.sigma_a": 0.012}
    assert "ZeroDivisionError" in second.reason


def test_a_full_disk_ends_the_batch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is said once, of the folder of all results, though tables cannot be written either."""

    def fill(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(runs, "publish", fill)
    monkeypatch.setattr(batch_tables, "write_page", fill)
    events: list[Event] = []
    ended = run_batch(read(tmp_path), tmp_path / "out", jobs=1, listeners=[events.append, BatchTables()])
    assert (ended.failed, ended.left, ended.how) == (1, 5, "stopped")
    (failure,) = [event for event in events if isinstance(event, RunFailed)]
    assert failure.reason == (
        f"results cannot be written to {tmp_path / 'out'}: {os.strerror(errno.ENOSPC)}; make room, or choose another "
        "folder with --out."
    )


def test_workers_find_what_one_process_finds_though_one_is_killed(finished: Path, tmp_path: Path) -> None:
    cases, out = read(tmp_path), tmp_path / "out"
    # The mesher's mesh comes from the cache, since it would make another one.
    events: list[Event] = []

    def kill_the_first(event: Event) -> None:
        events.append(event)
        # Once: the mesh is adapted again if its worker was killed before it could hand it over.
        if isinstance(event, MeshFinished) and sum(isinstance(each, MeshFinished) for each in events) == 1:
            own = subprocess.run(
                ["pgrep", "-P", str(os.getpid()), "-f", "batch.worker 1 "], capture_output=True, check=True
            )
            os.kill(int(own.stdout.split()[0]), signal.SIGKILL)

    ended = run_batch(cases, out, jobs=2, listeners=[kill_the_first])
    assert (ended.finished, ended.failed) == (6, 0)
    (lost,) = (event for event in events if isinstance(event, WorkerLost))
    assert "SIGKILL" in lost.reason
    for name, summary in summaries(out).items():
        expected = summaries(finished / "out")[name]
        assert summary["mesh"] == expected["mesh"]
        assert summary["channels"] == expected["channels"]


def test_a_killed_batch_is_resumed_with_the_same_results(finished: Path, tmp_path: Path) -> None:
    read(tmp_path)
    command = [sys.executable, "-m", "tetlux", "run", "ball.yaml", "--jobs", "1", "--resume"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL) as batch:
        while len(summaries(tmp_path / "results")) < 2 and batch.poll() is None:
            time.sleep(0.05)
        batch.kill()
    kept = len(summaries(tmp_path / "results"))
    assert 2 <= kept < 6
    ended = run_batch(load_all([str(tmp_path / "ball.yaml")]), tmp_path / "results", jobs=1, resume=True)
    assert (ended.kept, ended.finished) == (kept, 6 - kept)
    expected = summaries(finished / "out")
    for name, summary in summaries(tmp_path / "results").items():
        assert summary["channels"] == expected[name]["channels"]
    assert not list((tmp_path / "results").glob(".*"))


def test_interrupting_workers_keeps_the_runs_in_flight(tmp_path: Path) -> None:
    read(tmp_path, BALL.replace("0.02]", f"{', '.join(str(0.02 + 0.001 * i) for i in range(60))}]"))
    command = [sys.executable, "-m", "tetlux", "run", "ball.yaml", "--jobs", "2"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as batch:
        while not glob.glob(f"{tmp_path}/results/*/*/summary.json") and batch.poll() is None:  # noqa: PTH207 - folders vanish
            time.sleep(0.05)
        batch.send_signal(signal.SIGINT)
        _, messages = batch.communicate(timeout=60)
    assert batch.returncode == 130
    assert b"finished cases are kept" in messages
    assert 1 <= len(summaries(tmp_path / "results")) < 60
    assert not list((tmp_path / "results").glob(".partial*"))


@pytest.mark.skipif(sys.platform == "win32", reason="no signals of POSIX")
@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interrupt_while_a_row_is_written_leaves_whole_tables(tmp_path: Path, jobs: int) -> None:
    def interrupt(event: Event) -> None:
        if isinstance(event, RunFinished) and not ended:
            os.kill(os.getpid(), signal.SIGINT)
        if isinstance(event, RunFinished | BatchEnded):
            ended.append(event)

    ended: list[Event] = []
    with pytest.raises(KeyboardInterrupt):
        run_batch(read(tmp_path), tmp_path, jobs=jobs, listeners=[interrupt, BatchTables()])
    finished = [event.name for event in ended if isinstance(event, RunFinished)]
    assert 1 <= len(finished) < 6
    assert isinstance(ended[-1], BatchEnded)
    assert (ended[-1].finished, ended[-1].left, ended[-1].how) == (len(finished), 6 - len(finished), "interrupted")
    rows = (tmp_path / "results.csv").read_text().splitlines()
    assert sorted(row.split(",")[0] for row in rows[1:]) == sorted(finished)


def test_prepared_workers_are_used_or_ended() -> None:
    with Launcher() as launcher:
        launcher.start_first(3)
        unwanted = list(launcher._early.values())
        launcher.start_first(2)
        launcher.prepare(2)
        launcher.prepare(2)
        taken = launcher.take("1", 2)
        again = launcher.take("1", 2)
        others = list(launcher._early.values())
        assert len(others) == 1
        for process in (taken, again):
            process.kill()
            process.communicate()
    assert taken.pid != again.pid
    assert [process.returncode for process in (*others, *unwanted)] == [-signal.SIGKILL] * 2


def test_another_number_of_workers_than_expected_starts_anew() -> None:
    with Launcher() as launcher:
        launcher.start_first(3)
        unwanted = list(launcher._early.values())
        launcher.prepare(2)
        assert sorted(launcher._early) == ["1", "2"]
        assert [process.returncode for process in unwanted] == [-signal.SIGKILL]
        launcher.prepare(1)
        assert not launcher._early


@pytest.mark.parametrize(
    ("text", "many"),
    [("unit: mm\nsweep:\n  unit: [mm, cm]\n", True), ("name: sweep\n# sweep:\n", False), (None, False)],
)
def test_a_sweep_is_seen_before_its_file_is_read(tmp_path: Path, text: str | None, many: bool) -> None:
    if text is not None:
        (tmp_path / "case.yaml").write_text(text)
    assert seem_many([str(tmp_path / "case.yaml")]) == many
    assert seem_many([str(tmp_path / "case.yaml")] * 2)
    assert seem_many([str(tmp_path / "*.yaml")])


def test_a_wrong_case_leaves_no_workers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "ball.yaml").write_text(BALL.replace("0.02]", "0.02, -1]"))
    assert main(["run", str(tmp_path / "ball.yaml"), "--jobs", "2", "--out", str(tmp_path / "out")]) == 2
    assert "sigma_a is -1" in capsys.readouterr().err
    left = subprocess.run(["pgrep", "-P", str(os.getpid()), "-f", "batch.worker"], capture_output=True, check=False)
    assert not left.stdout


def test_worker_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tetlux.cases.batch.engine.available", lambda: 9e9)
    assert worker_count(1000, 10_000) == 18
    assert worker_count(1, 100) == 1
    assert worker_count(8, 3) == 3
    assert worker_count(None, 1) == 1
    with pytest.raises(InputError, match="--jobs is 0; give the number"):
        worker_count(0, 1)
