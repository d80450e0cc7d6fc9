"""The start of a command: when it was, so that the seconds of its first run count from there, and its imports."""

import gc
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager


class _Clock:
    started: float | None = None


def mark_start() -> None:
    """Say that the command starts now."""
    _Clock.started = time.perf_counter()


def take_start_seconds() -> float:
    """Seconds since the command started, the first time that it is asked; 0 later, or if nothing was started."""
    started, _Clock.started = _Clock.started, None
    return 0.0 if started is None else time.perf_counter() - started


@contextmanager
def first_imports() -> Iterator[None]:
    """Collect no garbage while the solver and its libraries are imported, nor look at what they made later on.

    There is hardly any, and looking for it takes a fifth of the time.
    """
    if "numpy" in sys.modules or not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
        gc.freeze()
    finally:
        gc.enable()
