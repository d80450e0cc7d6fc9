"""Run child processes, each in a temporary folder for its input and output files."""

import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

# Seconds after which unfinished files count as left by a killed process.
ABANDONED = 86_400.0


def abandoned(path: Path) -> bool:
    """Whether a file or folder is too old to belong to a running process."""
    return path.stat().st_mtime < time.time() - ABANDONED


@contextmanager
def scratch(kind: str) -> Iterator[Path]:
    """A folder ``tetlux-<kind>-...`` among the system's temporary files, removed at exit.

    Folders of the same kind that killed processes left are removed after a day.

    Raises
    ------
    OSError
    """
    for path in Path(tempfile.gettempdir()).glob(f"tetlux-{kind}-*"):
        with suppress(OSError):
            if abandoned(path):
                shutil.rmtree(path, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=f"tetlux-{kind}-", ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def run_child(
    command: Sequence[str], folder: Path, seconds: float, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder; it never outlives this call.

    Raises
    ------
    subprocess.TimeoutExpired
        If it exceeds the time limit.
    OSError
        If it cannot be started.
    """
    with subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
    ) as process:
        try:
            output, messages = process.communicate(timeout=max(seconds, 0.0))
        except BaseException:
            # subprocess.run kills the child on Ctrl-C without waiting for its end.
            process.kill()
            process.wait()
            raise
    return subprocess.CompletedProcess(command, process.returncode, output, messages)
