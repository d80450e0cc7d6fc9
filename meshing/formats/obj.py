"""Wavefront OBJ: `v` and `f`; everything else is about looks, curves or names."""

import re

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.formats.polygons import flatten, triangulate


def read_obj(data: bytes) -> tuple[FloatArray, IntArray]:
    """Points (n, 3) and triangles (m, 3).

    A negative index counts back from the vertices that stand before its line. What follows a slash names texture
    coordinates and normals; what follows x, y and z is a weight or a colour.

    Raises
    ------
    ValueError
        If a number is none, or a vertex has fewer than three.
    """
    if b"\\" in data:
        data = re.sub(rb"\\[ \t]*(\r\n|\n|\r)", b" ", data)
    rows = [line.split() for line in data.splitlines()]
    vertices: list[list[bytes]] = []
    faces: list[list[bytes]] = []
    before: list[int] = []
    for row in rows:
        if not row:
            continue
        if row[0] == b"v":
            vertices.append(row[1:4])
        elif row[0] in (b"f", b"fo"):
            comment = next((i for i, word in enumerate(row) if word.startswith(b"#")), len(row))
            faces.append(row[1:comment])
            before.append(len(vertices))
    points = np.array(vertices, dtype=np.bytes_).astype(np.float64).reshape(len(vertices), -1)
    words, counts = flatten(faces)
    corners = _indices(words)
    start = np.repeat(np.array(before, dtype=np.int64), counts)
    # A 0 or what counts back too far becomes -1, which names no vertex.
    corners = np.where(corners > 0, corners - 1, np.where(corners < 0, np.maximum(corners + start, -1), -1))
    return points, triangulate(points, corners, counts)


def _indices(words: list[object]) -> IntArray:
    """The numbers before the first slash of each word."""
    text = b" ".join(words)  # type: ignore[arg-type]
    if b"/" in text:
        text = re.sub(rb"/\S*", b"", text)
    return np.array(text.split(), dtype=np.bytes_).astype(np.int64)
