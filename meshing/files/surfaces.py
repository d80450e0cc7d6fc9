"""Surface files: STL, OBJ, PLY, OFF, GLB, GLTF and 3MF."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.files.formats.encoding import as_utf8
from tetlux.meshing.files.formats.obj import read_obj
from tetlux.meshing.files.formats.off import read_off
from tetlux.meshing.files.formats.ply import read_ply
from tetlux.meshing.files.formats.scene import read_scene, unit_of_3mf
from tetlux.meshing.files.formats.stl import read_stl
from tetlux.meshing.host.filesystem import exists, is_file, is_folder
from tetlux.meshing.host.quiet import quiet
from tetlux.meshing.repair.holes import Holes
from tetlux.meshing.repair.pipeline import surface_from_arrays
from tetlux.meshing.surface.surface import MILLIMETRES, Surface

READERS: dict[str, Callable[[bytes], tuple[FloatArray, IntArray]]] = {
    ".stl": read_stl,
    ".obj": read_obj,
    ".ply": read_ply,
    ".off": read_off,
}
# Units are equal if their ratio differs from 1 by less than this.
UNIT_ROUNDING = 1e-9
SUFFIXES = (*READERS, ".glb", ".gltf", ".3mf")


def read_surface(path: str | Path, *, unit: str = "mm", scale: float = 1.0, holes: Holes = "small") -> Surface:
    """Read a closed triangle mesh from a file, check it, and repair what can be repaired safely.

    Parameters
    ----------
    path : str or Path
        STL (text or binary), OBJ, PLY, OFF, GLB, GLTF or 3MF.
    unit : str
        Unit of the coordinates after multiplication by `scale`: nm, um, mm, cm, m or in.
    scale : float
        Factor applied to the file's coordinates.
    holes : "small", "close" or "refuse"
        Which holes are capped: see `surface_from_arrays`.

    Returns
    -------
    Surface

    Raises
    ------
    InputError
        If the file is missing, unreadable, no mesh, or bounds no body.

    Examples
    --------
    >>> scan = read_surface("scan.obj", unit="mm", scale=1000, holes="close")  # doctest: +SKIP
    """
    path = Path(path)
    if not np.isfinite(scale) or scale <= 0:
        raise InputError(f"scale is {scale:g}; give a factor greater than 0.")
    try:
        if is_folder(path):
            raise InputError(f"{path} is a folder; give a surface file ({', '.join(SUFFIXES)}).")
        if not is_file(path):
            found = "is no file but a device" if exists(path) else "does not exist"
            raise InputError(f"{path} {found}; check the path of the surface file.")
        if path.suffix.lower() not in SUFFIXES:
            raise InputError(f'{path}: "{path.suffix}" files are not read; give one of {", ".join(SUFFIXES)}.')
        if path.stat().st_size == 0:
            raise InputError(f"{path} is empty; give a closed triangle mesh.")
        with path.open("rb"):
            pass
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error
    try:
        points, faces = _load(path)
    except InputError:
        raise
    except Exception as error:  # a damaged file can make its reader raise anything
        beside = ", or a file that it names is not there" if path.suffix.lower() == ".gltf" else ""
        raise InputError(
            f"{path} is not a readable {path.suffix.lstrip('.').upper()} mesh{beside}; export it again."
        ) from error
    surface = surface_from_arrays(points * scale, faces, unit=unit, name=path.name, holes=holes)
    said = _other_unit(path, unit) if path.suffix.lower() == ".3mf" and scale == 1.0 else ()
    return replace(surface, warnings=(*surface.warnings, *said)) if said else surface


def _other_unit(path: Path, unit: str) -> tuple[str, ...]:
    """A warning if a 3MF file declares another unit than the one that it is read in."""
    of_file, millimetres = unit_of_3mf(path)
    factor = millimetres / MILLIMETRES[unit]
    if abs(factor - 1.0) < UNIT_ROUNDING:
        return ()
    return (
        f"the file says that its unit is the {of_file}, and its numbers are taken as {unit}; give scale: {factor:g} "
        "for its true size.",
    )


def _load(path: Path) -> tuple[FloatArray, IntArray]:
    reader = READERS.get(path.suffix.lower())
    try:
        with quiet(), np.errstate(all="ignore"):
            points, faces = reader(as_utf8(path.read_bytes())) if reader else read_scene(path)
    except InputError as error:
        raise InputError(f"{path} {error}") from error
    if len(faces) == 0:
        raise InputError(f"{path} holds no triangles; give a closed triangle mesh.")
    return points, faces
