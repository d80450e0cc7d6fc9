"""`BatchTables`: writes the tables and the page of a batch while its runs end."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from tetlux.cases.batch.events import BatchEnded, BatchStarted, Event, RunFailed, RunFinished
from tetlux.cases.results.page import check_page, write_page
from tetlux.cases.results.parquet import parquet_of
from tetlux.cases.results.rows import (
    FIGURES,
    HEAD,
    READING_FIGURES,
    READING_HEAD,
    Row,
    case_of,
    failure_row,
    reading_rows,
    result_rows,
)
from tetlux.cases.results.table_file import TableFile, replace_file
from tetlux.cases.write.publish import FULL, disk_is_full, write_error
from tetlux.meshing.errors import RunError

RESULTS, PARQUET, READINGS, PAGE = "results.csv", "results.parquet", "readings.csv", "index.html"


def results_file(out: Path) -> TableFile:
    """The table of results in a folder."""
    return TableFile(out / RESULTS, list(HEAD), list(FIGURES))


def readings_file(out: Path) -> TableFile:
    """The table of readings in a folder."""
    return TableFile(out / READINGS, list(READING_HEAD), list(READING_FIGURES))


class BatchTables:
    """A listener to a batch that writes ``results.csv`` and ``readings.csv``, Parquet, and ``index.html``.

    Rows are added as runs end, so that a killed batch has those of what is finished. At the end they are put in the
    order of the batch. Rows of other cases in the same folder stay; those of earlier runs of the same cases are
    replaced.
    """

    def __init__(self) -> None:
        self._out = Path()
        self._kept: tuple[list[Row], list[Row]] = ([], [])
        # Whether a run has reported so, which the tables need not do again.
        self._disk_is_full = False
        # By the number of the run; what could not be written yet.
        self._results: dict[int, list[Row]] = {}
        self._readings: dict[int, list[Row]] = {}

    def __call__(self, event: Event) -> None:
        """Take an event of the batch.

        Raises
        ------
        InputError
            If, at the start, there are other files in the place of the tables.
        RunError
            If the tables cannot be written at the end of the batch.
        """
        if isinstance(event, BatchStarted):
            self._start(event)
        elif isinstance(event, RunFinished):
            self._add(event.run, result_rows(event.summary), reading_rows(event.summary))
        elif isinstance(event, RunFailed):
            self._disk_is_full |= event.ends_batch
            self._add(event.run, [failure_row(event.name, event.reason, event.sweep)], [])
        elif isinstance(event, BatchEnded):
            try:
                self._finish()
            except OSError as error:
                if not (self._disk_is_full and error.errno in FULL):
                    raise write_error(self._out, ".", error) from error
            except RunError as error:
                if not (self._disk_is_full and disk_is_full(error)):
                    raise

    def _start(self, event: BatchStarted) -> None:
        self._out = event.out
        cases = {case_of(name) for name in event.names}
        results, readings = results_file(self._out), readings_file(self._out)
        for table in (results, readings):
            table.check()
        check_page(self._out / PAGE)
        kept = [row for row in results.read() if row["case"] not in cases and (self._out / row["run"]).is_dir()]
        runs = {row["run"] for row in kept}
        self._kept = kept, [row for row in readings.read() if row["run"] in runs]
        for table, rows in zip((results, readings), self._kept, strict=True):
            if table.path.exists():
                with suppress(OSError, RunError):
                    table.replace(rows)

    def _add(self, run: int, results: list[Row], readings: list[Row]) -> None:
        # A run that is done again replaces its rows at the end.
        self._results[run], self._readings[run] = results, readings
        # What cannot be written now, as a file that a spreadsheet holds, is written at the end.
        with suppress(OSError, RunError):
            results_file(self._out).append(results)
            readings_file(self._out).append(readings)

    def _finish(self) -> None:
        results = [*_in_order(self._results), *self._kept[0]]
        readings = [*_in_order(self._readings), *self._kept[1]]
        columns = results_file(self._out).replace(results)
        if readings or readings_file(self._out).path.exists():
            readings_file(self._out).replace(readings)
        parquet = parquet_of(results, columns)
        if parquet is not None:
            replace_file(self._out / PARQUET, parquet)
        else:
            # One of an earlier batch would be of other runs.
            (self._out / PARQUET).unlink(missing_ok=True)
        write_page(self._out / PAGE, results, columns)


def _in_order(rows: dict[int, list[Row]]) -> Sequence[Row]:
    return [row for run in sorted(rows) for row in rows[run]]
