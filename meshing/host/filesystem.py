"""Whether a path names a file, whatever is in the path."""

import os
from pathlib import Path


def is_file(path: Path) -> bool:
    """Whether it is a regular file: no folder, no pipe, no device, and no name that no file can have."""
    return os.path.isfile(path)  # noqa: PTH113 - Path.is_file raises where a name is too long


def is_folder(path: Path) -> bool:
    """Whether it is a folder."""
    return os.path.isdir(path)  # noqa: PTH112


def exists(path: Path) -> bool:
    """Whether there is anything of that name."""
    return os.path.exists(path)  # noqa: PTH110
