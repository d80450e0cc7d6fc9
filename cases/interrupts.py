"""Interrupts: Ctrl-C, SIGTERM of a scheduler and SIGHUP of a closing terminal end a run alike, but no writing."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


def treat_signals_as_interrupts() -> None:
    """Make SIGTERM and SIGHUP raise KeyboardInterrupt as SIGINT does, so that what is begun is cleaned up."""
    if _handles_signals():
        for number in SIGNALS:
            # nohup ignores SIGHUP, which must stay so.
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, signal.default_int_handler)


class Interrupts:
    """Interrupts that can be made to wait, as long as the block lasts that this opens.

    Within a listener to a batch an interrupt would leave tables locked and rows out. Handlers are set once for a batch:
    an interrupt while they are set for each event would leave some unset.

    Examples
    --------
    >>> from tetlux.cases.interrupts import Interrupts
    >>> with Interrupts() as interrupts:
    ...     with interrupts.wait():
    ...         print("written")
    written
    """

    def __init__(self) -> None:
        self._held: list[int] = []
        self._must_wait = self._came = False
        self._tell: Callable[[], None] | None = None

    def __enter__(self) -> "Interrupts":
        """Take the place of what raises KeyboardInterrupt, where that is set."""
        if _handles_signals():
            self._held = [each for each in SIGNALS if signal.getsignal(each) is signal.default_int_handler]
        for each in self._held:
            signal.signal(each, self._take)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Set what was there before."""
        for each in self._held:
            signal.signal(each, signal.default_int_handler)

    @contextmanager
    def wait(self) -> Iterator[None]:
        """Let an interrupt wait for the end of the block, which must be short."""
        self._must_wait = True
        try:
            yield
        finally:
            self._must_wait = False
        if self._came:
            self._came = False
            self._pass_on()

    @contextmanager
    def tell(self, tell: Callable[[], None]) -> Iterator[None]:
        """Within the block, call `tell` at the first interrupt, at any place; the second one raises."""
        self._tell = tell
        try:
            yield
        finally:
            self._tell = None

    def _take(self, _number: int, _frame: FrameType | None) -> None:
        if self._must_wait:
            self._came = True
        else:
            self._pass_on()

    def _pass_on(self) -> None:
        if self._tell is None:
            raise KeyboardInterrupt
        tell, self._tell = self._tell, None
        tell()


def _handles_signals() -> bool:
    """Whether this is the thread whose signal handlers Python calls."""
    return threading.current_thread() is threading.main_thread()
