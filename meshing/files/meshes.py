"""Read and write volume meshes: gmsh and NIRFAST by tetlux's own readers, other formats through meshio."""

import contextlib
import io
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.files import nirfast
from tetlux.meshing.files.gmsh import is_gmsh, read_gmsh
from tetlux.meshing.files.gmsh_write import write_gmsh
from tetlux.meshing.files.labels import REGION, labels_of
from tetlux.meshing.files.raw import STRAIGHTENED, RawMesh
from tetlux.meshing.files.second_order import straighten
from tetlux.meshing.files.vtu import write_vtu
from tetlux.meshing.host.filesystem import exists, is_file, is_folder
from tetlux.meshing.host.scratch import scratch
from tetlux.meshing.tets.given import Given, make_checked_mesh
from tetlux.meshing.tets.mesh import TetMesh

if TYPE_CHECKING:
    import meshio

__all__ = ["read_mesh", "read_with_meshio", "write_mesh"]

WRITTEN = (".vtu", ".msh")
# Formats by lower-case suffix. Other formats of meshio have no tetrahedra or are not read reliably.
NAMED = (".vtu", ".vtk", ".msh", ".mesh", ".inp", ".node")
MESHIO = {
    ".vtu": "vtu",
    ".vtk": "vtk",
    ".msh": "ansys",
    ".mesh": "medit",
    ".meshb": "medit",
    ".inp": "abaqus",
    ".node": "tetgen",
    ".ele": "tetgen",
    ".bdf": "nastran",
    ".nas": "nastran",
    ".fem": "nastran",
    ".avs": "avsucd",
    ".vol": "netgen",
    ".su2": "su2",
    ".ugrid": "ugrid",
    ".xml": "dolfin-xml",
    ".f3grid": "flac3d",
    ".mdpa": "mdpa",
    ".xdmf": "xdmf",
    ".xmf": "xdmf",
    ".cgns": "cgns",
    ".med": "med",
    ".e": "exodus",
    ".exo": "exodus",
    ".ex2": "exodus",
}


def read_mesh(path: str | Path, *, unit: str = "mm", scale: float = 1.0, labels: str | None = None) -> TetMesh:
    """Read a tetrahedral mesh, repair what can be repaired safely, and check it.

    Parameters
    ----------
    path : str or Path
        VTU, VTK, gmsh (2.2 and 4.1, text or binary), Medit, Abaqus, NIRFAST (any of its .node, .elem and .region
        files, or their name without a suffix), TetGen, Nastran and what else meshio reads.
    unit : str
        Unit of the coordinates after multiplication by `scale`: nm, um, mm, cm, m or in.
    scale : float
        Factor applied to the file's coordinates.
    labels : str, optional
        The array of cell values that holds the labels, where the file has several: physical groups of gmsh
        ("gmsh:physical"), or an array called region, label, material or the like, unless another one is given here.

    Returns
    -------
    TetMesh
        `regions` holds the label of each tetrahedron, `labels` their names, `repairs` and `warnings` what was done and
        what a user should know.

    Raises
    ------
    InputError
        If the file is missing or unreadable, holds other solid cells than tetrahedra or none, or its tetrahedra cannot
        be mended: see `mesh_from_arrays`.

    Examples
    --------
    >>> mesh = read_mesh("head.msh", unit="mm")  # doctest: +SKIP
    >>> mesh.labels  # doctest: +SKIP
    {1: 'scalp', 2: 'skull'}
    """
    path = Path(path)
    if not np.isfinite(scale) or scale <= 0:
        raise InputError(f"scale is {scale:g}; give a factor greater than 0.")
    try:
        raw = _read(path)
        corners, notes = raw.corners()
        found = labels_of(raw, labels)
        given = Given(
            scale * raw.points,
            corners,
            found.values,
            found.names,
            numbered_from=None,
            repairs=notes,
            warnings=(*raw.notes, *found.notes),
        )
        return make_checked_mesh(given, unit)[0]
    except InputError as error:
        said = str(error)
        raise InputError(said if said.startswith(str(path)) else f"{path}: {said}") from error


