"""Read NIRFAST's text files: ``NAME.node``, ``NAME.elem`` and, if there are regions, ``NAME.region``."""

import re
from pathlib import Path

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.files.raw import RawMesh
from tetlux.meshing.host.filesystem import is_file
from tetlux.meshing.notes import Note

SUFFIXES = (".node", ".elem", ".region")
REGION = "region"


def nirfast_files(path: Path) -> dict[str, Path]:
    """The files of a mesh by suffix, given the path of any one of them or their common stem."""
    stem = path.name[: -len(path.suffix)] if path.suffix.lower() in SUFFIXES else path.name
    wanted = {f"{stem}{suffix}".lower(): suffix for suffix in SUFFIXES}
    try:
        beside = sorted(path.parent.iterdir())
    except (OSError, ValueError):  # the name may be invalid for a folder
        return {}
    found = {wanted[file.name.lower()]: file for file in beside if file.name.lower() in wanted and is_file(file)}
    exact = {suffix: path.parent / f"{stem}{suffix}" for suffix in SUFFIXES}
    return {**found, **{suffix: file for suffix, file in exact.items() if is_file(file)}}


def read_nirfast(files: dict[str, Path]) -> RawMesh:
    """Read a mesh.

    Nodes are given as a mark of the boundary and three coordinates, tetrahedra as node numbers from 1, and regions one
    for each node, or for each tetrahedron.

    Raises
    ------
    InputError
        If a file is missing, is no table of numbers, or does not match the others.
    """
    for suffix in SUFFIXES[:2]:
        if suffix not in files:
            there = " and ".join(file.name for file in files.values())
            raise InputError(f"{there} needs the {suffix} file of the same name beside it.")
    nodes, elements = _table(files[".node"]), _table(files[".elem"])
    if nodes.shape[1] == 3 and elements.shape[1] == 3:
        raise InputError("it is a mesh of triangles in a plane; give a mesh of tetrahedra.")
    if nodes.shape[1] not in (3, 4) or elements.shape[1] < 4:
        raise InputError(
            f"{files['.node'].name} has {nodes.shape[1]} columns and {files['.elem'].name} {elements.shape[1]}; give a "
            "mark and three coordinates for each node, and four node numbers for each tetrahedron."
        )
    cells = elements[:, :4].astype(np.int64)
    # NIRFAST counts from 1; some programs write its files counting from 0.
    cells -= 0 if (cells == 0).any() else 1
    cells[cells >= len(nodes)] = -1
    arrays: dict[str, list[FloatArray]] = {}
    notes: tuple[str, ...] = ()
    if ".region" in files:
        regions, notes = _regions(_table(files[".region"])[:, 0], cells, len(nodes))
        arrays = {REGION: [regions]}
    return RawMesh(nodes[:, -3:], [("tetra", cells)], arrays, notes=notes)


def _table(path: Path) -> FloatArray:
    """The numbers of a text file, one row per line."""
    text = path.read_text(encoding="utf-8", errors="replace")
    rows = [line for line in re.sub(r"[%#].*|,", " ", text).splitlines() if line.strip()]
    if not rows:
        raise InputError(f"{path.name} is empty; give a row for each node or tetrahedron.")
    width = len(rows[0].split())
    try:
        return np.array(" ".join(rows).split(), dtype=np.float64).reshape(len(rows), width)
    except ValueError as error:
        raise InputError(f"{path.name} is no table of numbers with as many in each line; export it again.") from error


def _regions(values: FloatArray, cells: IntArray, nodes: int) -> tuple[FloatArray, tuple[str, ...]]:
    """The region of each tetrahedron, from regions of tetrahedra or of nodes."""
    if len(values) == len(cells) != nodes:
        return values, ()
    if len(values) != nodes:
        raise InputError(f"there are {len(values):,} regions for {nodes:,} nodes and {len(cells):,} tetrahedra.")
    corners = np.sort(values[cells], axis=1)
    # The most frequent of four sorted values is always the second or the third; the lower one in ties.
    low, high = corners[:, 1], corners[:, 2]
    more = (corners == high[:, None]).sum(axis=1) > (corners == low[:, None]).sum(axis=1)
    mixed = int((corners[:, 0] != corners[:, 3]).sum())
    sentence = f"{mixed:,} tetrahedra have nodes of several regions; each is in that of most of its corners."
    note = Note("labels-mixed", sentence, value=mixed)
    return np.where(more, high, low), (note,) if mixed else ()
