"""Worker processes on this machine: started, given jobs, replaced when they die, and stopped."""

import contextlib
import queue
import signal
import subprocess
import threading
from dataclasses import dataclass, field
from typing import IO, Any

from tetlux.cases.batch.events import Event, Listener, RunFailed, RunFinished, RunStarted, WorkerLost
from tetlux.cases.batch.jobs import Job, JobEnded, MeshJob, MeshMade, MeshNotMade, SolveJob, StopAfterRun
from tetlux.cases.batch.launch import Launcher, worker_names
from tetlux.cases.batch.schedule import Batch, Schedule
from tetlux.cases.batch.wire import Sender, receive
from tetlux.cases.interrupts import Interrupts
from tetlux.meshing.errors import RunError

# Workers that die before they have answered anything: there is something wrong with the machine, not with a run.
MOST_DEATHS_AT_START = 3


@dataclass(eq=False)
class _Worker:
    """A worker process, and what it is at."""

    name: str
    process: "subprocess.Popen[bytes]"
    sender: Sender
    job: Job | None = None
    in_flight: tuple[int, str] | None = None
    ended: set[int] = field(default_factory=set)
    has_answered: bool = False
    listener: threading.Thread = field(default_factory=threading.Thread)


@dataclass(frozen=True)
class _Gone:
    """A worker's answers have ended."""


def run_in_processes(batch: Batch, count: int, listener: Listener, launcher: Launcher, interrupts: Interrupts) -> None:
    """Do a batch in worker processes.

    Parameters
    ----------
    batch : Batch
    count : int
        How many.
    listener : callable
        Is called with each event, in this thread.
    launcher : Launcher
    interrupts : Interrupts

    Raises
    ------
    RunError
        If worker processes die as soon as they are started.
    KeyboardInterrupt
        On Ctrl-C, when the runs in flight have ended; at the second one at once.
    """
    pool = _Pool(batch, count, listener, launcher)
    try:
        pool.work(interrupts)
    finally:
        pool.kill()


class _Pool:
    def __init__(self, batch: Batch, count: int, listener: Listener, launcher: Launcher) -> None:
        self._schedule, self._listener, self._count = Schedule(batch), listener, count
        self._launcher = launcher
        launcher.prepare(count)
        # An interrupt is None: as an answer among the others it loses none of them.
        self._answers: queue.SimpleQueue[tuple[_Worker, Any] | None] = queue.SimpleQueue()
        self._workers: list[_Worker] = []
        self._deaths_at_start = 0
        self._stopping = self._interrupted = False

    def work(self, interrupts: Interrupts) -> None:
        """Hand out jobs until all are done."""
        # Putting into a `SimpleQueue` is safe anywhere, also within getting from it.
        with interrupts.tell(lambda: self._answers.put(None)):
            while True:
                self._hand_out()
                if not any(worker.job for worker in self._workers):
                    break
                answer = self._answers.get()
                if answer is None:
                    self._interrupted = True
                    self._stop()
                else:
                    self._take(*answer)
        if self._interrupted:
            raise KeyboardInterrupt

    def kill(self) -> None:
        """End all worker processes."""
        for worker in self._workers:
            worker.process.kill()
        for worker in self._workers:
            _close(worker)

    def _stop(self) -> None:
        """Let the runs in flight end, and begin no others."""
        self._stopping = True
        for worker in self._workers:
            if isinstance(worker.job, SolveJob):
                with contextlib.suppress(OSError):
                    worker.sender.send(StopAfterRun())
            else:
                worker.process.kill()

    def _hand_out(self) -> None:
        """Give each idle worker a job, and start workers while there are jobs for them."""
        while not self._stopping:
            worker = next((worker for worker in self._workers if worker.job is None), None)
            if worker is None and len(self._workers) == self._count:
                return
            job = self._schedule.next_job()
            if job is None:
                return
            if worker is None:
                worker = self._start()
            worker.job, worker.in_flight, worker.ended = job, None, set()
            # A worker that is gone is noticed by the end of its answers.
            with contextlib.suppress(OSError):
                worker.sender.send(job)

    def _start(self) -> _Worker:
        taken = {worker.name for worker in self._workers}
        name = next(name for name in worker_names(self._count) if name not in taken)
        process = self._launcher.take(name, self._count)
        assert process.stdin is not None
        assert process.stdout is not None
        worker = _Worker(name, process, Sender(process.stdin))
        worker.listener = threading.Thread(target=self._listen, args=(worker, process.stdout), daemon=True)
        worker.listener.start()
        self._workers.append(worker)
        return worker

    def _listen(self, worker: _Worker, stream: IO[bytes]) -> None:
        with stream, contextlib.suppress(Exception):  # a worker killed within a message leaves half of it
            for answer in receive(stream):
                self._answers.put((worker, answer))
        self._answers.put((worker, _Gone()))

    def _take(self, worker: _Worker, answer: object) -> None:
        """Take an answer of a worker."""
        worker.has_answered = True
        if isinstance(answer, _Gone):
            self._replace(worker)
        elif isinstance(answer, JobEnded):
            worker.job = worker.in_flight = None
        elif isinstance(answer, MeshMade | MeshNotMade):
            self._schedule.take_mesh(answer)
        else:
            self._note(worker, answer)

    def _note(self, worker: _Worker, event: Any) -> None:
        if isinstance(event, RunStarted):
            worker.in_flight = event.run, event.name
        elif isinstance(event, RunFinished | RunFailed):
            worker.in_flight = None
            worker.ended.add(event.run)
            if isinstance(event, RunFailed) and event.ends_batch:
                self._stop()
        self._emit(event)

    def _replace(self, worker: _Worker) -> None:
        """Put back the job of a worker that died; another one starts when that is handed out."""
        self._workers.remove(worker)
        reason = _reason(_close(worker))
        if worker.job is None or self._stopping:
            return
        self._deaths_at_start += not worker.has_answered
        if self._deaths_at_start >= MOST_DEATHS_AT_START:
            raise RunError(f"worker processes end as soon as they are started: {reason}; try --jobs 1.")
        runs = () if isinstance(worker.job, MeshJob) else tuple(run.run for run in worker.job.runs)
        left = tuple(run for run in runs if run not in worker.ended)
        self._emit(WorkerLost(worker.name, reason, left))
        in_flight = None if worker.in_flight is None else worker.in_flight[0]
        given_up = self._schedule.put_back(worker.job, worker.ended, in_flight)
        if given_up is not None and worker.in_flight is not None:
            text = f"its worker process died twice: {reason}; give a larger tolerance, or fewer --jobs."
            self._emit(RunFailed(given_up, worker.in_flight[1], text, 0.0, worker.name))

    def _emit(self, event: Event) -> None:
        self._listener(event)


def _close(worker: _Worker) -> int:
    """Wait for the end of a process, and return its exit code."""
    if worker.process.stdin is not None:
        with contextlib.suppress(OSError):
            worker.process.stdin.close()
    code = worker.process.wait()
    worker.listener.join()
    return code


def _reason(code: int) -> str:
    """Why a process ended, in words."""
    if code >= 0:
        return f"it ended with exit code {code}"
    with contextlib.suppress(ValueError):
        name = signal.Signals(-code).name
        return f"it was ended by {name}" + (", as by a system that runs out of memory" if name == "SIGKILL" else "")
    return f"it was ended by signal {-code}"
