"""Scenes run in processes of their own, so that a crash or a hang of one ends none of the others."""

import contextlib
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path

from tetlux.cases.stress.measure import Figures, Method, measured
from tetlux.cases.stress.panels import Panel, Value
from tetlux.meshing.blocks import THREADS
from tetlux.meshing.errors import TetluxError

# Seconds that a scene may take.
TIME_LIMIT = 120.0
_spawning = get_context("spawn")


@dataclass(frozen=True)
class Run:
    """A scene, a method, and what came of it.

    Attributes
    ----------
    panel : Panel
    x, y : float or str
        Where on its axes.
    method : Method
    outcome : {"ran", "refused", "failed"}
        Refused is what ended with one plain sentence.
    message : str
        That sentence, or what failed.
    figures : Figures or None
        Of what ran.
    """

    panel: Panel
    x: Value
    y: Value
    method: Method
    outcome: str
    message: str = ""
    figures: Figures | None = None


@dataclass(frozen=True)
class _Job:
    panel: Panel
    x: Value
    y: Value
    method: Method


# Outcome, message, figures.
_Answer = tuple[str, str, Figures | None]


def runs_of(panels: Sequence[Panel], *, meshes: Path, time_limit: float = TIME_LIMIT) -> Iterator[Run]:
    """Run all methods on all scenes, some at a time, and yield them as they end.

    Parameters
    ----------
    panels : sequence of Panel
    meshes : Path
        Folder where the mesher's meshes are kept: methods are compared on the same ones.
    time_limit : float
        Seconds that a scene may take.
    """
    # One method after the other: scenes of the same body at the same time would both have it meshed.
    jobs = deque(_Job(panel, x, y, method) for panel in panels for method in panel.methods for x, y in panel.places())
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
                yield Run(job.panel, job.x, job.y, job.method, *answer)
    finally:
        for worker in workers:
            worker.stop()


class _Worker:
    """A process that solves one scene after the other; a new one takes the place of one that died."""

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
        """Have a job done; the time that the process takes to start does not count."""
        # If it died meanwhile, its answer will be that.
        with contextlib.suppress(OSError, EOFError):
            if not self._ready:
                self._ready = self.connection.recv()
            self.connection.send((job.panel.make, job.x, job.y, job.method))
        self.job, self.deadline = job, time.monotonic() + time_limit

    def answer(self, time_limit: float) -> _Answer | None:
        """What came of its job; None if it is still at it."""
        if self.connection.poll():
            try:
                answer: _Answer = self.connection.recv()
                return answer
            except EOFError:
                self._process.join()
                code = self._process.exitcode or 0
                how = f"signal {-code}" if code < 0 else f"exit code {code}"
                return self._anew(f"crashed: the process died of {how}")
        if time.monotonic() >= self.deadline:
            return self._anew(f"hung: stopped after {time_limit:g} s")
        return None

    def _anew(self, message: str) -> _Answer:
        self.stop()
        self._begin()
        return "failed", message, None

    def stop(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.join()
        self.connection.close()


def _work(connection: Connection, meshes: Path) -> None:
    """Solve what comes in, until there is no one left to answer."""
    os.environ["TETLUX_CACHE_DIR"] = str(meshes)
    with contextlib.suppress(EOFError, KeyboardInterrupt, BrokenPipeError):
        connection.send(True)
        while True:
            connection.send(_answered(*connection.recv()))


def _answered(make: Callable[..., object], x: Value, y: Value, method: Method) -> _Answer:
    try:
        scene = make(x, y)
        return "ran", "", measured(scene, method)  # type: ignore[arg-type]
    except TetluxError as error:
        return "refused", str(error), None
    except Exception as error:  # whatever it is, it is a row of the table
        return "failed", f"{type(error).__name__}: {error}", None
