"""Read the rows of a PLY file by element, with any properties."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import IntArray


@dataclass
class Element:
    """One kind of row; each property is (name, type of the list's length or empty, type)."""

    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)


@dataclass(frozen=True)
class Lists:
    """Lists of one property: the concatenated values, and the length of each list."""

    values: npt.NDArray[Any]
    counts: IntArray


Column = npt.NDArray[Any] | Lists


class Rows:
    """Reads values in sequence; an IndexError means that none are left."""

    def take(self, kind: str, count: int) -> npt.NDArray[Any]:
        """The next values of a type."""
        raise NotImplementedError

    def read_equal_rows(self, element: Element, lengths: list[int]) -> dict[str, Column] | None:
        """The columns of an element if its lists have these lengths in every row, or else None."""
        raise NotImplementedError

    def read(self, element: Element) -> dict[str, Column]:
        """The columns of the next element; fast if all rows have equal lists, as in most files."""
        if element.count == 0:
            return {}
        start = self.at
        lengths = [len(values) for values in self._row(element)]
        self.at = start
        columns = self.read_equal_rows(element, lengths)
        if columns is not None:
            return columns
        rows = [self._row(element) for _ in range(element.count)]
        return {
            name: Lists(np.concatenate(column), np.array([len(values) for values in column]))
            if length
            else np.concatenate(column)
            for (name, length, _), column in zip(element.properties, zip(*rows, strict=True), strict=True)
        }

    at: int

    def _row(self, element: Element) -> list[npt.NDArray[Any]]:
        return [
            self.take(kind, int(self.take(length, 1)[0]) if length else 1) for _, length, kind in element.properties
        ]


class Binary(Rows):
    """Binary rows; `order` is NumPy's byte order character."""

    def __init__(self, data: bytes, start: int, order: str) -> None:
        self.data, self.at, self.order = data, start, order

    def take(self, kind: str, count: int) -> npt.NDArray[Any]:
        """The next values of a type."""
        dtype = np.dtype(self.order + kind)
        end = self.at + count * dtype.itemsize
        if count < 0 or end > len(self.data):
            raise IndexError
        values = np.frombuffer(self.data, dtype, count, self.at)
        self.at = end
        return values

    def read_equal_rows(self, element: Element, lengths: list[int]) -> dict[str, Column] | None:
        """The columns of an element if its lists have these lengths in every row, or else None."""
        parts: list[tuple[str, str, tuple[int, ...]]] = []
        for i, (_, length, kind) in enumerate(element.properties):
            parts += [(f"length {i}", self.order + length, ())] if length else []
            parts.append((f"values {i}", self.order + kind, (lengths[i],) if length else ()))
        row = np.dtype(parts)
        if self.at + element.count * row.itemsize > len(self.data):
            return None
        table = np.frombuffer(self.data, row, element.count, self.at)
        columns: dict[str, Column] = {}
        for i, (name, length, _) in enumerate(element.properties):
            values = table[f"values {i}"]
            if length and (table[f"length {i}"] != lengths[i]).any():
                return None
            columns[name] = Lists(values.ravel(), np.full(element.count, lengths[i])) if length else values
        self.at += element.count * row.itemsize
        return columns


class Text(Rows):
    """Text rows."""

    def __init__(self, data: bytes) -> None:
        self.words = np.array(data.split(), dtype=np.bytes_).astype(np.float64)
        self.at = 0

    def take(self, kind: str, count: int) -> npt.NDArray[Any]:
        """The next values, of any type."""
        end = self.at + count
        if count < 0 or end > len(self.words):
            raise IndexError
        values = self.words[self.at : end]
        self.at = end
        return values

    def read_equal_rows(self, element: Element, lengths: list[int]) -> dict[str, Column] | None:
        """The columns of an element if its lists have these lengths in every row, or else None."""
        width = sum(n + bool(length) for n, (_, length, _) in zip(lengths, element.properties, strict=True))
        end = self.at + element.count * width
        if end > len(self.words):
            return None
        table = self.words[self.at : end].reshape(element.count, width)
        columns: dict[str, Column] = {}
        place = 0
        for n, (name, length, _) in zip(lengths, element.properties, strict=True):
            if length and (table[:, place] != n).any():
                return None
            place += bool(length)
            values = table[:, place : place + n]
            columns[name] = Lists(values.ravel(), np.full(element.count, n)) if length else values[:, 0]
            place += n
        self.at = end
        return columns
