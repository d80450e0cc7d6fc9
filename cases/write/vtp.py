"""Surfaces with values at their vertices as VTP, whose values VTK, PyVista and ParaView show."""

from collections.abc import Mapping
from html import escape
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tetlux.meshing.files.vtk_xml import data_array, text_array, write_vtk_xml
from tetlux.meshing.surface.surface import Surface


def write_vtp(
    surface: Surface, path: Path, values: Mapping[str, npt.NDArray[np.generic]], notes: Mapping[str, str]
) -> None:
    """Write a triangle mesh as VTK PolyData.

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
    content = [
        "<FieldData>",
        *(text_array(name, note) for name, note in notes.items()),
        "</FieldData>",
        f'<Piece NumberOfPoints="{len(surface.points)}" NumberOfPolys="{len(triangles)}">',
        f'<PointData Scalars="{escape(next(iter(values)))}">',
        *(data_array(name, column) for name, column in values.items()),
        "</PointData>",
        "<Points>",
        data_array("Points", surface.points),
        "</Points>",
        "<Polys>",
        data_array("connectivity", triangles.reshape(-1)),
        data_array("offsets", 3 * np.arange(1, len(triangles) + 1, dtype=np.int64)),
        "</Polys>",
        "</Piece>",
    ]
    write_vtk_xml(path, "PolyData", content)
