"""`content_of`: a hash by which a finished run is recognised, whatever its files are called and how old they are."""

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import Any

from tetlux import __version__
from tetlux.cases.file.case import Case
from tetlux.cases.write.run_record import PATHS, describe_run
from tetlux.meshing.errors import InputError

# Increase it when the same case gives other results.
NUMERICS = 5
# Characters of the hash.
LENGTH = 32
# Keys that do not change what is computed or written.
WITHOUT_EFFECT = ("name",)


def content_of(case: Case) -> str:
    """Hash a case as it is run, the contents of the files it names, and the version of the numerics.

    Parameters
    ----------
    case : Case

    Returns
    -------
    str
        Hexadecimal digits.
    """
    return content_of_scene(describe_run(case)["scene"])


def content_of_scene(scene: dict[str, Any]) -> str:
    """`content_of` a case by its description, `describe_run(case)["scene"]`."""
    scene = {key: value for key, value in scene.items() if key not in WITHOUT_EFFECT}
    text = json.dumps([NUMERICS, __version__, _by_content(scene)], sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=LENGTH // 2).hexdigest()


def _by_content(value: dict[str, Any] | list[Any]) -> Any:
    """Plain data with a hash of the content in place of each path."""
    if isinstance(value, dict):
        return {key: _content_at(key, entry) for key, entry in value.items()}
    return [_by_content(entry) if isinstance(entry, dict | list) else entry for entry in value]


def _content_at(key: str, entry: Any) -> Any:
    """`_by_content` of the entry under a key."""
    if isinstance(entry, dict | list):
        return _by_content(entry)
    return _hash_of_files(entry) if key in PATHS and isinstance(entry, str) else entry


def _hash_of_files(pattern: str) -> list[str]:
    """A hash of each file that a path or pattern names, in the order of their names."""
    path = Path(pattern)
    found = [path] if path.is_file() else sorted(path.parent.glob(path.name))
    try:
        return [_hash_of_file(each, *_state(each)) for each in found if each.is_file()]
    except OSError as error:
        raise InputError(f"{pattern} cannot be read: {error.strerror}; check its permissions.") from error


def _state(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_size, status.st_mtime_ns


@lru_cache(maxsize=256)
def _hash_of_file(path: Path, _size: int, _changed: int) -> str:
    """A hash of a file, which is read again only if its size or time changes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=LENGTH // 2)).hexdigest()
