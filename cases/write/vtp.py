"""Surfaces with values at their vertices as VTP, whose values VTK, PyVista and ParaView show."""

import sys
from collections.abc import Mapping
from html import escape
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tetlux.meshing.surface.surface import Surface

# VTK's names of the types of values.
TYPES = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}


def write_vtp(
    surface: Surface, path: Path, values: Mapping[str, npt.NDArray[np.generic]], notes: Mapping[str, str]
) -> None:
    """Write a triangle mesh as VTK PolyData: XML with raw appended binary data.

    Parameters
    ----------
    surface : Surface
    path : Path
    values : mapping of str to (v,) or (v, k) ndarray
        Values at the vertices: floating-point numbers, integers or bytes. Viewers colour by the first.
    notes : mapping of str to str
        Text that is stored as field data.
    """
    triangles = surface.faces.astype(np.int64)
    arrays: list[npt.NDArray[np.generic]] = []

    def array(name: str, numbers: npt.NDArray[np.generic]) -> str:
        """Append the numbers of an array, and return the XML element that refers to them."""
        offset = sum(8 + kept.nbytes for kept in arrays)
        arrays.append(np.ascontiguousarray(numbers))
        kind = TYPES[numbers.dtype.str[1:]]
        parts = f' NumberOfComponents="{numbers.shape[1]}"' if numbers.ndim > 1 else ""
        return f'<DataArray type="{kind}" Name="{escape(name)}"{parts} format="appended" offset="{offset}"/>'

    head = [
        f'<VTKFile type="PolyData" version="1.0" byte_order="{_BYTE_ORDER}" header_type="UInt64">',
        "<PolyData>",
        "<FieldData>",
        *(_text(name, note) for name, note in notes.items()),
        "</FieldData>",
        f'<Piece NumberOfPoints="{len(surface.points)}" NumberOfPolys="{len(triangles)}">',
        f'<PointData Scalars="{escape(next(iter(values)))}">',
        *(array(name, column) for name, column in values.items()),
        "</PointData>",
        "<Points>",
        array("Points", surface.points),
        "</Points>",
        "<Polys>",
        array("connectivity", triangles.reshape(-1)),
        array("offsets", 3 * np.arange(1, len(triangles) + 1, dtype=np.int64)),
        "</Polys>",
        "</Piece>",
        "</PolyData>",
        '<AppendedData encoding="raw">',
    ]
    with path.open("wb") as file:
        file.write(("\n".join(head) + "\n_").encode())
        for numbers in arrays:
            file.write(np.uint64(numbers.nbytes).tobytes())
            file.write(numbers.tobytes())
        file.write(b"\n</AppendedData>\n</VTKFile>\n")


_BYTE_ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"


def _text(name: str, text: str) -> str:
    """A text as VTK stores it: the codes of its bytes, ending in zero."""
    codes = " ".join(map(str, (*text.encode(), 0)))
    return f'<DataArray type="String" Name="{escape(name)}" NumberOfTuples="1" format="ascii">{codes}</DataArray>'
