"""VTK's XML files, which VTK and meshio read; importing meshio to write one takes as long as to draw a picture."""

import base64
import sys
import zlib
from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

# VTK's names of the kinds of numbers, before their bits.
KINDS = {"f": "Float", "i": "Int", "u": "UInt"}
# Bytes that are compressed at a time; and how much: more takes longer, and coordinates hardly get smaller.
BLOCK, LEVEL = 1 << 20, 1
BYTE_ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"


def write_vtk_xml(path: Path, kind: str, content: Iterable[str]) -> None:
    """Write a file of some kind, such as PolyData, with lines of XML."""
    settings = f'version="1.0" byte_order="{BYTE_ORDER}" header_type="UInt64" compressor="vtkZLibDataCompressor"'
    lines = [f'<VTKFile type="{kind}" {settings}>', f"<{kind}>", *content, f"</{kind}>", "</VTKFile>", ""]
    path.write_text("\n".join(lines), encoding="utf-8")


def data_array(name: str, numbers: npt.NDArray[Any]) -> str:
    """An array (n,) or (n, k) of floating-point numbers, integers or bytes as an element."""
    numbers = np.asarray(numbers)
    raw = numbers.astype(numbers.dtype.newbyteorder("=")).tobytes()
    blocks = [zlib.compress(raw[start : start + BLOCK], LEVEL) for start in range(0, len(raw), BLOCK)]
    sizes = np.array([len(blocks), BLOCK, len(raw) % BLOCK, *map(len, blocks)], dtype=np.uint64)
    text = (base64.b64encode(sizes.tobytes()) + base64.b64encode(b"".join(blocks))).decode()
    parts = f' NumberOfComponents="{numbers.shape[1]}"' if numbers.ndim > 1 else ""
    kind = f"{KINDS[numbers.dtype.kind]}{8 * numbers.dtype.itemsize}"
    return f'<DataArray type="{kind}" Name="{escape(name)}"{parts} format="binary">{text}</DataArray>'


def text_array(name: str, text: str) -> str:
    """A text as an element: the codes of its bytes, ending in zero."""
    codes = " ".join(map(str, (*text.encode(), 0)))
    return f'<DataArray type="String" Name="{escape(name)}" NumberOfTuples="1" format="ascii">{codes}</DataArray>'
