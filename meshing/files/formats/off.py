"""OFF of Geomview: text, with or without normals, colours and texture coordinates."""

import re

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.files.formats.polygons import flatten, triangulate

# ST: texture; C: colour; N: normal; 4: homogeneous; n: of n dimensions.
KIND = re.compile(rb"^(ST)?C?N?(4?n?)OFF(\d*)$", re.IGNORECASE)


def read_off(data: bytes) -> tuple[FloatArray, IntArray]:
    """Points (n, 3) and triangles (m, 3).

    Of a vertex's line the first three numbers are its place; of a face's line the first one counts its corners. The
    word OFF may be missing, and so may the number of edges.

    Raises
    ------
    InputError
        If the file is binary, of other dimensions or was cut short.
    ValueError
        If it is not OFF.
    """
    lines = [line.split(b"#")[0].split() for line in data.splitlines()]
    rows = [line for line in lines if line]
    head = KIND.match(rows[0][0])
    if head:
        if head[2]:
            raise InputError("is an OFF file of more than three dimensions; export it with three.")
        if rows[0][1:2] == [b"BINARY"]:
            raise InputError("is a binary OFF file; export it as text.")
        # ModelNet's files have no space between OFF and the first count.
        rows[0] = [head[3], *rows[0][1:]] if head[3] else rows[0][1:]
        rows = rows if rows[0] else rows[1:]
    vertices, polygons = int(rows[0][0]), int(rows[0][1])
    if vertices < 0 or polygons < 0:
        raise ValueError("negative counts")
    if len(rows) == 1 and vertices > 0:
        raise InputError("is an OFF file of one line only; export it with a line for each vertex and face.")
    if len(rows) < 1 + vertices + polygons:
        raise InputError(
            f"was cut short: it claims {vertices:,} vertices and {polygons:,} faces and holds {len(rows) - 1:,} lines; "
            "export it again."
        )
    points = np.array([row[:3] for row in rows[1 : 1 + vertices]], dtype=np.bytes_).astype(np.float64)
    faces = rows[1 + vertices : 1 + vertices + polygons]
    corners, counts = flatten([face[1 : 1 + int(face[0])] for face in faces])
    if (counts != [int(face[0]) for face in faces]).any():
        raise ValueError("a face with fewer corners than it claims")
    return points.reshape(vertices, -1), triangulate(
        points, np.array(corners, dtype=np.bytes_).astype(np.int64), counts
    )
