"""PLY of Stanford: text or binary of either byte order, with polygons or triangle strips."""

import re

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.files.formats.ply_rows import Binary, Column, Element, Lists, Text
from tetlux.meshing.files.formats.polygons import triangulate

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
INDICES = ("vertex_indices", "vertex_index")


def read_ply(data: bytes) -> tuple[FloatArray, IntArray]:
    """Points (n, 3) and triangles (m, 3).

    Raises
    ------
    InputError
        If the file was cut short.
    ValueError
        If it is not PLY.
    """
    order, elements, start = _head(data)
    columns: dict[str, dict[str, Column]] = {}
    rows: Text | Binary = Binary(data, start, order) if order else Text(data[start:])
    for element in elements:
        try:
            columns[element.name] = rows.read(element)
        except IndexError as error:
            raise InputError(
                f"was cut short: it claims {element.count:,} rows of {element.name} and holds fewer; export it again."
            ) from error
    vertex = columns["vertex"]
    points = np.column_stack([np.asarray(vertex[axis], dtype=np.float64) for axis in "xyz"])
    faces = [np.zeros((0, 3), dtype=np.int64)]
    for name, make in (("face", triangulate), ("tristrips", _strip_triangles)):
        found = next((columns[name][key] for key in INDICES if key in columns.get(name, {})), None)
        if isinstance(found, Lists):
            faces.append(make(points, found.values.astype(np.int64), found.counts))
    return points, np.vstack(faces)


def _strip_triangles(_: FloatArray, corners: IntArray, counts: IntArray) -> IntArray:
    """Triangles of strips: every other one is turned over; -1, or the list's end, ends a strip."""
    strip = np.repeat(np.arange(len(counts)), counts)
    ends = corners < 0
    strip = strip + np.cumsum(ends)
    strip, corners = strip[~ends], corners[~ends]
    if len(corners) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    first = np.flatnonzero(np.diff(strip, prepend=-1))
    place = np.arange(len(strip)) - np.repeat(first, np.diff(first, append=len(strip)))
    faces = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
    odd = place[:-2] % 2 == 1
    faces[odd] = faces[odd][:, [1, 0, 2]]
    # Repeated corners reverse the orientation in a strip.
    proper = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return np.asarray(faces[(strip[:-2] == strip[2:]) & proper])


def _head(data: bytes) -> tuple[str, list[Element], int]:
    """Byte order (empty for text), elements, and the offset of the rows."""
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    # A comment may contain ``end_header``; the first binary byte may equal a line ending.
    last = re.search(rb"[\r\n][ \t]*end_header[ \t]*" + (first[1] if first else b"\n"), data)
    if first is None or last is None:
        raise ValueError("no head")
    end, start = last.start(), last.end()
    order: str | None = None
    elements: list[Element] = []
    for line in data[:end].decode("latin-1").splitlines():
        words = line.split()
        if words[:1] == ["format"]:
            order = ORDERS[words[1]]
        elif words[:1] == ["element"]:
            elements.append(Element(words[1], int(words[2])))
        elif words[:2] == ["property", "list"]:
            elements[-1].properties.append((words[4], TYPES[words[2]], TYPES[words[3]]))
        elif words[:1] == ["property"]:
            elements[-1].properties.append((words[2], "", TYPES[words[1]]))
    if order is None or any(element.count < 0 for element in elements):
        raise ValueError("no format")
    return order, elements, start
