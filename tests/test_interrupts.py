"""Interrupts and full disks in the middle of a batch: nothing is lost, and nothing is half-written."""

import os
import signal
import sys
from pathlib import Path

import pytest

from tetlux.cases.batch import workshop
from tetlux.cases.batch.display.logs import RunLogs
from tetlux.cases.batch.engine import run_batch
from tetlux.cases.batch.events import BatchEnded, BatchStarted, Event, RunFailed, RunFinished
from tetlux.cases.batch.requests import load_all
from tetlux.cases.interrupts import Interrupts
from tetlux.cases.results.batch_tables import BatchTables
from tetlux.cases.results.table_file import TableFile
from tetlux.cases.run import finish_case

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no signals or limits of POSIX")

BALL = """
unit: mm
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
surface: {sphere: {radius: 10}}
lights: [{pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 1.0}}]
outputs: []
tolerance: 0.3
sweep: {medium.sigma_a: [0.01, 0.012, 0.014]}
"""


def interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def test_an_interrupt_waits_for_the_end_of_a_block() -> None:
    done = []
    with Interrupts() as interrupts:
        with pytest.raises(KeyboardInterrupt):  # noqa: PT012
            with interrupts.wait():
                interrupt()
                done.append("block")
            done.append("after")
        with interrupts.wait():
            done.append("another")
        with pytest.raises(KeyboardInterrupt):
            interrupt()
    assert done == ["block", "another"]
    with pytest.raises(KeyboardInterrupt):
        interrupt()


def test_the_first_interrupt_is_told_and_the_second_one_raises() -> None:
    told = []
    with Interrupts() as interrupts, interrupts.tell(lambda: told.append("first")):
        with interrupts.wait():
            interrupt()
            assert told == []
        assert told == ["first"]
        with pytest.raises(KeyboardInterrupt):
            interrupt()
    assert told == ["first"]


def test_a_run_whose_files_are_there_has_its_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def finish_and_interrupt(*arguments: object, **options: object) -> object:
        finish_case(*arguments, **options)  # type: ignore[arg-type]
        raise KeyboardInterrupt

    monkeypatch.setattr(workshop, "finish_case", finish_and_interrupt)
    (tmp_path / "ball.yaml").write_text(BALL)
    events: list[Event] = []
    with pytest.raises(KeyboardInterrupt):
        run_batch(load_all([str(tmp_path / "ball.yaml")]), tmp_path, jobs=1, listeners=[events.append, BatchTables()])
    (finished,) = (event for event in events if isinstance(event, RunFinished))
    rows = (tmp_path / "results.csv").read_text().splitlines()
    assert [row.split(",")[0] for row in rows[1:]] == [finished.name]
    assert isinstance(events[-1], BatchEnded)
    assert (events[-1].finished, events[-1].left) == (1, 2)


def test_a_full_disk_leaves_no_half_row_and_no_half_log(tmp_path: Path) -> None:
    import resource  # noqa: PLC0415 - not on Windows

    table, log = TableFile(tmp_path / "results.csv", ("run",), ("power",)), tmp_path / "logs" / "ball" / "b.log"
    table.replace([{"run": "ball/a", "power": 1.0}])
    before, size = table.path.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    logs = RunLogs()
    logs(BatchStarted(("ball/a", "ball/b"), tmp_path, 1))
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 5, size[1]))
    try:
        with pytest.raises(OSError, match=r"No space left|too large"):
            table.append([{"run": "ball/b", "power": 2.0}])
        logs(RunFailed(1, "ball/b", "no luck.", 1.0))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, size)
    assert table.path.read_bytes() == before
    assert log.parent.is_dir()
    assert not log.exists()
