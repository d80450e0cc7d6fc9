"""Write gmsh files of version 4.1, binary (Gmsh reference manual, section "MSH file format")."""

import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.tets.mesh import TetMesh

# Gmsh's type number of linear tetrahedra, and the dimension of their entities.
TETRAHEDRON, SOLID = 4, 3


def write_gmsh(mesh: TetMesh, path: Path, values: Mapping[str, FloatArray]) -> None:
    """Write a mesh, its labels as physical groups (0 as none), and values at its nodes.

    Parameters
    ----------
    mesh : TetMesh
    path : Path
    values : mapping of str to (n,) ndarray

    Raises
    ------
    InputError
        If a label is negative, which means reversed orientation in gmsh.
    """
    labels = np.unique(mesh.regions).tolist()
    if labels[0] < 0:
        raise InputError(f"label {labels[0]} is negative, and physical groups of gmsh are not; write a .vtu file.")
    with path.open("wb") as file:
        file.write(b"$MeshFormat\n4.1 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n")
        if mesh.labels:
            lines = "".join(f'{SOLID} {label} "{name}"\n' for label, name in mesh.labels.items())
            file.write(f"$PhysicalNames\n{len(mesh.labels)}\n{lines}$EndPhysicalNames\n".encode())
        file.write(b"$Entities\n" + struct.pack("<4Q", 0, 0, 0, len(labels)))
        box = [*mesh.points.min(axis=0), *mesh.points.max(axis=0)]
        for entity, label in enumerate(labels, 1):
            groups = struct.pack("<Qi", 1, label) if label > 0 else struct.pack("<Q", 0)
            file.write(struct.pack("<i6d", entity, *box) + groups + struct.pack("<Q", 0))
        file.write(b"\n$EndEntities\n")
        _write_mesh(mesh, labels, file.write)
        for name, each in values.items():
            head = f'$NodeData\n1\n"{name}"\n1\n0\n3\n0\n1\n{len(each)}\n'
            file.write(head.encode() + _number_values(each).tobytes() + b"\n$EndNodeData\n")


def _write_mesh(mesh: TetMesh, labels: list[int], write: Callable[[bytes], object]) -> None:
    nodes, cells = len(mesh.points), len(mesh.tetrahedra)
    write(b"$Nodes\n" + struct.pack("<4Q3iQ", 1, nodes, 1, nodes, SOLID, 1, 0, nodes))
    write(np.arange(1, nodes + 1, dtype="<u8").tobytes() + mesh.points.astype("<f8").tobytes() + b"\n$EndNodes\n")
    write(b"$Elements\n" + struct.pack("<4Q", len(labels), cells, 1, cells))
    for entity, label in enumerate(labels, 1):
        inside = np.flatnonzero(mesh.regions == label)
        write(struct.pack("<3iQ", SOLID, entity, TETRAHEDRON, len(inside)))
        write(np.column_stack([inside + 1, mesh.tetrahedra[inside] + 1]).astype("<u8").tobytes())
    write(b"\n$EndElements\n")


def _number_values(values: FloatArray) -> npt.NDArray[np.void]:
    """Values with their node numbers, from 1."""
    rows = np.empty(len(values), dtype=[("node", "<i4"), ("value", "<f8")])
    rows["node"], rows["value"] = np.arange(1, len(values) + 1), values
    return rows
