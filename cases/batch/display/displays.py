"""Displays of a batch: live on a terminal, plain lines elsewhere, and failures only if it has to be quiet."""

import os
import sys
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from tetlux.cases.batch.display.lines import Lines
from tetlux.cases.batch.display.progress import Progress, describe_rate, describe_seconds, list_by_sentence
from tetlux.cases.batch.events import BatchEnded, BatchStarted, Event, Listener, WorkerLost

if TYPE_CHECKING:
    from rich.console import Console, Group

# Seconds between two plain lines.
EVERY = 5.0
# So many runs get a line for each stage where output is plain; more get one every few seconds.
FEW = 20
# Warnings that are listed at the end; summaries hold all.
MOST_NOTES = 10


def choose_display(runs: int, *, quiet: bool = False, verbose: bool = False) -> Listener:
    """Choose how a batch is shown.

    Parameters
    ----------
    runs : int
        How many runs there are.
    quiet : bool
        Whether only failures are shown.
    verbose : bool
        Whether each run gets lines of its own, however many there are.

    Returns
    -------
    callable
        A listener: lines for each stage of a few runs; of many a live display on a terminal, and a line every few
        seconds if output goes to a file or a pipe, or under CI.
    """
    if quiet:
        return Quiet()
    if verbose or runs == 1 or (runs <= FEW and not _is_live()):
        return Lines()
    return LiveDisplay() if _is_live() else PlainDisplay()


def _is_live() -> bool:
    """Whether output goes to a terminal that can be redrawn."""
    out = sys.stdout
    return out is not None and out.isatty() and not os.environ.get("CI") and os.environ.get("TERM") != "dumb"


class Quiet:
    """Shows at the end what failed, and nothing else."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.progress = Progress(clock)

    def __call__(self, event: Event) -> None:
        """Take an event of the batch."""
        self.progress.take(event)
        if isinstance(event, BatchEnded):
            self._list_failures()

    def _list_failures(self) -> None:
        progress = self.progress
        if not progress.failed:
            return
        lines = [f"tetlux: {progress.failed:,} of {progress.total:,} runs failed."]
        lines += [f"  {line}" for line in list_by_sentence(progress.failures)]
        print("\n".join(lines), file=sys.stderr, flush=True)


class PlainDisplay(Quiet):
    """Prints a line every few seconds, and at the end warnings and failures."""

    def __init__(self, clock: Callable[[], float] = time.monotonic, every: float = EVERY) -> None:
        super().__init__(clock)
        self._every = every
        self._ended = threading.Event()

    def __call__(self, event: Event) -> None:
        """Take an event of the batch."""
        if isinstance(event, WorkerLost):
            self._print(f"worker {event.worker} is lost: {event.reason}; its runs are done again")
        self.progress.take(event)
        if isinstance(event, BatchStarted):
            self._begin(event)
        elif isinstance(event, BatchEnded):
            self._end(event)

    def _begin(self, event: BatchStarted) -> None:
        self._print(_heading(event))
        threading.Thread(target=self._tick, daemon=True).start()

    def _tick(self) -> None:
        while not self._ended.wait(self._every):
            self._print(self.progress.describe())

    def _end(self, event: BatchEnded) -> None:
        self._ended.set()
        self._print(f"{self.progress.describe()}; {event.how} after {describe_seconds(event.seconds)}")
        notes = list_by_sentence(self.progress.notes)
        for line in notes[:MOST_NOTES]:
            self._print(f"note, with figures of the first, in {line}")
        if len(notes) > MOST_NOTES:
            self._print(f"and {len(notes) - MOST_NOTES:,} more notes, in the summaries of the runs")
        self._list_failures()

    def _print(self, line: str) -> None:
        print(line, flush=True)


class LiveDisplay(PlainDisplay):
    """Redraws where the batch is and what each worker does, several times a second."""

    def __init__(self, clock: Callable[[], float] = time.monotonic, console: "Console | None" = None) -> None:
        super().__init__(clock)
        from rich.console import Console  # noqa: PLC0415 - only needed on a terminal
        from rich.live import Live  # noqa: PLC0415

        self._console = console or Console()
        self._live = Live(console=self._console, get_renderable=self.draw, refresh_per_second=4, transient=True)

    def _begin(self, event: BatchStarted) -> None:
        self._print(_heading(event))
        self._live.start()

    def _end(self, event: BatchEnded) -> None:
        self._live.stop()
        super()._end(event)

    def _print(self, line: str) -> None:
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)

    def draw(self) -> "Group":
        """What is on the terminal now."""
        from rich.console import Group  # noqa: PLC0415
        from rich.progress_bar import ProgressBar  # noqa: PLC0415
        from rich.table import Table  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        progress = self.progress
        done = progress.finished + progress.kept
        head = Table.grid(padding=(0, 2))
        cells: list[ProgressBar | Text] = [
            ProgressBar(total=max(progress.total, 1), completed=done + progress.failed, width=24),
            Text(f"{done:,}/{progress.total:,} done"),
            Text(f"{progress.failed:,} failed", style="red" if progress.failed else ""),
            Text(f"{progress.left:,} left"),
            Text("" if progress.rate is None else describe_rate(progress.rate)),
            Text(f"{describe_seconds(progress.seconds_left)} to go" if progress.seconds_left else ""),
        ]
        head.add_row(*cells)
        workers = Table.grid(padding=(0, 2))
        now = progress.clock()
        for worker, (what, since) in sorted(dict(progress.working).items()):
            who = f"worker {worker}" if worker else "at work on"
            workers.add_row(
                Text(who), Text(what, overflow="ellipsis", no_wrap=True), Text(describe_seconds(now - since))
            )
        return Group(head, workers)


def _heading(event: BatchStarted) -> str:
    workers = "one process" if event.workers == 1 else f"{event.workers} worker processes"
    return f"{len(event.names):,} runs in {workers}, written to {event.out}"
