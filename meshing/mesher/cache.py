"""Meshes remembered: files in the user's cache directory, named by all that shapes a mesh."""

import contextlib
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tetlux.meshing.host.scratch import abandoned
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# To be raised whenever the code makes other meshes of the same settings, or writes them otherwise.
FORMAT = 2
# Bytes; the entries that were used longest ago go first.
LIMIT = 1_000_000_000


def cache_directory() -> Path | None:
    """Where meshes are kept: ``$TETLUX_CACHE_DIR``, or else ``tetlux`` in the system's place for caches.

    None if there is no such place: a container's user may have no home.
    """
    own = os.environ.get("TETLUX_CACHE_DIR")
    if own:
        return Path(own)
    with contextlib.suppress(RuntimeError):
        if sys.platform == "darwin":
            return Path.home() / "Library" / "Caches" / "tetlux"
        if os.name == "nt":
            return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "tetlux"
        # The XDG specification: relative paths are to be ignored.
        given = Path(os.environ.get("XDG_CACHE_HOME", ""))
        return (given if given.is_absolute() else Path.home() / ".cache") / "tetlux"
    return None


def mesh_key(surface: Surface, regions: Sequence[Surface] = (), **settings: float | str) -> str:
    """A name for the mesh that these settings make of a surface and those in it: a hash of all that."""
    surfaces = [surface, *regions]
    shapes = [[s.points.shape, s.faces.shape, s.crease_angle, s.overlaps, s.unit == surface.unit] for s in surfaces]
    digest = hashlib.blake2b(json.dumps([FORMAT, shapes, sorted(settings.items())]).encode(), digest_size=20)
    for each in surfaces:
        digest.update(each.points.astype("<f8").tobytes())
        digest.update(each.faces.astype("<i8").tobytes())
    return digest.hexdigest()


def remembered_mesh(key: str, directory: Path, unit: str) -> TetMesh | None:
    """The mesh of that name, or None if there is none, or none that can be used."""
    path = _entry(key, directory)
    try:
        # Opened here: np.load leaves a file that is cut off open.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            points, tetrahedra, regions = data["points"], data["tetrahedra"], data["regions"]
            types = points.dtype, tetrahedra.dtype, regions.dtype
            if str(data["key"]) != key or types != (np.float64, np.int64, np.int64) or regions.min() < 0:
                return None
        mesh = TetMesh(points, tetrahedra, unit, regions)
    except Exception:  # whatever a foreign, cut or damaged file can make its reader raise: it is a miss
        return None
    with contextlib.suppress(OSError):
        os.utime(path)
    return mesh


def remember_mesh(key: str, directory: Path, mesh: TetMesh) -> None:
    """Keep a mesh under that name; do nothing where files cannot be written."""
    with contextlib.suppress(OSError, MemoryError):
        directory.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=directory, suffix=".part")
        part = Path(name)
        try:
            # A full disk may show only as the file is closed.
            with os.fdopen(handle, "wb") as file:
                np.savez(
                    file,
                    points=mesh.points,
                    tetrahedra=mesh.tetrahedra,
                    regions=mesh.regions,
                    key=np.array(key),
                )
            # Other processes see the whole entry or none.
            part.replace(_entry(key, directory))
        except BaseException:
            part.unlink()
            raise
        _make_room(directory)


def _entry(key: str, directory: Path) -> Path:
    return directory / f"{key}.npz"


def _make_room(directory: Path) -> None:
    """Remove what was used longest ago beyond the limit, and what dead processes left half-written."""
    found = []
    for path in directory.iterdir():
        with contextlib.suppress(OSError):  # another process may be removing it too
            status = path.stat()
            if path.suffix == ".npz":
                found.append((status.st_mtime, status.st_size, path))
            elif path.suffix == ".part" and abandoned(path):
                path.unlink()
    total = sum(size for _, size, _ in found)
    for _, size, path in sorted(found, key=lambda entry: entry[0]):
        if total <= LIMIT:
            break
        with contextlib.suppress(OSError):
            path.unlink()
        total -= size
