"""A batch on a Dask cluster: the same jobs, whose scheduler, data movement and repetition are Dask's.

Surfaces and meshes are scattered, so that each travels to a worker once. Where a worker sees the folder of results it
writes into it; elsewhere files come back as bytes. Credentials and encryption are Dask's configuration: whoever reaches
an open scheduler can run any code on its workers.
"""

import json
import logging
import os
import platform
import socket
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from tetlux import __version__
from tetlux.cases.batch.events import Event, Listener, RunFailed, RunFinished
from tetlux.cases.batch.jobs import Job, MeshJob, MeshMade, MeshNotMade, SolveJob
from tetlux.cases.batch.schedule import Batch, Schedule
from tetlux.cases.batch.wire import pack, unpack
from tetlux.cases.batch.workshop import Workshop
from tetlux.cases.run import ALL_FILES
from tetlux.cases.write.content import NUMERICS
from tetlux.cases.write.publish import claim_folder, publish, write_error
from tetlux.meshing.errors import InputError, RunError

# Seconds to wait for the scheduler, and for its first worker.
PATIENCE = 10
SCHEMES = ("tcp", "tls", "ws", "wss")
INSTALL = "pip install 'tetlux[cluster]'"

_Files = dict[str, bytes]
_Results = list[tuple[Event, _Files]]


def run_on_cluster(batch: Batch, client: Any, listener: Listener) -> None:
    """Do a batch on the workers of a Dask scheduler.

    Parameters
    ----------
    batch : Batch
    client : distributed.Client
        From `connect`.
    listener : callable
        Is called with each event, in this thread.

    Raises
    ------
    RunError
        If the scheduler is lost.
    """
    with _probe(Path(batch.out)) as probe:
        _Cluster(batch, client, str(probe), listener).work()


@contextmanager
def connect(scheduler: str) -> Iterator[Any]:
    """Connect to a scheduler whose workers can do the work.

    Parameters
    ----------
    scheduler : str
        Its address, as ``tcp://host:port``, or the path of a scheduler file.

    Yields
    ------
    distributed.Client

    Raises
    ------
    InputError
        If there is no such scheduler, it has no workers, or these have another version of tetlux or Python.
    """
    try:
        from distributed import Client  # noqa: PLC0415
    except ImportError as error:
        raise InputError(f"--scheduler needs Dask distributed; install it by {INSTALL}.") from error
    # What Dask logs of lost connections is said here in one sentence.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    is_file = "://" not in scheduler and not scheduler.rpartition(":")[2].isdecimal()
    if is_file and not Path(scheduler).is_file():
        raise InputError(f"{scheduler} is no scheduler file; give that of dask scheduler, or tcp://host:port.")
    where: dict[str, Any] = {"scheduler_file": scheduler} if is_file else {"address": scheduler}
    try:
        _check_answer(json.loads(Path(scheduler).read_text(encoding="utf-8"))["address"] if is_file else scheduler)
        client = Client(**where, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError, KeyError, TimeoutError) as error:
        raise InputError(
            f"no Dask scheduler answers at {scheduler}; start one with dask scheduler, or leave --scheduler out."
        ) from error
    try:
        _check_workers(client, scheduler)
        yield client
    finally:
        client.close(timeout=2)


def _check_answer(address: str) -> None:
    """Raise OSError or ValueError where no scheduler is: a client would wait for one for minutes."""
    scheme, _, place = address.rpartition("://")
    if scheme not in ("", *SCHEMES):
        raise ValueError(scheme)
    host, _, port = place.rpartition(":")
    with socket.create_connection((host.strip("[]"), int(port)), timeout=PATIENCE) as connection:
        # A scheduler speaks first, unless the connection is encrypted.
        if scheme in ("", "tcp") and not connection.recv(1):
            raise OSError(f"{address} closes the connection")


