"""`Workshop`: does jobs in its own process, be that the only one or a worker, and tells what happens."""

import time
from collections.abc import Callable
from pathlib import Path

from tetlux.cases.batch.events import Event, MeshFinished, MeshStarted, RunFailed, RunFinished, RunStarted, StageEnded
from tetlux.cases.batch.jobs import MeshData, MeshJob, MeshMade, MeshNotMade, RunJob, SolveJob
from tetlux.cases.file.case import Case
from tetlux.cases.run import FinishedCase, finish_case
from tetlux.cases.write.publish import disk_is_full
from tetlux.fem.inputs import DEFAULT_TOLERANCE
from tetlux.fem.known.kept_fits import KeptFits
from tetlux.fem.share import choose_places
from tetlux.fem.shared import SharedMesh
from tetlux.meshing.errors import TetluxError
from tetlux.meshing.tets.mesh import TetMesh

# Leaders whose places are kept at a time.
MOST_LEADERS = 32

Emit = Callable[[Event], None]
WantsToStop = Callable[[], bool]


class Workshop:
    """Does jobs one after the other.

    Parameters
    ----------
    name : str
        Of this worker; "" in the process of the batch.
    emit : callable
        Is called with each event.
    wants_to_stop : callable
        Is asked before each run whether to leave the rest.
    raises_faults : bool
        Whether an error that is a fault of tetlux is raised: where there are no other runs that it must not end.
    """

    def __init__(
        self, name: str, emit: Emit, wants_to_stop: WantsToStop = lambda: False, *, raises_faults: bool = False
    ) -> None:
        self._raises_faults = raises_faults
        self._name, self.emit, self._wants_to_stop = name, emit, wants_to_stop
        # The last mesh, which the next task mostly has too, and the places that leaders have on it.
        self._mesh: tuple[MeshData, TetMesh] | None = None
        self._places: dict[int, KeptFits] = {}

    def adapt(self, job: MeshJob) -> MeshMade | MeshNotMade:
        """Adapt the mesh of a group. Where that fails, runs make their own, and say what is wrong."""
        self.emit(MeshStarted(job.mesh, job.runs, self._name))
        started = time.perf_counter()
        try:
            data = job.adapt()
        except (TetluxError, MemoryError, RuntimeError, ArithmeticError):
            return MeshNotMade(job.mesh)
        seconds = time.perf_counter() - started
        self.emit(MeshFinished(job.mesh, len(data.tetrahedra), seconds, self._name))
        return MeshMade(job.mesh, data)

    def solve(self, job: SolveJob) -> None:
        """Solve the runs of a task."""
        start = self._start(job)
        for run in job.runs:
            if self._wants_to_stop():
                return
            self._solve(run, start, job)

    def _start(self, job: SolveJob) -> SharedMesh | None:
        if job.start is None:
            return None
        if self._mesh is None or self._mesh[0] is not job.start:
            self._mesh, self._places = (job.start, job.start.mesh()), {}
        return SharedMesh(self._mesh[1])

    def _follow(self, leader: int, job: SolveJob, start: SharedMesh) -> None:
        """Give a shared mesh the places of a leader, and no others."""
        places = self._places.pop(leader, None)
        if places is None:
            start.kept = places = KeptFits()
            _choose_places(job.leaders[leader], start)
        self._places[leader] = places
        while len(self._places) > MOST_LEADERS:
            del self._places[next(iter(self._places))]
        # What a run adds is for itself.
        start.kept = places.copy()

    def _solve(self, run: RunJob, start: SharedMesh | None, job: SolveJob) -> None:
        case, started = run.case, time.perf_counter()
        self.emit(RunStarted(run.run, case.name, self._name, case.repairs))

        def report(line: str) -> None:
            self.emit(StageEnded(run.run, line, time.perf_counter() - started))

        try:
            if start is not None:
                self._follow(run.leader, job, start)
            finished = finish_case(case, Path(job.out), report, cache=job.cache, start=start)
        except TetluxError as error:
            self.emit(self._failure(run, str(error), started, ends_batch=disk_is_full(error)))
        except Exception as error:  # a fault of one run must not end the others
            if self._raises_faults:
                raise
            fault = f"a fault of tetlux ({type(error).__name__}: {error}); report it with the case file."
            self.emit(self._failure(run, " ".join(fault.split()), started))
        else:
            self.emit(_success(run, finished, time.perf_counter() - started, self._name))

    def _failure(self, run: RunJob, reason: str, started: float, *, ends_batch: bool = False) -> RunFailed:
        seconds = time.perf_counter() - started
        return RunFailed(
            run.run, run.case.name, reason, seconds, self._name, dict(run.case.sweep_values), ends_batch=ends_batch
        )


def _success(run: RunJob, finished: FinishedCase, seconds: float, worker: str) -> RunFinished:
    return RunFinished(
        run.run,
        run.case.name,
        finished.folder,
        finished.summary,
        seconds,
        worker,
        notes=tuple(finished.warnings),
        readings=tuple(finished.readings),
    )


def _choose_places(case: Case, start: SharedMesh) -> None:
    choose_places(
        case.surface,
        [channel.medium for channel in case.channels],
        [list(channel.lights.values()) for channel in case.channels],
        start,
        regions=case.regions,
        tolerance=case.tolerance or case.everywhere_tolerance or case.detector_tolerance or DEFAULT_TOLERANCE,
        detectors=[entry.detector for entry in case.detectors],
        detector_tolerance=case.detector_tolerance,
    )