def _read(path: Path) -> RawMesh:
    suffix = path.suffix.lower()
    named = nirfast.nirfast_files(path) if suffix in nirfast.SUFFIXES or not is_file(path) else {}
    beside = suffix == ".node" and ".elem" not in named and is_file(path.with_suffix(".ele"))
    try:
        if named and not beside and (suffix in nirfast.SUFFIXES or ".elem" in named):
            return nirfast.read_nirfast(named)
        if not is_file(path):
            what = "is a folder" if is_folder(path) else "is no file but a device" if exists(path) else "does not exist"
            raise InputError(f"{path} {what}; check the path of the mesh file.")
        if suffix not in MESHIO:
            raise InputError(f'{path}: "{path.suffix}" is no volume mesh format here; give one of {", ".join(NAMED)}.')
        if suffix == ".msh" and is_gmsh(path):
            return read_gmsh(path)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error
    except Exception as error:  # a damaged file can make its reader raise anything
        raise InputError(f"{path} is not a readable {suffix[1:].upper()} mesh; export it again.") from error
    data, straight = _read_linear(path, suffix)
    arrays = {name: list(values) for name, values in data.cell_data.items()}
    points = np.asarray(data.points, dtype=np.float64)
    cells = [(block.type, block.data) for block in data.cells]
    notes = (STRAIGHTENED.format(straight),) if straight else ()
    return RawMesh(points, cells, arrays, notes=notes, sets=data.cell_sets)


def _read_linear(path: Path, suffix: str) -> "tuple[meshio.Mesh, int]":
    """Read a file with meshio, second-order tetrahedra as linear ones, and return how many of these there are."""
    try:
        linear, count = straighten(path.read_bytes(), suffix)
    except (OSError, ValueError):
        count = 0
    if count == 0:
        return read_with_meshio(path, MESHIO[suffix]), 0
    with scratch("mesh") as folder:
        copy = folder / f"linear{suffix}"
        copy.write_bytes(linear)
        try:
            return read_with_meshio(copy, MESHIO[suffix]), count
        except InputError as error:
            raise InputError(str(error).replace(str(copy), str(path))) from error


def read_with_meshio(path: Path, file_format: str) -> "meshio.Mesh":
    """Read a file with meshio, without meshio's output on the terminal.

    Raises
    ------
    InputError
    """
    import meshio  # noqa: PLC0415

    try:
        silent = io.StringIO()
        with contextlib.redirect_stderr(silent), contextlib.redirect_stdout(silent), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return meshio.read(path, file_format=file_format)
    except ImportError as error:
        package = error.name or "another package"
        raise InputError(f"{path} needs {package}, which is not installed; save it as .vtu or .msh.") from error
    except (Exception, SystemExit) as error:  # meshio's readers can raise anything, or exit
        raise InputError(
            f"{path} is not a readable {path.suffix[1:].upper()} mesh; export it again, or as .msh or .vtu."
        ) from error


def write_mesh(mesh: TetMesh, path: str | Path, values: Mapping[str, FloatArray] | None = None) -> None:
    """Write a tetrahedral mesh with named values at its nodes, and the labels of its tetrahedra if any.

    Parameters
    ----------
    mesh : TetMesh
    path : str or Path
        Ends in .vtu (VTK, binary; labels are the array `region`) or .msh (gmsh 4.1, binary; labels are physical
        groups, with their names).
    values : mapping of str to (n,) ndarray, optional

    Raises
    ------
    InputError
        If the suffix is not supported.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in WRITTEN:
        raise InputError(f'{path}: "{path.suffix}" is no volume mesh format here; use {" or ".join(WRITTEN)}.')
    if suffix == ".msh":
        write_gmsh(mesh, path, values or {})
        return
    write_vtu(mesh, path, values or {}, {REGION: mesh.regions.astype(np.int32)} if mesh.regions.any() else {})