def _check_workers(client: Any, scheduler: str) -> None:
    """Refuse a cluster without workers, or with other versions."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        raise InputError(f"the scheduler at {scheduler} has no workers; start some with dask worker.") from error
    own = _versions(__version__, NUMERICS)

    def ask() -> str:
        # Pickled by value, since tetlux may be missing there.
        import platform  # noqa: PLC0415

        try:
            import tetlux  # noqa: PLC0415
            from tetlux.cases.write.content import NUMERICS  # noqa: PLC0415
        except ImportError:
            return f"Python {platform.python_version()} without tetlux"
        python = ".".join(platform.python_version_tuple()[:2])
        return f"tetlux {tetlux.__version__} (numerics {NUMERICS}) on Python {python}"

    for worker, answer in client.run(ask, on_error="return").items():
        versions = f"libraries that fail ({type(answer).__name__})" if isinstance(answer, BaseException) else answer
        if versions != own:
            raise InputError(f"the worker {worker} has {versions}, and here is {own}; install the same on both.")


def _versions(version: str, numerics: int) -> str:
    python = ".".join(platform.python_version_tuple()[:2])
    return f"tetlux {version} (numerics {numerics}) on Python {python}"


@contextmanager
def _probe(out: Path) -> Iterator[Path]:
    """A file beside the results, by which workers see whether they share the folder."""
    with tempfile.NamedTemporaryFile(dir=out, prefix=".probe-") as file:
        yield Path(file.name).absolute()


class _Cluster:
    def __init__(self, batch: Batch, client: Any, probe: str, listener: Listener) -> None:
        self._batch, self._client, self._probe, self._listener = batch, client, probe, listener
        self._schedule = Schedule(batch)
        self._scattered: dict[int, tuple[object, Any]] = {}
        self._jobs: dict[Any, Job] = {}
        self._must_stop = False

    def work(self) -> None:
        """Submit jobs as they become possible, and take their results as they come."""
        from distributed import as_completed  # noqa: PLC0415

        pending = as_completed(loop=self._client.loop)
        try:
            while not self._must_stop:
                while (job := self._schedule.next_job()) is not None:
                    pending.add(self._submit(job))
                if not self._jobs:
                    return
                future = next(pending)
                for again in self._take(future, self._jobs.pop(future)):
                    pending.add(self._submit(again))
        finally:
            self._client.cancel(list(self._jobs))

    def _submit(self, job: Job) -> Any:
        data, shared = pack(job)
        futures = [self._scatter(key, obj) for key, obj in shared.items()]
        work = adapt_remotely if isinstance(job, MeshJob) else partial(solve_remotely, probe=self._probe)
        future = self._client.submit(work, data, list(shared), *futures, pure=False)
        self._jobs[future] = job
        return future

    def _scatter(self, key: int, obj: object) -> Any:
        # The object is kept too, so that no other gets its number.
        if key not in self._scattered:
            self._scattered[key] = obj, self._client.scatter(obj, hash=False)
        return self._scattered[key][1]

    def _take(self, future: Any, job: Job) -> list[Job]:
        """Take the result of a job; return the jobs that are to be done in its place if its worker died."""
        if future.status != "finished":
            return self._repeat(future, job)
        result = future.result()
        if isinstance(job, MeshJob):
            events, answer = result
            for event in events:
                self._listener(event)
            self._schedule.take_mesh(answer)
            return []
        for event, files in result:
            self._deliver(event, files)
        return []

    def _deliver(self, event: Event, files: _Files) -> None:
        if isinstance(event, RunFinished):
            out = Path(self._batch.out)
            if files:
                try:
                    _write_files(out, event.name, files)
                except RunError as error:
                    event = RunFailed(event.run, event.name, str(error), event.seconds, event.worker, ends_batch=True)
            if isinstance(event, RunFinished):
                event = replace(event, folder=out / event.name)
        if isinstance(event, RunFailed) and event.ends_batch:
            self._must_stop = True
        self._listener(event)

    def _repeat(self, future: Any, job: Job) -> list[Job]:
        """What to do when Dask has given a job up: each of its runs by itself, so that only the faulty one fails."""
        error = future.exception() if future.status == "error" else None
        if error is None:
            raise RunError("the connection to the scheduler is lost; what is finished is kept for --resume.")
        if isinstance(job, MeshJob):
            self._schedule.take_mesh(MeshNotMade(job.mesh))
            return []
        if len(job.runs) > 1:
            return [replace(job, runs=(run,), leaders={run.leader: job.leaders[run.leader]}) for run in job.runs]
        (run,) = job.runs
        reason = " ".join(f"the cluster gave it up: {type(error).__name__}: {error}".split())
        self._listener(RunFailed(run.run, run.case.name, reason, 0.0, "", dict(run.case.sweep_values)))
        return []


def _write_files(out: Path, name: str, files: _Files) -> None:
    """Write the files of a run that came back as bytes."""
    with claim_folder(out, name) as folder:
        try:
            for file, content in files.items():
                (folder / file).write_bytes(content)
            publish(folder, out / name, ALL_FILES)
        except OSError as error:
            raise write_error(out, name, error) from error


# A worker may have several threads, but the solver has its own, and caches that are not for several.
_ONE_AT_A_TIME = threading.Lock()


@cache
def _workshop() -> Workshop:
    """The workshop of this worker process, which keeps its last mesh."""
    return Workshop(f"{socket.gethostname()}:{os.getpid()}", lambda _: None)


def adapt_remotely(data: bytes, keys: list[int], *shared: object) -> tuple[list[Event], MeshMade | MeshNotMade]:
    """Adapt a mesh on a worker."""
    job: MeshJob = unpack(data, dict(zip(keys, shared, strict=True)))
    events: list[Event] = []
    with _ONE_AT_A_TIME:
        workshop = _workshop()
        workshop.emit = events.append
        return events, workshop.adapt(job)


def solve_remotely(data: bytes, keys: list[int], *shared: object, probe: str) -> _Results:
    """Solve the runs of a task on a worker; files are returned if it does not see the folder of results."""
    job: SolveJob = unpack(data, dict(zip(keys, shared, strict=True)))
    events: list[Event] = []
    with _ONE_AT_A_TIME, tempfile.TemporaryDirectory() as own:
        shares_folder = Path(probe).is_file()
        workshop = _workshop()
        workshop.emit = events.append
        workshop.solve(job if shares_folder else replace(job, out=own))
        ends = [event for event in events if isinstance(event, RunFinished | RunFailed)]
        return [(event, {} if shares_folder else _read_files(event)) for event in ends]


def _read_files(event: RunFinished | RunFailed) -> _Files:
    """The files of a finished run."""
    if isinstance(event, RunFailed):
        return {}
    return {path.name: path.read_bytes() for path in event.folder.iterdir()}
