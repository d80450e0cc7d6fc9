"""STL, binary or text."""

import re

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError

HEAD = 84
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
# All words may be on one line. A name may be "vertex" or "facet", but without numbers after it.
VERTEX = re.compile(rb"(?<!\S)vertex\s+([-+.\dni]\S*)\s+([-+.\dni]\S*)\s+([-+.\dni]\S*)", re.IGNORECASE)
FACET = re.compile(rb"(?<!\S)facet\s+normal(?!\S)", re.IGNORECASE)


def read_stl(data: bytes) -> tuple[FloatArray, IntArray]:
    """Points (3 m, 3) and triangles (m, 3), each with separate corners.

    Of a binary file the count in its head decides, and what follows the last triangle is nothing: it may also begin
    with "solid", as text does.

    Raises
    ------
    InputError
        If the file was cut short.
    ValueError
        If it is neither binary nor text STL.
    """
    count = int.from_bytes(data[80:HEAD], "little") if len(data) >= HEAD else 0
    whole = HEAD + TRIANGLE.itemsize * count
    if len(data) != whole and _is_text(data):
        corners = _of_text(data)
    elif len(data) < HEAD:
        raise ValueError("neither text nor long enough for a head")
    elif len(data) < whole:
        held = (len(data) - HEAD) // TRIANGLE.itemsize
        raise InputError(f"was cut short: it claims {count:,} triangles and holds {held:,}; export it again.")
    elif count == 0 and len(data) >= HEAD + TRIANGLE.itemsize:
        raise InputError(f"claims no triangles and holds {len(data) - HEAD:,} bytes of them; export it again.")
    else:
        corners = np.frombuffer(data, TRIANGLE, count, HEAD)["corners"].reshape(-1, 3).astype(np.float64)
    return corners, np.arange(len(corners), dtype=np.int64).reshape(-1, 3)


def _is_text(data: bytes) -> bool:
    return data[:1024].lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid" and FACET.search(data) is not None


def _of_text(data: bytes) -> FloatArray:
    found = VERTEX.findall(data)
    if len(found) != 3 * len(FACET.findall(data)):
        raise InputError("was cut short, or has facets that are no triangles; export it again.")
    return np.array(found, dtype=np.bytes_).astype(np.float64).reshape(-1, 3)
