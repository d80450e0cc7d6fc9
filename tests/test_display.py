"""What is shown of a batch while it runs, and at its end."""

import io
from collections.abc import Callable
from pathlib import Path

import pytest

from tetlux.cases.batch.display.displays import LiveDisplay, PlainDisplay, Quiet, choose_display
from tetlux.cases.batch.display.lines import Lines
from tetlux.cases.batch.display.logs import RunLogs
from tetlux.cases.batch.display.progress import Progress, describe_rate, describe_seconds, list_by_sentence
from tetlux.cases.batch.events import (
    BatchEnded,
    BatchStarted,
    Listener,
    MeshFinished,
    MeshStarted,
    RunFailed,
    RunFinished,
    RunStarted,
    StageEnded,
    WorkerLost,
)
from tetlux.meshing.notes import Note


class Clock:
    """Seconds that pass when they are told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def play(display: Listener, clock: Clock, between: Callable[[], None] = lambda: None) -> None:
    """A batch of 1,000 runs by two workers, of which 40 have ended after 20 s, and which is then interrupted."""
    names = tuple(f"a/x={number}" for number in range(1000))
    display(BatchStarted(names, Path("out"), 2, ("a.yaml",) * 1000))
    for number in range(5):
        display(RunFinished(number, names[number], Path("out"), {}, 0.0, kept=True))
    display(MeshStarted(0, 1000, "worker 1"))
    clock.now += 2.0
    display(MeshFinished(0, 5000, 2.0, "worker 1"))
    for number in range(5, 45):
        display(RunStarted(number, names[number], "worker 1"))
        clock.now += 0.45
        if number % 10 == 9:
            display(RunFailed(number, names[number], "the mesher failed.", 0.4, "worker 1"))
        else:
            notes = (Note("thin", f"it is {number} mm thin."),) if number < 20 else ()
            display(RunFinished(number, names[number], Path("out"), {}, 0.4, "worker 1", notes=notes))
    display(WorkerLost("worker 2", "it was killed", (45,)))
    display(RunStarted(45, names[45], "worker 2"))
    clock.now += 0.0
    between()
    display(BatchEnded(36, 4, 5, 955, 20.0, "interrupted"))


def test_progress_counts_runs_and_foresees_the_end() -> None:
    clock, progress = Clock(), Progress()
    progress.clock = clock
    play(progress.take, clock)
    assert (progress.finished, progress.kept, progress.failed, progress.left) == (36, 5, 4, 955)
    assert progress.seconds == pytest.approx(20.0)
    assert progress.rate == pytest.approx(2.0)
    assert progress.seconds_left == pytest.approx(955 / 2)
    assert progress.working == {"worker 2": ("a/x=45", clock.now)}
    assert progress.describe() == (
        "41 of 1,000 runs done (5 kept), 4 failed, 955 left, 2 runs/s, 7 min 58 s to go"
    )  # fmt: skip
    # A batch that has become slower is foreseen by its last runs.
    for number in range(45, 95):
        clock.now += 10.0
        progress.take(RunFinished(number, "a", Path("out"), {}, 10.0))
    assert progress.rate == pytest.approx(0.1)


def test_a_batch_that_has_just_begun_has_no_rate() -> None:
    progress = Progress()
    progress.take(BatchStarted(("a", "b"), Path("out"), 1))
    assert progress.rate is None
    assert progress.describe() == "0 of 2 runs done, 0 failed, 2 left"


def test_times_and_rates_are_for_people() -> None:
    assert [describe_seconds(s) for s in (0.4, 59.4, 59.6, 3599, 3600, 90_000)] == [
        "0 s", "59 s", "1 min 0 s", "59 min 59 s", "1 h 0 min", "25 h 0 min",
    ]  # fmt: skip
    assert [describe_rate(rate) for rate in (12.345, 1.0, 0.04)] == ["12.3 runs/s", "1 runs/s", "25 s a run"]


def test_sentences_are_listed_by_how_many_runs_they_are_of() -> None:
    names = {"rare.": ["a"], "often.": ["b", "c", "d", "e"]}
    assert list_by_sentence(names) == ["4 runs: often. (b, c, d and 1 more)", "1 run: rare. (a)"]


def test_plain_lines_come_every_few_seconds_and_failures_at_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    clock = Clock()
    display = PlainDisplay(clock, every=0.01)
    printed = []

    def wait() -> None:
        # The line of the display's own thread.
        while "to go" not in (text := capsys.readouterr().out):
            printed.append(text)
        printed.append(text)

    play(display, clock, wait)
    shown = capsys.readouterr()
    text = "".join(printed) + shown.out
    assert text.startswith("1,000 runs in 2 worker processes, written to out\n")
    assert "worker worker 2 is lost: it was killed; its runs are done again\n" in text
    assert "\n41 of 1,000 runs done (5 kept), 4 failed, 955 left, 2 runs/s, 7 min 58 s to go\n" in text
    assert "to go; interrupted after 20 s\n" in shown.out
    assert (
        "note, with figures of the first, in 13 runs: it is 5 mm thin. (a/x=5, a/x=6, a/x=7 and 10 more)\n" in shown.out
    )
    assert shown.err == (
        "tetlux: 4 of 1,000 runs failed.\n"
        "  4 runs: the mesher failed. (a/x=9, a/x=19, a/x=29 and 1 more)\n"
    )  # fmt: skip


def test_quiet_shows_failures_only(capsys: pytest.CaptureFixture[str]) -> None:
    clock = Clock()
    play(Quiet(clock), clock)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("tetlux: 4 of 1,000 runs failed.\n")
    quiet = Quiet(clock)
    quiet(BatchStarted(("a",), Path("out"), 1))
    quiet(BatchEnded(1, 0, 0, 0, 1.0))
    assert capsys.readouterr() == ("", "")


def test_a_terminal_shows_counts_and_what_each_worker_does(capsys: pytest.CaptureFixture[str]) -> None:
    from rich.console import Console  # noqa: PLC0415

    clock, screen = Clock(), io.StringIO()
    display = LiveDisplay(clock, Console(file=screen, force_terminal=True, width=120, color_system=None))
    drawn = []

    def draw() -> None:
        clock.now += 75.0
        plain = Console(file=io.StringIO(), width=120, color_system=None)
        with plain.capture() as capture:
            plain.print(display.draw())
        drawn.append(capture.get())

    play(display, clock, draw)
    (text,) = drawn
    assert "41/1,000 done" in text
    assert "4 failed" in text
    assert "955 left" in text
    assert "2.38 s a run" in text
    assert "worker 2  a/x=45  1 min 15 s" in text
    assert "worker 1" not in text
    assert "interrupted after 20 s" in screen.getvalue()
    assert "4 runs: the mesher failed." in capsys.readouterr().err


def test_the_display_fits_where_output_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CI", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    assert isinstance(choose_display(5000, quiet=True), Quiet)
    # Under test output goes to a file.
    assert isinstance(choose_display(3), Lines)
    assert type(choose_display(5000)) is PlainDisplay
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert isinstance(choose_display(1), Lines)
    assert isinstance(choose_display(3), LiveDisplay)
    monkeypatch.setenv("CI", "true")
    assert type(choose_display(5000)) is PlainDisplay


def test_each_run_has_a_log_also_one_that_failed(tmp_path: Path) -> None:
    logs = RunLogs()
    for event in (
        BatchStarted(("a/x=1", "a/x=2", "a/x=3", "a/x=4"), tmp_path, 2),
        RunStarted(0, "a/x=1", "w", repairs=("2 holes closed",)),
        StageEnded(0, "5 nodes", 0.25),
        RunStarted(1, "a/x=2", "v"),
        RunStarted(2, "a/x=3", "v"),
        RunFinished(0, "a/x=1", tmp_path / "a", {}, 1.5, notes=("it is thin.",), readings=("eye: 1 W",)),
        RunFailed(1, "a/x=2", "memory ran out.", 2.0),
        RunFinished(3, "a/x=4", tmp_path / "b", {}, 0.0, kept=True),
        BatchEnded(1, 1, 1, 1, 2.0, "interrupted"),
    ):
        logs(event)
    assert {path.name: path.read_text() for path in (tmp_path / "logs" / "a").iterdir()} == {
        "x=1.log": "repaired: 2 holes closed\n    0.25 s  5 nodes\n    1.50 s  eye: 1 W\n"
        f"    1.50 s  note: it is thin.\n    1.50 s  written to {tmp_path / 'a'}\n",
        "x=2.log": "    2.00 s  failed: memory ran out.\n",
        "x=3.log": "the batch was interrupted before this run ended\n",
    }
    # A log that cannot be written stops nothing.
    (tmp_path / "file").write_text("")
    logs(BatchStarted(("b",), tmp_path / "file", 1))
    logs(RunFailed(0, "b", "memory ran out.", 2.0))
