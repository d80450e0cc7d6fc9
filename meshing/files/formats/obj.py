"""Wavefront OBJ: `v` and `f`; other lines (materials, curves, names) are ignored."""

import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.files.formats.polygons import triangulate

KINDS = {b"v ": 0, b"v\t": 0, b"f ": 1, b"f\t": 1}


def read_obj(data: bytes) -> tuple[FloatArray, IntArray]:
    """Points (n, 3) and triangles (m, 3).

    A negative index counts back from the vertices that stand before its line. What follows a slash names texture
    coordinates and normals; what follows x, y and z is a weight or a colour.

    Raises
    ------
    ValueError
        If a number is invalid, or a vertex has fewer than three.
    """
    if b"\\" in data:
        data = re.sub(rb"\\[ \t]*(\r\n|\n|\r)", b" ", data)
    if b"#" in data:
        data = re.sub(rb"#[^\r\n]*", b"", data)
    # Some programs write keywords in capitals.
    every = (line.lstrip() for line in data.removeprefix(b"\xef\xbb\xbf").splitlines())
    lines = [line[:1].lower() + line[1:] for line in every if line[:2].lower() in KINDS]
    kinds = np.array([KINDS[line[:2]] for line in lines], dtype=np.int64)
    words, starts, counts = _words([line for line in lines if line[:1] == b"v"], b"v")
    if (counts < 3).any():
        raise ValueError("a vertex of fewer than three coordinates")
    points = words[starts[:, None] + np.arange(1, 4)].astype(np.float64)
    words, starts, counts = _words([line for line in lines if line[:1] == b"f"], b"f")
    corners = np.delete(words, starts).astype(np.int64)
    # 0 and negative indices out of range become -1, which is no vertex.
    before = np.repeat(np.cumsum(kinds == 0)[kinds == 1], counts)
    corners = np.where(corners > 0, corners - 1, np.where(corners < 0, np.maximum(corners + before, -1), -1))
    return points, triangulate(points, corners, counts)


def _words(lines: Sequence[bytes], key: bytes) -> tuple[npt.NDArray[np.bytes_], IntArray, IntArray]:
    """The words of lines that begin with a key, the first word of each line, and the number of words after its key."""
    text = b" ".join(lines)
    if b"/" in text:
        text = re.sub(rb"/\S*", b"", text)
    words = np.array(text.split(), dtype=np.bytes_)
    starts = np.flatnonzero(words == key)
    return words, starts, np.diff(starts, append=len(words)) - 1
