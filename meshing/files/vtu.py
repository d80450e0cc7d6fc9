"""Tetrahedra with values at their nodes as VTU, VTK's unstructured grid."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.files.vtk_xml import data_array, write_vtk_xml
from tetlux.meshing.tets.mesh import TetMesh

# VTK's number of a tetrahedron.
TETRAHEDRON = 10


def write_vtu(
    mesh: TetMesh, path: Path, values: Mapping[str, FloatArray], of_cells: Mapping[str, npt.NDArray[Any]]
) -> None:
    """Write a mesh with values at its nodes and of its tetrahedra, by name."""
    cells = mesh.tetrahedra.astype(np.int64)
    content = [
        f'<Piece NumberOfPoints="{len(mesh.points)}" NumberOfCells="{len(cells)}">',
        "<PointData>",
        *(data_array(name, column) for name, column in values.items()),
        "</PointData>",
        "<CellData>",
        *(data_array(name, column) for name, column in of_cells.items()),
        "</CellData>",
        "<Points>",
        data_array("Points", mesh.points),
        "</Points>",
        "<Cells>",
        data_array("connectivity", cells.reshape(-1)),
        data_array("offsets", 4 * np.arange(1, len(cells) + 1, dtype=np.int64)),
        data_array("types", np.full(len(cells), TETRAHEDRON, dtype=np.uint8)),
        "</Cells>",
        "</Piece>",
    ]
    write_vtk_xml(path, "UnstructuredGrid", content)
