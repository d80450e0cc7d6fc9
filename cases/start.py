"""When the command started, so that the seconds of its first run count from there."""

import time


class _Clock:
    started: float | None = None


def mark_start() -> None:
    """Say that the command starts now."""
    _Clock.started = time.perf_counter()


def take_start_seconds() -> float:
    """Seconds since the command started, the first time that it is asked; 0 later, or if nothing was started."""
    started, _Clock.started = _Clock.started, None
    return 0.0 if started is None else time.perf_counter() - started
