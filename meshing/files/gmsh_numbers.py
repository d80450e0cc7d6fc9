"""Read the numbers in a section of a gmsh file in sequence, from text or binary."""

from typing import Any

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray, IntArray


class TextNumbers:
    """Numbers in text, where all types are written alike."""

    def start(self, section: bytes) -> None:
        """Start at the beginning of a section."""
        self._values = np.array(section.split(), dtype=np.float64)
        self._place = 0

    def take(self, count: int, kind: str) -> npt.NDArray[Any]:
        """The next numbers; ``i`` and ``u`` are integers of 4 and 8 bytes, ``d`` doubles."""
        found = self._values[self._place : self._place + count]
        if count < 0 or len(found) < count:
            raise ValueError("the section is too short")
        self._place += count
        return found if kind == "d" else self._whole(found)

    @property
    def rest(self) -> IntArray:
        """The remaining integers of 4 bytes."""
        return self._whole(self._values[self._place :])

    @staticmethod
    def _whole(values: FloatArray) -> IntArray:
        if not (np.abs(values) < 2.0**53).all():
            raise ValueError("a whole number is none, or too large")
        return values.astype(np.int64)


class BinaryNumbers:
    """Numbers in binary: ``i`` of 4 bytes, ``u`` and ``d`` of 8."""

    def __init__(self, big: bool) -> None:
        order = ">" if big else "<"
        self._types = {"i": np.dtype(order + "i4"), "u": np.dtype(order + "i8"), "d": np.dtype(order + "f8")}

    def start(self, section: bytes) -> None:
        """Start at the beginning of a section."""
        self._section, self._place = section, 0

    def line(self) -> int:
        """An integer in a line of text."""
        end = self._section.index(b"\n", self._place)
        number, self._place = int(self._section[self._place : end]), end + 1
        return number

    def take(self, count: int, kind: str) -> npt.NDArray[Any]:
        """The next numbers; ``i`` and ``u`` are integers of 4 and 8 bytes, ``d`` doubles."""
        of_kind = self._types[kind]
        if count < 0 or self._place + count * of_kind.itemsize > len(self._section):
            raise ValueError("the section is too short")
        found = np.frombuffer(self._section, of_kind, count, self._place)
        self._place += count * of_kind.itemsize
        return found.astype(np.float64 if kind == "d" else np.int64)

    def numbered_points(self, count: int) -> tuple[IntArray, FloatArray]:
        """Rows of an integer of 4 bytes and three doubles."""
        row = np.dtype([("number", self._types["i"]), ("place", self._types["d"], 3)])
        found = np.frombuffer(self._section, row, count, self._place)
        return found["number"].astype(np.int64), found["place"].astype(np.float64)

    @property
    def rest(self) -> IntArray:
        """The remaining integers of 4 bytes."""
        return self.take((len(self._section) - self._place) // 4, "i")
