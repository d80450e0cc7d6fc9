"""`Schedule`: which jobs of a plan can be done now, and what becomes of those whose worker died."""

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

from tetlux.cases.batch.grouping import spread
from tetlux.cases.batch.jobs import Job, MeshData, MeshJob, MeshMade, MeshNotMade, RunJob, SolveJob
from tetlux.cases.batch.mesh_store import MeshStore
from tetlux.cases.batch.plan import Plan, PlannedMesh, PlannedTask
from tetlux.cases.file.case import Case

# A mesh is graded for the lights of so many runs at most.
MOST_GRADED = 60
# A run whose worker died so often is taken to be the reason.
MOST_DEATHS = 2


@dataclass(frozen=True, eq=False)
class Batch:
    """What is to be done.

    Attributes
    ----------
    plan : Plan
    cases : sequence of Case
        By the number of the run.
    done : frozenset of int
        Runs that an earlier batch finished.
    out : str
    cache : bool
    store : MeshStore
        Where meshes of groups are kept until the batch is complete.
    """

    plan: Plan
    cases: Sequence[Case]
    done: frozenset[int]
    out: str
    cache: bool
    store: MeshStore


class Schedule:
    """Hands out jobs: meshes first, and tasks when their mesh is there."""

    def __init__(self, batch: Batch) -> None:
        self._batch = batch
        self._ready: deque[Job] = deque()
        self._waiting: dict[int, list[PlannedTask]] = {}
        self._deaths: Counter[int] = Counter()
        tasks: dict[int, list[PlannedTask]] = {}
        for task in batch.plan.tasks:
            if not batch.done.issuperset(task.runs):
                tasks.setdefault(task.mesh, []).append(task)
        self._groups = deque((mesh, tasks[mesh.number]) for mesh in batch.plan.meshes if mesh.number in tasks)

    def next_job(self) -> Job | None:
        """A job that can be done now; None if there is none, or none until some mesh is made."""
        while not self._ready and self._groups:
            self._open(*self._groups.popleft())
        return self._ready.popleft() if self._ready else None

    def take_mesh(self, answer: MeshMade | MeshNotMade) -> None:
        """Make the tasks of a mesh ready."""
        data = answer.data if isinstance(answer, MeshMade) else None
        if data is not None:
            self._batch.store.save(answer.mesh, data)
        self._make_ready(self._waiting.pop(answer.mesh), data)

    def put_back(self, job: Job, ended: set[int], in_flight: int | None) -> int | None:
        """Put back what is left of a job whose worker died, without the runs that have ended.

        Returns the number of the run that it was at, if that is to be given up.
        """
        if isinstance(job, MeshJob):
            self._deaths[-1 - job.mesh] += 1
            if self._deaths[-1 - job.mesh] < MOST_DEATHS:
                self._ready.appendleft(job)
            else:
                self.take_mesh(MeshNotMade(job.mesh))
            return None
        given_up = None
        if in_flight is not None:
            self._deaths[in_flight] += 1
            if self._deaths[in_flight] >= MOST_DEATHS:
                given_up = in_flight
        gone = ended if given_up is None else ended | {given_up}
        left = tuple(run for run in job.runs if run.run not in gone)
        if left:
            self._ready.appendleft(replace(job, runs=left))
        return given_up

    def _open(self, mesh: PlannedMesh, tasks: list[PlannedTask]) -> None:
        """Begin with a group: with its mesh, if it has one and that is not kept from an earlier batch."""
        kept = self._batch.store.load(mesh.number) if mesh.pilots else None
        if kept is None and mesh.pilots:
            self._waiting[mesh.number] = tasks
            self._ready.append(self._mesh_job(mesh))
        else:
            self._make_ready(tasks, kept)

    def _mesh_job(self, mesh: PlannedMesh) -> MeshJob:
        of_group = sorted(run for task in self._batch.plan.tasks if task.mesh == mesh.number for run in task.runs)
        others = [run for run in spread(of_group, MOST_GRADED) if run not in mesh.pilots]
        cases = tuple(self._batch.cases[run] for run in [*mesh.pilots, *others])
        return MeshJob(mesh.number, mesh.runs, cases, len(mesh.pilots), self._batch.cache)

    def _make_ready(self, tasks: list[PlannedTask], data: MeshData | None) -> None:
        batch = self._batch
        for task in tasks:
            left = [run for run in task.runs if run not in batch.done]
            runs = tuple(RunJob(run, batch.cases[run], batch.plan.leaders[run]) for run in left)
            leaders = {run.leader: batch.cases[run.leader] for run in runs}
            self._ready.append(SolveJob(task.number, task.mesh, data, runs, leaders, batch.out, batch.cache))
