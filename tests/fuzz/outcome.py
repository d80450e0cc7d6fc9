"""What the command line made of an input, and whether that is what it promises."""

import contextlib
import io
import re
import signal
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import FrameType

from tetlux.cases.cli import main

# Seconds of CPU time that a check of any input may take.
LIMIT = 20.0
# Words that no user should read.
JARGON = re.compile(
    r"Traceback|NoneType|Errno|<class|has no attribute|object at 0x|datetime\.|dtype|(?<!!!)\bint\b|(?<!!!)\bstr\b|pydantic|ndarray"
)
LONGEST_SENTENCE = 1_000


@dataclass(frozen=True)
class Outcome:
    """One input's end.

    Attributes
    ----------
    name : str
    code : int, optional
        The exit code, if there was one.
    words : str
        What was printed as an error; of a right case what was printed.
    violation : str
        What is wrong with it, or nothing.
    seconds : float
    """

    name: str
    code: int | None
    words: str
    violation: str
    seconds: float = 0.0

    @property
    def ending(self) -> str:
        """The row of the table that it counts in."""
        if self.violation:
            return "VIOLATION"
        return {0: "right, or runs with its repairs listed", 1: "failed: exit code 1", 2: "refused: exit code 2"}[
            self.code or 0
        ]


class OverLimitError(BaseException):
    """The time is over; no reader that catches every exception catches this one."""


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise OverLimitError in the main thread after so many seconds of CPU time, or ten times as many in all."""

    def stop(_: int, __: FrameType | None) -> None:
        raise OverLimitError

    timers = {signal.SIGPROF: (signal.ITIMER_PROF, seconds), signal.SIGALRM: (signal.ITIMER_REAL, 10.0 * seconds)}
    before = {number: signal.signal(number, stop) for number in timers}
    for timer, limit in timers.values():
        signal.setitimer(timer, limit)
    try:
        yield
    finally:
        for timer, _ in timers.values():
            signal.setitimer(timer, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


def outcome_of(name: str, arguments: Sequence[str], limit: float = LIMIT, allowed: tuple[int, ...] = (0, 2)) -> Outcome:
    """Run the command line within this process, and judge how it ends."""
    out, err = io.StringIO(), io.StringIO()
    started = time.perf_counter()
    code: int | None = None
    violation = ""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), limited(limit):
                code = main(arguments)
        except OverLimitError:
            violation = f"took more than {limit:g} s"
        except BaseException as error:
            where = traceback.extract_tb(error.__traceback__)
            own = [frame for frame in where if "tetlux" in frame.filename or "/meshing/" in frame.filename] or where
            place = f"{own[-1].filename}:{own[-1].lineno}"
            violation = f"{type(error).__name__}: {str(error)[:200]} at {place}"
    seconds = time.perf_counter() - started
    words = err.getvalue() if code else out.getvalue()
    violation = violation or complaint(code, out.getvalue(), err.getvalue(), allowed)
    if caught and not violation:
        first = caught[0]
        violation = f"{first.category.__name__}: {first.message} at {first.filename}:{first.lineno}"
    return Outcome(name, code, words.strip(), violation, seconds)


def complaint(code: int | None, out: str, err: str, allowed: tuple[int, ...]) -> str:
    """What is wrong with what was printed, or nothing."""
    if code not in allowed:
        return f"exit code {code}: {err}"
    if code == 0:
        return f"exit code 0 with an error: {err}" if err else ""
    lines = err.splitlines()
    sentence = lines[0] if lines else ""
    if code == 2 and (len(lines) != 1 or out):
        return f"not one sentence: {err!r}"
    if not sentence.startswith("tetlux: ") or not err.endswith(".\n"):
        return f"no sentence: {err!r}"
    if len(sentence) > LONGEST_SENTENCE:
        return f"a sentence of {len(sentence)} characters: {sentence[:200]!r}"
    if JARGON.search(sentence):
        return f"jargon: {sentence!r}"
    if not sentence.isprintable():
        return f"unprintable: {sentence!r}"
    return ""
