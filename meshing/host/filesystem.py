"""Tests of paths that do not raise, whatever the path contains."""

import os
from pathlib import Path


def is_file(path: Path) -> bool:
    """Whether the path is a regular file; False for names that no file can have."""
    return os.path.isfile(path)  # noqa: PTH113 - Path.is_file raises where a name is too long


def is_folder(path: Path) -> bool:
    """Whether the path is a folder."""
    return os.path.isdir(path)  # noqa: PTH112


def exists(path: Path) -> bool:
    """Whether the path exists."""
    return os.path.exists(path)  # noqa: PTH110
