"""`Progress`: where a batch is, counted from its events, for displays."""

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from tetlux.cases.batch.events import (
    BatchStarted,
    Event,
    MeshFinished,
    MeshStarted,
    RunFailed,
    RunFinished,
    RunStarted,
    WorkerLost,
)
from tetlux.meshing.notes import Note

# The rate is that of so many last runs.
RECENT = 50
# Runs that are named beside a reason or a note.
MOST_NAMED = 3


@dataclass
class Progress:
    """Counts the events of a batch.

    Attributes
    ----------
    clock : callable
        Returns seconds.
    total, finished, kept, failed : int
        Runs: all, and by outcome.
    working : dict
        What each worker does, and since when.
    failures : dict of str to list of str
        Names of runs by the reason of their failure.
    notes : dict of str to list of str
        Names of runs by warning, of which those of one code count as one: that of the first run.
    """

    clock: Callable[[], float] = time.monotonic
    total: int = 0
    finished: int = 0
    kept: int = 0
    failed: int = 0
    working: dict[str, tuple[str, float]] = field(default_factory=dict)
    failures: dict[str, list[str]] = field(default_factory=dict)
    notes: dict[str, list[str]] = field(default_factory=dict)
    _first_notes: dict[str, str] = field(default_factory=dict)
    _started: float = 0.0
    _ends: deque[float] = field(default_factory=lambda: deque(maxlen=RECENT + 1))

    def take(self, event: Event) -> None:
        """Count an event."""
        if isinstance(event, BatchStarted):
            self.total, self._started = len(event.names), self.clock()
            self._ends.append(self._started)
        elif isinstance(event, MeshStarted):
            runs = f"{event.runs:,} runs" if event.runs > 1 else "1 run"
            self.working[event.worker] = (f"mesh of {runs}", self.clock())
        elif isinstance(event, MeshFinished):
            self.working.pop(event.worker, None)
        elif isinstance(event, RunStarted):
            self.working[event.worker] = (event.name, self.clock())
        elif isinstance(event, RunFinished | RunFailed):
            self._end(event)
        elif isinstance(event, WorkerLost):
            self.working.pop(event.worker, None)

    def _end(self, event: RunFinished | RunFailed) -> None:
        self.working.pop(event.worker, None)
        if isinstance(event, RunFailed):
            self.failed += 1
            self.failures.setdefault(event.reason, []).append(event.name)
        elif event.kept:
            self.kept += 1
            return
        else:
            self.finished += 1
            for code, note in {_code(note): note for note in event.notes}.items():
                first = self._first_notes.setdefault(code, note)
                self.notes.setdefault(first, []).append(event.name)
        self._ends.append(self.clock())

    @property
    def left(self) -> int:
        """Runs that have not ended."""
        return self.total - self.finished - self.kept - self.failed

    @property
    def seconds(self) -> float:
        """Since the batch began."""
        return self.clock() - self._started

    @property
    def rate(self) -> float | None:
        """Runs a second, of the last ones until now; None before the first has ended."""
        if len(self._ends) < 2:
            return None
        return (len(self._ends) - 1) / max(self.clock() - self._ends[0], 1e-9)

    @property
    def seconds_left(self) -> float | None:
        """How long the rest takes at this rate."""
        return None if self.rate is None else self.left / self.rate

    def describe(self) -> str:
        """One line: runs done, failed and left, rate, and time to go."""
        parts = [f"{self.finished + self.kept:,} of {self.total:,} runs done"]
        if self.kept:
            parts[0] += f" ({self.kept:,} kept)"
        parts += [f"{self.failed:,} failed", f"{self.left:,} left"]
        if self.rate is not None:
            parts.append(describe_rate(self.rate))
        if self.seconds_left is not None and self.left:
            parts.append(f"{describe_seconds(self.seconds_left)} to go")
        return ", ".join(parts)


def _code(note: str) -> str:
    """What a warning has in common with those of other runs, whose figures may differ."""
    return f"{note.region} {note.code}" if isinstance(note, Note) else note


def describe_rate(rate: float) -> str:
    """A rate for people: runs a second, or seconds a run."""
    return f"{rate:.3g} runs/s" if rate >= 1 else f"{1 / rate:.3g} s a run"


def describe_seconds(seconds: float) -> str:
    """A time for people: ``42 s``, ``3 min 20 s``, ``5 h 3 min``."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def list_by_sentence(names: Mapping[str, list[str]]) -> list[str]:
    """Lines of sentences with how many runs each is of, the most frequent first, and the names of some of them."""
    lines = []
    for sentence, runs in sorted(names.items(), key=lambda item: -len(item[1])):
        more = f" and {len(runs) - MOST_NAMED:,} more" if len(runs) > MOST_NAMED else ""
        count = "1 run" if len(runs) == 1 else f"{len(runs):,} runs"
        lines.append(f"{count}: {sentence} ({', '.join(runs[:MOST_NAMED])}{more})")
    return lines
