"""`RunLogs`: a log for each run of a batch, also for those that fail."""

from contextlib import suppress
from pathlib import Path

from tetlux.cases.batch.events import BatchEnded, BatchStarted, Event, RunFailed, RunFinished, RunStarted, StageEnded

FOLDER = "logs"


class RunLogs:
    """A listener to a batch that writes ``logs/<name>.log`` when a run ends: its stages, notes, readings, or failure.

    A log that cannot be written is left out: results matter more.
    """

    def __init__(self) -> None:
        self._out = Path()
        self._names: tuple[str, ...] = ()
        # By the number of the run.
        self._lines: dict[int, list[str]] = {}

    def __call__(self, event: Event) -> None:
        """Take an event of the batch."""
        if isinstance(event, BatchStarted):
            self._out, self._names = event.out, event.names
        elif isinstance(event, RunStarted):
            # A run that is done again, since its worker was lost, begins a new log.
            self._lines[event.run] = [f"repaired: {note}" for note in event.repairs]
        elif isinstance(event, StageEnded):
            self._lines.setdefault(event.run, []).append(_line(event.seconds, event.text))
        elif isinstance(event, RunFinished) and not event.kept:
            notes = [f"note: {note}" for note in event.notes]
            for text in (*event.readings, *notes, f"written to {event.folder}"):
                self._lines.setdefault(event.run, []).append(_line(event.seconds, text))
            self._write(event.run)
        elif isinstance(event, RunFailed):
            self._lines.setdefault(event.run, []).append(_line(event.seconds, f"failed: {event.reason}"))
            self._write(event.run)
        elif isinstance(event, BatchEnded):
            for run in list(self._lines):
                self._lines[run].append(f"the batch was {event.how} before this run ended")
                self._write(run)

    def _write(self, run: int) -> None:
        lines = self._lines.pop(run)
        path = self._out / FOLDER / f"{self._names[run]}.log"
        try:
            if not path.parent.is_dir():
                path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("\n".join(lines) + "\n", encoding="utf-8", errors="replace")
        except OSError:
            # What a full disk leaves of it is of no use.
            with suppress(OSError):
                path.unlink()


def _line(seconds: float, text: str) -> str:
    return f"{seconds:8.2f} s  {text}"
