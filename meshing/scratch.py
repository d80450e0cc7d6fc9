"""Temporary folders: what goes to other processes and comes back from them."""

import shutil
import tempfile
import time
from collections.abc import Iterator
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
