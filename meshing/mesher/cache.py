"""The mesh cache: files in the user's cache directory, keyed by a hash of surfaces and settings."""

import contextlib
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tetlux.meshing.host.scratch import is_abandoned
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Increase it when the same settings give another mesh, or when the files change.
FORMAT = 3
# Largest cache size, bytes; the least recently used entries are removed first.
LARGEST_CACHE = 1_000_000_000


def cache_directory() -> Path | None:
    """The directory of the mesh cache: ``$TETLUX_CACHE_DIR``, or else ``tetlux`` in the system's cache directory.

    None if there is none, as for a container's user without a home.
    """
    chosen = os.environ.get("TETLUX_CACHE_DIR")
    if chosen:
        return Path(chosen)
    with contextlib.suppress(RuntimeError):
        if sys.platform == "darwin":
            return Path.home() / "Library" / "Caches" / "tetlux"
        if os.name == "nt":
            return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "tetlux"
        # The XDG specification: relative paths are to be ignored.
        user = Path(os.environ.get("XDG_CACHE_HOME", ""))
        return (user if user.is_absolute() else Path.home() / ".cache") / "tetlux"
    return None


def mesh_key(surface: Surface, regions: Sequence[Surface] = (), **settings: float | str) -> str:
    """The cache key of a mesh: a hash of its surfaces and settings."""
    surfaces = [surface, *regions]
    shapes = [[s.points.shape, s.faces.shape, s.crease_angle, s.overlaps, s.unit == surface.unit] for s in surfaces]
    digest = hashlib.blake2b(json.dumps([FORMAT, shapes, sorted(settings.items())]).encode(), digest_size=20)
    for each in surfaces:
        digest.update(each.points.astype("<f8").tobytes())
        digest.update(each.faces.astype("<i8").tobytes())
    return digest.hexdigest()


def is_entry(key: str, directory: Path) -> bool:
    """Whether the cache has a file under a key."""
    return _entry_path(key, directory).is_file()


def load_cached_mesh(key: str, directory: Path, unit: str) -> TetMesh | None:
    """The cached mesh of a key, or None if there is none or its file is unusable."""
    path = _entry_path(key, directory)
    try:
        # Opened here, since np.load does not close a truncated file.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            points, tetrahedra, regions = data["points"], data["tetrahedra"], data["regions"]
            types = points.dtype, tetrahedra.dtype, regions.dtype
            if str(data["key"]) != key or types != (np.float64, np.int64, np.int64) or regions.min() < 0:
                return None
        mesh = TetMesh(points, tetrahedra, unit, regions)
    except Exception:  # a foreign, truncated or damaged file is a cache miss, whatever its reader raises
        return None
    with contextlib.suppress(OSError):
        os.utime(path)
    return mesh


def store_cached_mesh(key: str, directory: Path, mesh: TetMesh) -> None:
    """Write a mesh to the cache under a key; do nothing if files cannot be written."""
    with contextlib.suppress(OSError, MemoryError):
        directory.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=directory, suffix=".part")
        part = Path(name)
        try:
            # A full disk may be reported only when the file is closed.
            with os.fdopen(handle, "wb") as file:
                np.savez(
                    file,
                    points=mesh.points,
                    tetrahedra=mesh.tetrahedra,
                    regions=mesh.regions,
                    key=np.array(key),
                )
            # An atomic rename, so that other processes see the whole entry or none.
            part.replace(_entry_path(key, directory))
        except BaseException:
            part.unlink()
            raise
        _make_room(directory)


def _entry_path(key: str, directory: Path) -> Path:
    return directory / f"{key}.npz"


def _make_room(directory: Path) -> None:
    """Remove the least recently used entries beyond the size limit, and unfinished files of killed processes."""
    entries = []
    for path in directory.iterdir():
        with contextlib.suppress(OSError):  # another process may be removing it too
            status = path.stat()
            if path.suffix == ".npz":
                entries.append((status.st_mtime, status.st_size, path))
            elif path.suffix == ".part" and is_abandoned(path):
                path.unlink()
    total = sum(size for _, size, _ in entries)
    for _, size, path in sorted(entries, key=lambda entry: entry[0]):
        if total <= LARGEST_CACHE:
            break
        with contextlib.suppress(OSError):
            path.unlink()
        total -= size
