"""Interrupts: Ctrl-C, SIGTERM of a scheduler and SIGHUP of a closing terminal end a run alike, but no writing."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


def treat_signals_as_interrupts() -> None:
    """Make SIGTERM and SIGHUP raise KeyboardInterrupt as SIGINT does, so that what is begun is cleaned up."""
    if _handles_signals():
        for number in SIGNALS:
            # nohup ignores SIGHUP, which must stay so.
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, signal.default_int_handler)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let an interrupt wait for the end of the block, which must be short.

    Within a listener to a batch it would leave tables locked and rows out.

    Raises
    ------
    KeyboardInterrupt
        At the end of the block, if there was an interrupt.
    """
    held = [each for each in SIGNALS if signal.getsignal(each) is signal.default_int_handler]
    if not held or not _handles_signals():
        yield
        return
    came = []

    def note(number: int, _: FrameType | None) -> None:
        came.append(number)

    for each in held:
        signal.signal(each, note)
    try:
        yield
    finally:
        for each in held:
            signal.signal(each, signal.default_int_handler)
    if came:
        raise KeyboardInterrupt


def _handles_signals() -> bool:
    """Whether this is the thread whose signal handlers Python calls."""
    return threading.current_thread() is threading.main_thread()
