"""Surface files: STL, OBJ, PLY, OFF, GLB and 3MF, through trimesh."""

import logging
from pathlib import Path

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.paths import exists, is_file, is_folder
from tetlux.meshing.repair import surface_from_arrays
from tetlux.meshing.surface import Surface

SUFFIXES = (".stl", ".obj", ".ply", ".off", ".glb", ".gltf", ".3mf")


def read_surface(path: str | Path, *, unit: str = "mm", scale: float = 1.0) -> Surface:
    """Read a closed triangle mesh from a file, check it, and mend what can be mended safely.

    Parameters
    ----------
    path : str or Path
        STL (text or binary), OBJ, PLY, OFF, GLB, GLTF or 3MF.
    unit : str
        Unit of the coordinates once multiplied by `scale`: nm, um, mm, cm, m or in.
    scale : float
        Factor on the file's coordinates.

    Returns
    -------
    Surface

    Raises
    ------
    InputError
        If the file is missing, unreadable, no mesh, or bounds no body.
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
    except Exception as error:  # the readers raise whatever their parsing ran into
        beside = ", or a file that it names is not there" if path.suffix.lower() == ".gltf" else ""
        raise InputError(
            f"{path} is not a readable {path.suffix.lstrip('.').upper()} mesh{beside}; export it again."
        ) from error
    return surface_from_arrays(points * scale, faces, unit=unit, name=path.name)


def _load(path: Path) -> tuple[FloatArray, IntArray]:
    import trimesh  # noqa: PLC0415
    from trimesh.resolvers import ZipResolver  # noqa: PLC0415

    # Of a file's pictures and materials nothing is wanted: only glTF has triangles in other files.
    resolver = None if path.suffix.lower() == ".gltf" else ZipResolver({})
    log = logging.getLogger("trimesh")
    was = log.disabled
    try:
        # What it says of a broken file is said here in a sentence.
        log.disabled = True
        with np.errstate(all="ignore"):
            scene = trimesh.load_scene(path, resolver=resolver, process=False)
            meshes = [m for m in scene.dump() if isinstance(m, trimesh.Trimesh)]
    finally:
        log.disabled = was
    if not meshes:
        raise InputError(f"{path} holds no triangles, or was cut short; give a closed triangle mesh.")
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes])
    points = np.vstack([m.vertices for m in meshes])
    faces = np.vstack([np.asarray(m.faces) + o for m, o in zip(meshes, offsets, strict=False)])
    return np.asarray(points, dtype=np.float64), np.asarray(faces, dtype=np.int64)
