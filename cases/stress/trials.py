"""Trials, run in worker processes, so that a crash or a hang of one does not affect the others."""

import contextlib
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path

from tetlux.cases.stress.measure import Diagnostics, measure
from tetlux.cases.stress.panels import Panel, Value, Variant
from tetlux.meshing.errors import TetluxError
from tetlux.meshing.host.blocks import THREADS

# A trial is stopped after this many seconds. The mesher takes up to 150 for four layers.
TIME_LIMIT = 300.0
_spawning = get_context("spawn")


@dataclass(frozen=True)
class Trial:
    """The outcome of one scenario with one variant of the solver.

    Attributes
    ----------
    panel : Panel
    x, y : float or str
        Values on its axes.
    variant : Variant
    outcome : {"ran", "refused", "failed"}
        "refused" if the solver raised an error with a sentence for the user.
    message : str
        That sentence, or a description of the failure.
    diagnostics : Diagnostics or None
        None unless it ran.
    """

    panel: Panel
    x: Value
    y: Value
    variant: Variant
    outcome: str
    message: str = ""
    diagnostics: Diagnostics | None = None


@dataclass(frozen=True)
class _Job:
    panel: Panel
    x: Value
    y: Value
    variant: Variant


# Outcome, message, diagnostics.
_Answer = tuple[str, str, Diagnostics | None]


def run_trials(panels: Sequence[Panel], *, meshes: Path, time_limit: float = TIME_LIMIT) -> Iterator[Trial]:
    """Run all variants on all scenarios, one per core, and yield the trials as they end.

    Parameters
    ----------
    panels : sequence of Panel
    meshes : Path
        Folder of cached meshes, so that variants are compared on the same ones.
    time_limit : float
        A trial is stopped after this many seconds.

    Yields
    ------
    Trial
    """
    # One variant after the other, since two simultaneous trials of one body would both mesh it.
    jobs = deque(
        _Job(panel, x, y, variant) for panel in panels for variant in panel.variants for x, y in panel.places()
    )
    workers = [_Worker(meshes) for _ in range(min(THREADS, len(jobs)))]
    try:
        for worker in workers:
            worker.start(jobs.popleft(), time_limit)
        while busy := [worker for worker in workers if worker.job is not None]:
            remaining = min(worker.deadline for worker in busy) - time.monotonic()
            wait([worker.connection for worker in busy], max(0.0, remaining))
            for worker in busy:
                answer = worker.answer(time_limit)
                if answer is None:
                    continue
                job = worker.job
                assert job is not None
                worker.job = None
                if jobs:
                    worker.start(jobs.popleft(), time_limit)
                yield Trial(job.panel, job.x, job.y, job.variant, *answer)
    finally:
        for worker in workers:
            worker.stop()


class _Worker:
    """A process that runs one trial after the other, and is replaced when it dies."""

    def __init__(self, meshes: Path) -> None:
        self._meshes = meshes
        self.job: _Job | None = None
        self.deadline = 0.0
        self._begin()

    def _begin(self) -> None:
        self.connection, theirs = _spawning.Pipe()
        self._process = _spawning.Process(target=_work, args=(theirs, self._meshes), daemon=True)
        self._process.start()
        theirs.close()
        self._ready = False

    def start(self, job: _Job, time_limit: float) -> None:
        """Send a job to the process; the start-up of the process does not count in the time limit."""
        # A process that has died meanwhile is reported by `answer`.
        with contextlib.suppress(OSError, EOFError):
            if not self._ready:
                self._ready = self.connection.recv()
            self.connection.send((job.panel.make, job.x, job.y, job.variant))
        self.job, self.deadline = job, time.monotonic() + time_limit

    def answer(self, time_limit: float) -> _Answer | None:
        """The outcome of the job; None while it runs."""
        if self.connection.poll():
            try:
                answer: _Answer = self.connection.recv()
                return answer
            except EOFError:
                self._process.join()
                code = self._process.exitcode or 0
                how = f"signal {-code}" if code < 0 else f"exit code {code}"
                return self._restart(f"crashed: the process died of {how}")
        if time.monotonic() >= self.deadline:
            return self._restart(f"hung: stopped after {time_limit:g} s")
        return None

    def _restart(self, message: str) -> _Answer:
        self.stop()
        self._begin()
        return "failed", message, None

    def stop(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.join()
        self.connection.close()


def _work(connection: Connection, meshes: Path) -> None:
    """Run jobs from the connection until it is closed."""
    os.environ["TETLUX_CACHE_DIR"] = str(meshes)
    with contextlib.suppress(EOFError, KeyboardInterrupt, BrokenPipeError):
        connection.send(True)
        while True:
            connection.send(_run_trial(*connection.recv()))


def _run_trial(make: Callable[..., object], x: Value, y: Value, variant: Variant) -> _Answer:
    try:
        scenario = make(x, y)
        return "ran", "", measure(scenario, variant)  # type: ignore[arg-type]
    except TetluxError as error:
        return "refused", str(error), None
    except Exception as error:  # every error becomes a row of the table
        return "failed", f"{type(error).__name__}: {error}", None
