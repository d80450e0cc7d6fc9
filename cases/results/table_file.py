"""`TableFile`: a CSV file that grows row by row and is replaced as a whole when its columns change."""

import csv
import errno
import io
import os
import re
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from tetlux.cases.results.rows import HEAD, READING_HEAD, WARNINGS, Row, cell, order_columns
from tetlux.cases.write.publish import claim_folder
from tetlux.meshing.errors import InputError, RunError

# Columns whose values are text even where they look like numbers.
WORDS = frozenset({*HEAD, *READING_HEAD, WARNINGS})
# What tables are locked by, which is no name of a case, and how long to wait for another process, seconds.
LOCK, PATIENCE = ".tables", 10.0
NUMBER = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


class TableFile:
    """A CSV file of rows with named columns: UTF-8, commas, a point in numbers, all digits.

    Parameters
    ----------
    path : Path
    head : sequence of str
        Columns that come first and are always there.
    figures : sequence of str
        Columns that come after the others, in this order.
    """

    def __init__(self, path: Path, head: Sequence[str], figures: Sequence[str]) -> None:
        self.path = path
        self.head = head
        self.figures = figures

    def read(self) -> list[Row]:
        """The rows of the file; none if there is no such file, or it is no such table."""
        try:
            with self.path.open(newline="", encoding="utf-8") as file:
                rows = list(csv.DictReader(file))
        except (OSError, UnicodeDecodeError, csv.Error):
            return []
        # What a killed process left of a last line is dropped.
        return [
            {name: _value(name, text) for name, text in row.items() if text}
            for row in rows
            if None not in row and None not in row.values() and row.get(self.head[0])
        ]

    def check(self) -> None:
        """Refuse to replace a file that is no such table.

        Raises
        ------
        InputError
        """
        try:
            with self.path.open(encoding="utf-8-sig", errors="replace") as file:
                first = file.readline(4096)
        except OSError:
            return
        # That a killed process began may be cut anywhere.
        ours = ",".join(self.head[:2])
        if not (first.startswith(ours) or ours.startswith(first.strip())):
            raise InputError(f"{self.path} is no table of tetlux; move it, or choose another folder with --out.")

    def append(self, rows: Sequence[Row]) -> None:
        """Add rows at the end, in one write; the file is replaced if they have other columns.

        Raises
        ------
        OSError, RunError
            If the file cannot be written to.
        """
        if not rows:
            return
        columns = self._columns_there()
        if not columns or any(name not in columns for row in rows for name in row):
            self.replace([*self.read(), *rows])
            return
        with self.path.open("ab", buffering=0) as file:
            end, lines = file.tell(), _lines(rows, columns).encode("utf-8", "replace")
            if file.write(lines) < len(lines):
                # A full disk takes a part of it.
                file.truncate(end)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def replace(self, rows: Sequence[Row]) -> list[str]:
        """Write the whole table, all or nothing, and return its columns.

        Raises
        ------
        OSError, RunError
            If the file cannot be written.
        """
        columns = order_columns((name for row in rows for name in row), self.head, self.figures)
        replace_file(self.path, (_lines([dict(zip(columns, columns, strict=True))], columns) + _lines(rows, columns)))
        return columns

    def _columns_there(self) -> list[str]:
        """The columns of the file; none if it is missing or does not end in a whole line."""
        try:
            with self.path.open("rb") as file:
                first = file.readline().decode("utf-8", "replace")
                file.seek(-1, os.SEEK_END)
                whole = file.read() == b"\n"
        except OSError:
            return []
        return next(csv.reader([first]), []) if whole else []


def _value(column: str, text: str) -> Any:
    """The value of a cell: a number where it is written like one, except in columns of names."""
    if column in WORDS or not NUMBER.fullmatch(text):
        return text
    return int(text) if text.lstrip("-").isdecimal() else float(text)


def _lines(rows: Iterable[Row], columns: Sequence[str]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([cell(row.get(name)) for name in columns] for row in rows)
    return text.getvalue()


def replace_file(path: Path, content: str | bytes) -> None:
    """Write a file elsewhere and put it in the place of the old one, one process after the other.

    Raises
    ------
    OSError, RunError
        If it cannot be written.
    """
    until = time.monotonic() + PATIENCE
    while True:
        try:
            with claim_folder(path.parent, LOCK) as folder:
                partial = folder / path.name
                partial.write_bytes(content.encode("utf-8", "replace") if isinstance(content, str) else content)
                partial.replace(path)
                return
        except RunError as error:
            # Another batch is writing its tables into the same folder.
            if not isinstance(error.__cause__, BlockingIOError) or time.monotonic() > until:
                raise
            time.sleep(0.02)
