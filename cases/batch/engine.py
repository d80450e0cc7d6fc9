"""`run_batch`: all runs of a batch, wherever they are solved; a single case is a batch of one."""

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tetlux.cases.batch.events import BatchEnded, BatchStarted, Event, Listener, RunFailed, RunFinished, RunStarted
from tetlux.cases.batch.grouping import make_plan
from tetlux.cases.batch.jobs import MeshJob
from tetlux.cases.batch.launch import Launcher
from tetlux.cases.batch.mesh_store import MeshStore
from tetlux.cases.batch.processes import run_in_processes
from tetlux.cases.batch.schedule import Batch, Schedule
from tetlux.cases.batch.workshop import Workshop
from tetlux.cases.file.case import Case
from tetlux.cases.interrupts import Interrupts
from tetlux.cases.planning import plan_models
from tetlux.cases.run import SUMMARY
from tetlux.cases.write.content import content_of
from tetlux.cases.write.publish import check_writable
from tetlux.fem.memory import available
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.blocks import CORES

# A worker process takes as long to start as two quick runs: so many runs each, or fewer workers.
FEWEST_RUNS_PER_WORKER = 2
# What a worker needs at least: its libraries, a surface and a mesh of 100,000 tetrahedra, bytes.
LEAST_MEMORY = 500e6


def run_batch(
    cases: Sequence[Case],
    out: Path,
    *,
    jobs: int | None = None,
    resume: bool = False,
    scheduler: str | None = None,
    cache: bool = True,
    listeners: Sequence[Listener] = (),
    launcher: Launcher | None = None,
) -> BatchEnded:
    """Run cases, each into its own folder.

    Parameters
    ----------
    cases : sequence of Case
        Of different names, as from `load_all`.
    out : Path
        Folder of all results.
    jobs : int, optional
        How many worker processes, fewer if memory does not suffice. By default as many as there are cores; with 1, or
        for few runs, this process does the work.
    resume : bool
        Whether runs that are finished in `out`, by their content, are kept as they are.
    scheduler : str, optional
        Address or file of a Dask scheduler, whose workers do the work.
    cache : bool
        Whether meshes are looked up and kept in the user's cache directory.
    listeners : sequence of callable
        Are called with each event.
    launcher : Launcher, optional
        Has worker processes that have been started already.

    Returns
    -------
    BatchEnded

    Raises
    ------
    InputError
        If `out` cannot be written to, `jobs` is no positive number, or the scheduler cannot do the work.
    RunError
        If the scheduler or worker processes are lost; listeners have had `BatchEnded` all the same.
    KeyboardInterrupt
        If it was interrupted; listeners have had `BatchEnded` all the same.
    """
    check_writable(out)
    contents = [content_of(case) for case in cases]
    kept = _finished(cases, out, contents, range(len(cases))) if resume else {}
    cases = plan_models(cases)
    plan = make_plan(cases)
    batch = Batch(plan, cases, frozenset(kept), str(out.absolute()), cache, MeshStore(out, plan, contents))
    count = worker_count(jobs, len(cases) - len(kept))
    with _workers(scheduler, count, launcher) as (workers, run_on), Interrupts() as interrupts:
        track = _Track(len(cases), listeners, interrupts)
        track(BatchStarted(plan.names, out, workers, tuple(str(case.source) for case in cases)))
        for run, summary in kept.items():
            track(RunFinished(run, plan.names[run], out / plan.names[run], summary, 0.0, kept=True))
        try:
            run_on(batch, track)
        except BaseException as error:
            # Their files may be there although nobody has said so.
            for run, summary in _finished(cases, out, contents, track.in_flight).items():
                folder, seconds = out / plan.names[run], summary["seconds"]["total"]
                track(RunFinished(run, plan.names[run], folder, summary, seconds, notes=tuple(summary["warnings"])))
            track.end("interrupted" if isinstance(error, KeyboardInterrupt) else "stopped")
            raise
        ended = track.end("stopped" if track.left else "complete")
    if not ended.failed:
        batch.store.clear()
    return ended


@contextmanager
def _workers(
    scheduler: str | None, count: int, launcher: Launcher | None
) -> Iterator[tuple[int, Callable[[Batch, "_Track"], None]]]:
    """How many runs are solved at a time, and what does a batch: a cluster, worker processes, or this process."""
    if scheduler is not None:
        from tetlux.cases.batch.cluster import connect, run_on_cluster  # noqa: PLC0415 - Dask takes half a second

        with connect(scheduler) as client:
            yield len(client.nthreads()), lambda batch, track: run_on_cluster(batch, client, track)
    elif count > 1:
        with launcher or Launcher() as used:
            yield count, lambda batch, track: run_in_processes(batch, count, track, used, track.interrupts)
    else:
        yield 1, _run_here


def worker_count(jobs: int | None, runs: int) -> int:
    """How many worker processes to use for so many runs; 1 for none beside this process.

    Raises
    ------
    InputError
        If `jobs` is no positive number.
    """
    affordable = int(available() / LEAST_MEMORY)
    if jobs is not None:
        if jobs < 1:
            raise InputError(f"--jobs is {jobs}; give the number of worker processes, 1 or more.")
        return max(1, min(jobs, runs, affordable))
    return max(1, min(affordable, CORES, runs // FEWEST_RUNS_PER_WORKER))


def _run_here(batch: Batch, track: "_Track") -> None:
    """Do all jobs in this process."""
    schedule = Schedule(batch)
    workshop = Workshop("", track, lambda: track.must_stop, raises_faults=len(batch.cases) == 1)
    while not track.must_stop and (job := schedule.next_job()) is not None:
        if isinstance(job, MeshJob):
            schedule.take_mesh(workshop.adapt(job))
        else:
            workshop.solve(job)


def _finished(
    cases: Sequence[Case], out: Path, contents: Sequence[str], runs: Iterable[int]
) -> dict[int, dict[str, Any]]:
    """The summaries of those runs, by number, that are finished, now or by an earlier batch."""
    found = {}
    for number in runs:
        try:
            summary = json.loads((out / cases[number].name / SUMMARY).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        if isinstance(summary, dict) and summary.get("content") == contents[number]:
            found[number] = summary
    return found


class _Track:
    """Counts runs by outcome, and passes events on."""

    def __init__(self, runs: int, listeners: Sequence[Listener], interrupts: Interrupts) -> None:
        self._runs, self._listeners, self._counts = runs, listeners, Counter[str]()
        self.interrupts = interrupts
        self._started = time.perf_counter()
        self.must_stop = False
        self.in_flight: set[int] = set()

    def __call__(self, event: Event) -> None:
        # By all or by none: an interrupt in between would leave a table locked, or a row out.
        with self.interrupts.wait():
            if isinstance(event, RunStarted):
                self.in_flight.add(event.run)
            elif isinstance(event, RunFinished | RunFailed):
                self.in_flight.discard(event.run)
            if isinstance(event, RunFinished):
                self._counts["kept" if event.kept else "finished"] += 1
            elif isinstance(event, RunFailed):
                self._counts["failed"] += 1
                self.must_stop = self.must_stop or event.ends_batch
            for listener in self._listeners:
                listener(event)

    @property
    def left(self) -> int:
        """How many runs have not ended."""
        return self._runs - self._counts.total()

    def end(self, how: Any) -> BatchEnded:
        """Send the last event."""
        counts = self._counts
        seconds = time.perf_counter() - self._started
        ended = BatchEnded(counts["finished"], counts["failed"], counts["kept"], self.left, seconds, how)
        self(ended)
        return ended
