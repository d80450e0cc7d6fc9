"""Volume meshes on disk, and surfaces with values on them, through meshio."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh, tetrahedron_volumes

SUFFIXES = (".vtu", ".msh")


def read_mesh(path: str | Path, *, unit: str = "mm") -> TetMesh:
    """Read a tetrahedral mesh.

    Parameters
    ----------
    path : str or Path
        VTU, or binary gmsh.
    unit : str
        Unit of the coordinates.

    Returns
    -------
    TetMesh

    Raises
    ------
    InputError
        If the file is missing, unreadable, or holds no tetrahedra.
    """
    import meshio  # noqa: PLC0415

    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} does not exist; check the path of the mesh file.")
    _check_suffix(path)
    try:
        data = meshio.read(path)
        cells = [block.data for block in data.cells if block.type == "tetra"]
    except (Exception, SystemExit) as error:  # meshio's readers raise whatever they ran into, or exit
        raise InputError(f"{path} is not a readable {path.suffix} mesh; export it again.") from error
    if not cells:
        raise InputError(f"{path} holds no tetrahedra; give a tetrahedral mesh.")
    points = np.asarray(data.points, dtype=np.float64)
    tetrahedra = np.vstack(cells).astype(np.int64)
    negative = tetrahedron_volumes(points, tetrahedra) < 0
    tetrahedra[negative] = tetrahedra[negative][:, [1, 0, 2, 3]]
    used, compact = np.unique(tetrahedra, return_inverse=True)
    return TetMesh(points[used], compact.reshape(tetrahedra.shape), unit)


def write_mesh(mesh: TetMesh, path: str | Path, values: Mapping[str, FloatArray] | None = None) -> None:
    """Write a tetrahedral mesh, with named values at its nodes.

    Parameters
    ----------
    mesh : TetMesh
    path : str or Path
        Ends in .vtu (VTK, binary) or .msh (gmsh 4.1, binary).
    values : mapping of str to (n,) ndarray, optional

    Raises
    ------
    InputError
        If the ending is another one.
    """
    path = Path(path)
    _check_suffix(path)
    _write(path, mesh.points, "tetra", mesh.tetrahedra, values, "vtu" if path.suffix == ".vtu" else "gmsh")


def write_surface(surface: Surface, path: str | Path, values: Mapping[str, FloatArray] | None = None) -> None:
    """Write a triangle mesh as binary PLY, with named values at its vertices."""
    _write(Path(path), surface.points, "triangle", surface.faces.astype(np.int32), values, "ply")


def _check_suffix(path: Path) -> None:
    if path.suffix not in SUFFIXES:
        raise InputError(f'{path}: "{path.suffix}" is no volume mesh format here; use {" or ".join(SUFFIXES)}.')


def _write(
    path: Path,
    points: FloatArray,
    kind: str,
    cells: IntArray | np.ndarray[tuple[int, int], np.dtype[np.int32]],
    values: Mapping[str, FloatArray] | None,
    file_format: str,
) -> None:
    import meshio  # noqa: PLC0415

    mesh = meshio.Mesh(points, [(kind, cells)], point_data=dict(values or {}))
    mesh.write(path, file_format=file_format)
