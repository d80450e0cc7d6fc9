"""STL, binary or text."""

import re

import numpy as np
from numpy.typing import NDArray

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError

HEAD = 84
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
# Rows beyond the count are triangles if no coordinate exceeds this many times the largest of those that are counted, or
# this value if none are.
RANGE, LARGEST, TINY = 10.0, 1e9, 1e-30
# All words may be on one line. A name may be "vertex" or "facet", but without numbers after it.
VERTEX = re.compile(rb"(?<!\S)vertex\s+([-+.\dni]\S*)\s+([-+.\dni]\S*)\s+([-+.\dni]\S*)", re.IGNORECASE)
FACET = re.compile(rb"(?<!\S)facet\s+normal(?!\S)", re.IGNORECASE)


def read_stl(data: bytes) -> tuple[FloatArray, IntArray]:
    """Points (3 m, 3) and triangles (m, 3), each with separate corners.

    The count in the head of a binary file decides, and bytes after the last triangle are ignored, unless they are
    triangles as well. A binary file may begin with "solid", as text does.

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
        corners = _text_corners(data)
    elif len(data) < HEAD:
        raise ValueError("neither text nor long enough for a head")
    elif len(data) < whole:
        held = (len(data) - HEAD) // TRIANGLE.itemsize
        raise InputError(f"was cut short: it claims {count:,} triangles and holds {held:,}; export it again.")
    else:
        corners = _binary_corners(data, count)
    return corners, np.arange(len(corners), dtype=np.int64).reshape(-1, 3)


def _binary_corners(data: bytes, count: int) -> FloatArray:
    every = np.frombuffer(data, TRIANGLE, (len(data) - HEAD) // TRIANGLE.itemsize, HEAD)["corners"]
    if _are_triangles(every[count:], every[:count]) and (len(data) - HEAD) % TRIANGLE.itemsize == 0:
        count = len(every)
    if count == 0 and len(every):
        raise InputError(
            f"claims no triangles and holds {len(data) - HEAD:,} bytes of something else; export it again."
        )
    return every[:count].reshape(-1, 3).astype(np.float64)


def _are_triangles(corners: NDArray[np.float32], others: NDArray[np.float32]) -> bool:
    """Whether rows (k, 3, 3) have three different corners each, of about the size of the others'."""
    if len(corners) == 0:
        return False
    largest = RANGE * float(np.abs(others).max()) if len(others) else LARGEST
    with np.errstate(invalid="ignore"):
        sensible = (np.abs(corners) <= largest).all() and (np.abs(corners).max(axis=(1, 2), initial=0.0) > TINY).all()
    distinct = (corners != corners[:, [1, 2, 0]]).any(axis=2).all()
    return bool(sensible and distinct)


def _is_text(data: bytes) -> bool:
    return data[:1024].lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid" and FACET.search(data) is not None


def _text_corners(data: bytes) -> FloatArray:
    found = VERTEX.findall(data)
    if len(found) != 3 * len(FACET.findall(data)):
        raise InputError("was cut short, or has facets that are no triangles; export it again.")
    return np.array(found, dtype=np.bytes_).astype(np.float64).reshape(-1, 3)
