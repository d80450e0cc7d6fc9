"""Starts worker processes, also before it is known what they are to do: libraries load while cases are read."""

import glob
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

# These two are as in `tetlux.meshing.host.blocks`, which takes half a second to import: the first worker starts before.
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
THREADS_VARIABLE = "TETLUX_THREADS"

# Libraries read these when they are imported. Each worker has one thread, as many workers as there are cores.
THREAD_LIMITS = dict.fromkeys(
    (
        THREADS_VARIABLE,
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "BLIS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMBA_NUM_THREADS",
        "NUMEXPR_NUM_THREADS",
        "VTK_SMP_MAX_THREADS",
    ),
    "1",
)


class Launcher:
    """Starts worker processes; at its end those that nobody has taken are ended.

    Examples
    --------
    >>> from tetlux.cases.batch.launch import Launcher
    >>> with Launcher() as launcher:
    ...     launcher.prepare(2)
    ...     process = launcher.take("1", 2)
    ...     with process:
    ...         process.kill()
    """

    def __init__(self) -> None:
        self._count = 0
        self._unstarted: list[str] = []
        self._early: dict[str, subprocess.Popen[bytes]] = {}

    def start_first(self, count: int) -> None:
        """Start the process of the first of so many workers, before it is known how many there will be."""
        self._end()
        if count > 1:
            self._count, self._unstarted = count, worker_names(count)[1:]
            self._early = {"1": _start("1", count)}

    def prepare(self, count: int) -> None:
        """Start the processes of so many workers, those that have not been started."""
        if count != self._count:
            self._end()
            self._count, self._unstarted = count, worker_names(count) if count > 1 else []
        self._early |= {name: _start(name, count) for name in self._unstarted}
        self._unstarted = []

    def take(self, name: str, count: int) -> "subprocess.Popen[bytes]":
        """The process of a worker, one of so many: a prepared one, or a new one."""
        early = self._early.pop(name, None) if count == self._count else None
        return early or _start(name, count)

    def __enter__(self) -> "Launcher":
        """Return it."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes that nobody has taken."""
        self._end()

    def _end(self) -> None:
        for process in self._early.values():
            process.kill()
            with process:  # closes its pipes and waits
                pass
        self._early = {}


def seem_many(requests: Sequence[str]) -> bool:
    """Whether case files are likely to have many runs, found without reading them: several files, or a sweep."""
    if len(requests) != 1 or glob.has_magic(requests[0]):
        return True
    try:
        return re.search(r"^sweep:", Path(requests[0]).read_text(encoding="utf-8"), re.MULTILINE) is not None
    except (OSError, ValueError):
        return False


def worker_names(count: int) -> list[str]:
    """The names of so many workers."""
    return [str(number) for number in range(1, count + 1)]


def _start(name: str, count: int) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "tetlux.cases.batch.worker", name, str(count), str(os.getpid())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **THREAD_LIMITS},
        # Ctrl-C is for this process, which then asks them to stop.
        start_new_session=True,
    )
