"""Volume meshes on disk, through meshio."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.paths import is_file
from tetlux.meshing.tetmesh import TetMesh, tetrahedron_volumes

SUFFIXES = (".vtu", ".msh")
# In whatever unit.
LONGEST = 1e30
# What the regions of tetrahedra are called in files.
REGION = "region"


def read_mesh(path: str | Path, *, unit: str = "mm") -> TetMesh:
    """Read a tetrahedral mesh, and its regions if it has them.

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
    if not is_file(path):
        raise InputError(f"{path} does not exist; check the path of the mesh file.")
    _check_suffix(path)
    try:
        data = meshio.read(path)
        chosen = [i for i, block in enumerate(data.cells) if block.type == "tetra"]
        cells = [data.cells[i].data for i in chosen]
        tags = [data.cell_data[REGION][i] for i in chosen] if REGION in data.cell_data else []
    except (Exception, SystemExit) as error:  # meshio's readers raise whatever they ran into, or exit
        raise InputError(f"{path} is not a readable {path.suffix} mesh; export it again.") from error
    if not cells:
        raise InputError(f"{path} holds no tetrahedra; give a tetrahedral mesh.")
    try:
        mesh, _ = oriented(data.points, np.vstack(cells), unit)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return replace(mesh, regions=np.concatenate(tags).reshape(-1).astype(np.int64)) if tags else mesh


def oriented(points: npt.ArrayLike, cells: npt.ArrayLike, unit: str = "mm") -> tuple[TetMesh, IntArray]:
    """Tetrahedra of a file, whichever way round they are, as a mesh without the nodes that none of them uses.

    Parameters
    ----------
    points : (n, 3) array_like
    cells : (m, 4) array_like
    unit : str

    Returns
    -------
    mesh : TetMesh
    used : (k,) ndarray
        The numbers that its nodes have in the file.

    Raises
    ------
    InputError
        If a corner does not exist or lies nowhere, or a tetrahedron is flat.
    """
    vertices, tetrahedra = np.asarray(points, dtype=np.float64), np.array(cells, dtype=np.int64)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise InputError(f"its nodes are an array of shape {vertices.shape}; give three coordinates for each.")
    used, compact = np.unique(tetrahedra, return_inverse=True)
    if used[0] < 0 or used[-1] >= len(vertices):
        raise InputError("a tetrahedron names a node that does not exist; the file is damaged.")
    if not (np.abs(vertices[used]) < LONGEST).all():
        raise InputError("a node's coordinate is no number, or absurdly large; export the file again.")
    vertices, tetrahedra = vertices[used], compact.reshape(tetrahedra.shape)
    negative = tetrahedron_volumes(vertices, tetrahedra) < 0
    tetrahedra[negative] = tetrahedra[negative][:, [1, 0, 2, 3]]
    return TetMesh(vertices, tetrahedra, unit), used


def write_mesh(mesh: TetMesh, path: str | Path, values: Mapping[str, FloatArray] | None = None) -> None:
    """Write a tetrahedral mesh, with named values at its nodes, and with the `region` of its tetrahedra if several.

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
    file_format = "vtu" if path.suffix == ".vtu" else "gmsh"
    # gmsh's values are floating-point numbers.
    tags = mesh.regions.astype(np.int32 if file_format == "vtu" else np.float64)
    import meshio  # noqa: PLC0415

    meshio.Mesh(
        mesh.points,
        [("tetra", mesh.tetrahedra)],
        point_data=dict(values or {}),
        cell_data={REGION: [tags]} if tags.any() else {},
    ).write(path, file_format=file_format)


def _check_suffix(path: Path) -> None:
    if path.suffix not in SUFFIXES:
        raise InputError(f'{path}: "{path.suffix}" is no volume mesh format here; use {" or ".join(SUFFIXES)}.')
