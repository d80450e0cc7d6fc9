"""`Lines`: prints what happens in a batch, a line for each stage of each run."""

import sys
from collections import Counter
from pathlib import Path

from tetlux.cases.batch.events import (
    BatchEnded,
    BatchStarted,
    Event,
    MeshFinished,
    RunFailed,
    RunFinished,
    RunStarted,
    StageEnded,
    WorkerLost,
)

# A warning names its runs of a sweep if they are no more than this; summaries always hold it.
MOST_NAMED = 3


class Lines:
    """A listener that prints. Lines of runs beside each other begin with the number of the run."""

    def __init__(self) -> None:
        self._started = BatchStarted((), Path(), 1)
        self._runs_left: Counter[str] = Counter()
        self._runs: dict[str, int] = {}
        self._names_by_note: dict[str, dict[str, list[str]]] = {}

    def __call__(self, event: Event) -> None:
        """Print an event."""
        if isinstance(event, BatchStarted):
            self._begin(event)
        elif isinstance(event, RunStarted) and self._started.workers == 1:
            print(f"{self._number(event.run)} {event.name}", flush=True)
            for note in event.repairs:
                print(f"  repaired: {note}")
        elif isinstance(event, StageEnded) and self._started.workers == 1:
            _print_stage(event.seconds, event.text)
        elif isinstance(event, MeshFinished):
            print(f"mesh of a group: {event.tetrahedra:,} tetrahedra in {event.seconds:.1f} s", flush=True)
        elif isinstance(event, RunFinished | RunFailed):
            self._finish(event)
        elif isinstance(event, WorkerLost):
            _warn(f"worker {event.worker} is lost: {event.reason}; its runs are done again.")
        elif isinstance(event, BatchEnded) and event.failed:
            _warn(f"{event.failed} of {len(self._started.names)} cases failed.")

    def _begin(self, event: BatchStarted) -> None:
        self._started = event
        self._runs_left = Counter(event.sources)
        self._runs = dict(self._runs_left)

    def _number(self, run: int) -> str:
        return f"[{run + 1}/{len(self._started.names)}]"

    def _finish(self, event: RunFinished | RunFailed) -> None:
        source = self._started.sources[event.run]
        alone = self._runs[source] == 1
        if isinstance(event, RunFailed):
            _warn(f"{event.name} failed: {event.reason}")
        elif event.kept:
            print(f"{self._number(event.run)} {event.name}: kept", flush=True)
        else:
            if self._started.workers > 1:
                print(f"{self._number(event.run)} {event.name}", flush=True)
            for line in event.readings:
                _print_stage(event.seconds, line)
            for note in event.notes:
                if alone:
                    _print_stage(event.seconds, f"note: {note}")
                else:
                    self._names_by_note.setdefault(source, {}).setdefault(note, []).append(event.name)
            _print_stage(event.seconds, f"written to {event.folder}")
        self._runs_left[source] -= 1
        if self._runs_left[source] == 0:
            self._print_notes(source)

    def _print_notes(self, source: str) -> None:
        """Print the warnings of a sweep, each once, when its last run has ended."""
        runs = self._runs[source]
        for note, names in self._names_by_note.pop(source, {}).items():
            where = f"all {runs} runs" if len(names) == runs else f"{len(names)} of {runs} runs"
            named = f" ({', '.join(names)})" if len(names) <= MOST_NAMED and len(names) < runs else ""
            print(f"note, in {where}{named}: {note}", flush=True)


def _print_stage(seconds: float, text: str) -> None:
    print(f"  {seconds:6.1f} s  {text}", flush=True)


def _warn(text: str) -> None:
    print(f"tetlux: {text}", file=sys.stderr, flush=True)
