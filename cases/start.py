"""The start of a command: when it was, so that the seconds of its first run count from there, and its imports."""

import gc
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType


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
    """Import the solver and its libraries in less time.

    No garbage is collected meanwhile, nor looked for later in what they made: there is hardly any, and looking for it
    takes a fifth of the time. SciPy copies all names of NumPy, of which NumPy imports one only when it is looked at,
    its translator of Fortran, a tenth of the time.
    """
    if "numpy" in sys.modules or not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        with _without(import_module("numpy"), "f2py"):
            yield
        gc.freeze()
    finally:
        gc.enable()


@contextmanager
def _without(module: ModuleType, name: str) -> Iterator[None]:
    """Let None stand for a submodule that would be imported when it is looked at."""
    vars(module).setdefault(name, None)
    try:
        yield
    finally:
        if vars(module).get(name) is None:
            vars(module).pop(name, None)
