"""Run child processes, each in a temporary folder for its input and output files."""

import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

# An unfinished file older than this, seconds, belongs to no running process: a day.
UNFINISHED_AGE = 86_400.0


def is_abandoned(path: Path) -> bool:
    """Whether a file or folder is too old to belong to a running process."""
    return path.stat().st_mtime < time.time() - UNFINISHED_AGE


@contextmanager
def scratch(kind: str) -> Iterator[Path]:
    """Make a folder ``tetlux-<kind>-...`` among the system's temporary files, and remove it at the end.

    Folders of the same kind that are older than a day are removed too: their processes were killed.

    Raises
    ------
    OSError
    """
    for path in Path(tempfile.gettempdir()).glob(f"tetlux-{kind}-*"):
        with suppress(OSError):
            if is_abandoned(path):
                shutil.rmtree(path, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=f"tetlux-{kind}-", ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def run_child(
    command: Sequence[str], folder: Path, seconds: float, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder; its process has always ended when this returns or raises.

    Raises
    ------
    subprocess.TimeoutExpired
        If it takes longer than `seconds`.
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
