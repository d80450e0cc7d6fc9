"""Work that other processes do, each in a temporary folder, where it gets and leaves its files."""

import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

# Seconds after which what is unfinished was left by a process that was killed.
ABANDONED = 86_400.0


def abandoned(path: Path) -> bool:
    """Whether a file or folder of a process that is at work would be newer than this one is."""
    return path.stat().st_mtime < time.time() - ABANDONED


@contextmanager
def scratch(kind: str) -> Iterator[Path]:
    """A folder ``tetlux-<kind>-...`` where the system keeps temporary files, gone afterwards.

    What killed processes left of the same kind is removed after a day.

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
    """Run a command in a folder; it ends with this call, however that ends.

    Raises
    ------
    subprocess.TimeoutExpired
        If it takes longer than so many seconds.
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
            # subprocess.run would not wait for the end of what Ctrl-C makes it kill.
            process.kill()
            process.wait()
            raise
    return subprocess.CompletedProcess(command, process.returncode, output, messages)
