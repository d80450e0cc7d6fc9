"""Labelled meshes: broken in what they say, and damaged as files."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from tests.meshes_made import cube_of_cubes
from tetlux.meshing import TetMesh, refine
from tetlux.meshing.files.meshes import write_mesh

POINTS, TETRAHEDRA, PLACES = cube_of_cubes(3, 4.0)
LABELS = np.where(PLACES[:, 2] == 0, 1, 2)
UPPER = LABELS == 2
# How many of each file are damaged at random.
DAMAGED = 25


def vtu(
    points: Any = POINTS, cells: Any = TETRAHEDRA, labels: Any = LABELS, kind: str = "tetra", **arrays: Any
) -> bytes:
    """A VTU file of one kind of cells."""
    data = {name: [np.asarray(values)] for name, values in arrays.items()}
    if labels is not None:
        data["region"] = [np.asarray(labels)]
    return written(meshio.Mesh(points, [(kind, cells)], cell_data=data), "vtu")


def written(mesh: Any, suffix: str, **options: Any) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"mesh.{suffix}"
        if isinstance(mesh, TetMesh):
            write_mesh(mesh, path)
        else:
            mesh.write(path, **options)
        return path.read_bytes()


def broken() -> Iterator[tuple[str, bytes]]:
    """VTU files whose cells make no body, or whose labels are odd."""
    double, twice = np.vstack([POINTS, POINTS]), np.vstack([TETRAHEDRA, TETRAHEDRA])
    own = np.where(UPPER[:, None], TETRAHEDRA + len(POINTS), TETRAHEDRA)
    yield "right", vtu()
    yield "doubled nodes", vtu(double, own)
    for shift in (1e-7, 1e-5, 1e-3, 0.1, 1.0, 3.9):
        for axis, way in (("along", [shift, 0, 0]), ("apart", [0, 0, shift]), ("into each other", [0, 0, -shift])):
            yield f"halves {shift:g} {axis}", vtu(np.vstack([POINTS, POINTS + np.array(way)]), own)
    lower, upper = (TetMesh(POINTS, TETRAHEDRA[part]) for part in (~UPPER, UPPER))
    fine = refine(refine(upper, np.ones(UPPER.sum(), dtype=bool)), np.ones(2 * int(UPPER.sum()), dtype=bool))
    cells = np.vstack([lower.tetrahedra, fine.tetrahedra + len(POINTS)])
    numbers = np.repeat([1, 2], [len(lower.tetrahedra), len(fine.tetrahedra)])
    yield "hanging nodes", vtu(np.vstack([POINTS, fine.points]), cells, numbers)
    yield "given twice", vtu(POINTS, twice, np.tile(LABELS, 2))
    yield (
        "given twice, with their nodes",
        vtu(double, np.vstack([TETRAHEDRA, TETRAHEDRA + len(POINTS)]), np.tile(LABELS, 2)),
    )
    yield "given twice, with other labels", vtu(POINTS, twice, np.concatenate([LABELS, 3 - LABELS]))
    yield (
        "two bodies in one place",
        vtu(np.vstack([POINTS, POINTS + 1.3]), np.vstack([TETRAHEDRA, TETRAHEDRA + len(POINTS)]), np.tile(LABELS, 2)),
    )
    yield "one tetrahedron twice", vtu(POINTS, TETRAHEDRA[[0, 0, -1]], [1, 1, 2])
    yield (
        "two on one side of a face",
        vtu(
            np.vstack([POINTS, [[2, 2, 9]]]), np.vstack([TETRAHEDRA, [[*TETRAHEDRA[0, :3], len(POINTS)]]]), [*LABELS, 1]
        ),
    )
    yield "inverted", vtu(POINTS, TETRAHEDRA[:, [1, 0, 2, 3]])
    yield "some inverted", vtu(POINTS, np.where(np.arange(len(LABELS))[:, None] % 3, TETRAHEDRA, TETRAHEDRA[:, ::-1]))
    yield "soup", vtu(POINTS[TETRAHEDRA].reshape(-1, 3), np.arange(TETRAHEDRA.size).reshape(-1, 4))
    yield "islands", vtu(labels=np.where(np.arange(len(LABELS)) % 7 == 0, 1, 2))
    yield "a cavity", vtu(POINTS, TETRAHEDRA[(PLACES != 1).any(axis=1)], LABELS[(PLACES != 1).any(axis=1)])
    yield (
        "cubes that touch in edges",
        vtu(POINTS, TETRAHEDRA[PLACES.sum(axis=1) % 2 == 0], LABELS[PLACES.sum(axis=1) % 2 == 0]),
    )
    yield "bodies apart", vtu(double + np.repeat([[0.0, 0, 0], [30, 0, 0]], len(POINTS), axis=0), own)
    yield "one collapsed", vtu(POINTS, np.vstack([TETRAHEDRA, [[0, 0, 1, 2]]]), [*LABELS, 1])
    yield "one flat on the outside", vtu(POINTS, np.vstack([TETRAHEDRA, [[0, 1, 4, 5]]]), [*LABELS, 1])
    yield "all flat", vtu(POINTS * [1, 1, 0])
    squashed = POINTS.copy()
    squashed[21] = squashed[22]
    yield "one node on another", vtu(squashed)
    yield "thin", vtu(POINTS * [1, 1, 1e-6])
    yield "all at one place", vtu(POINTS * 0)
    yield "in another unit", vtu(POINTS * 1e-4)
    yield "far away", vtu(POINTS + 1e9)
    yield "numbered from 1", vtu(POINTS, TETRAHEDRA + 1)
    yield "numbered below 0", vtu(POINTS, TETRAHEDRA - 1)
    for bad in (np.nan, np.inf, 1e300):
        moved = POINTS.copy()
        moved[5, 1] = bad
        yield f"a node at {bad}", vtu(moved)
    yield "no labels", vtu(labels=None)
    yield "labels of another name", vtu(labels=None, material=LABELS)
    yield "two arrays that may be labels", vtu(labels=None, one=LABELS, two=LABELS)
    yield "labels in threes", vtu(labels=np.ones((len(LABELS), 3)))
    for name, values in (
        ("as decimals", LABELS.astype(float)),
        ("of halves", LABELS + 0.5),
        ("of nan", LABELS * np.nan),
        ("of 1e300", LABELS * 1e300),
        ("below 0", -LABELS),
        ("of 0 and 1", LABELS - 1),
        ("one more", np.where(np.arange(len(LABELS)) == 3, 3, LABELS)),
        ("one too few", np.ones_like(LABELS)),
        ("one for each", np.arange(len(LABELS))),
        ("of bytes", LABELS.astype(np.uint8)),
        ("near 2^63", LABELS + (2**63 - 4)),
    ):
        yield f"labels {name}", vtu(labels=values)
    eight = np.array([[0, 1, 5, 4, 16, 17, 21, 20]])
    yield "hexahedra", vtu(POINTS, eight, [1], kind="hexahedron")
    blocks = [("tetra", TETRAHEDRA), ("wedge", eight[:, :6]), ("pyramid", eight[:, :5])]
    yield "wedges among them", written(meshio.Mesh(POINTS, blocks), "vtu")
    yield "curved", vtu(np.random.default_rng(0).normal(size=(10, 3)), np.arange(10)[None], [1], kind="tetra10")


def damaged(seed: int = 0) -> Iterator[tuple[str, str, bytes]]:
    """Files of several programs, cut off and with wrong bytes, lines and words."""
    random = np.random.default_rng((0, seed))
    mesh = TetMesh(POINTS, TETRAHEDRA, regions=LABELS, labels={1: "skin", 2: "bone"})
    plain = meshio.Mesh(POINTS, [("tetra", TETRAHEDRA)], cell_data={"medit:ref": [LABELS.astype(np.int32)]})
    tags = {"gmsh:physical": [LABELS.astype(np.int32)], "gmsh:geometrical": [LABELS.astype(np.int32)]}
    groups = meshio.Mesh(POINTS, [("tetra", TETRAHEDRA)], cell_data=tags)
    files = [
        ("msh", "gmsh 4.1", written(mesh, "msh")),
        ("msh", "gmsh 2.2", written(groups, "msh", file_format="gmsh22")),
        ("msh", "gmsh 2.2 text", _gmsh_text()),
        ("mesh", "medit", written(plain, "mesh")),
        ("vtk", "vtk", written(plain, "vtk")),
        ("mesh", "medit of second order", _medit_of_second_order()),
        ("su2", "su2", _su2(4)),
        ("su2", "su2 of second order", _su2(10)),
        ("inp", "abaqus", written(meshio.Mesh(POINTS, [("tetra", TETRAHEDRA)]), "inp")),
    ]
    for suffix, name, content in files:
        yield suffix, f"{name} whole", content
        for share in (0.0, 0.01, 0.1, 0.4, 0.7, 0.95):
            yield suffix, f"{name} cut at {share:.0%}", content[: int(share * len(content))]
        for number in range(DAMAGED):
            spoilt = bytearray(content)
            for at in random.integers(0, min(len(spoilt), 400) if number % 2 else len(spoilt), 1 + number % 4):
                spoilt[at] = random.integers(0, 256)
            yield suffix, f"{name} with wrong bytes {number}", bytes(spoilt)
        for number in range(DAMAGED):
            lines = content.split(b"\n")
            at = int(random.integers(0, len(lines)))
            words = [b"", b"-1", b"0", b"1e400", b"nan", b"99999999999999999999", b"$", b"x", b"3 1 4 100000000"]
            lines[at] = words[number % len(words)]
            yield suffix, f"{name} with a wrong line {number}", b"\n".join(lines)


def _gmsh_text() -> bytes:
    """Version 2.2 as text."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "1", '3 1 "skin"', "$EndPhysicalNames"]
    lines += ["$Nodes", str(len(POINTS)), *(f"{i} {x} {y} {z}" for i, (x, y, z) in enumerate(POINTS.tolist(), 1))]
    lines += ["$EndNodes", "$Elements", str(len(TETRAHEDRA))]
    rows = zip(LABELS.tolist(), (TETRAHEDRA + 1).tolist(), strict=True)
    lines += [f"{i} 4 2 {label} 1 {' '.join(map(str, row))}" for i, (label, row) in enumerate(rows, 1)]
    return "\n".join([*lines, "$EndElements", ""]).encode()


def _second_order() -> tuple[Any, Any]:
    """Points and (m, 10) corners and mid-edge nodes; each tetrahedron has mid-edge nodes of its own."""
    a, b = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]]).T
    middles = 0.5 * (POINTS[TETRAHEDRA[:, a]] + POINTS[TETRAHEDRA[:, b]])
    numbers = len(POINTS) + np.arange(middles.shape[0] * 6).reshape(-1, 6)
    return np.vstack([POINTS, middles.reshape(-1, 3)]), np.hstack([TETRAHEDRA, numbers])


def _rows(rows: Any) -> str:
    return "\n".join(" ".join(map(str, row)) for row in np.asarray(rows).tolist())


def _medit_of_second_order() -> bytes:
    points, cells = _second_order()
    text = f"MeshVersionFormatted 2\nDimension 3\nVertices\n{len(points)}\n"
    text += "".join(f"{x} {y} {z} 0\n" for x, y, z in points.tolist())
    text += f"TrianglesP2\n1\n1 2 3 {len(POINTS) + 1} {len(POINTS) + 2} {len(POINTS) + 3} 7\n"
    return f"{text}TetrahedraP2\n{len(cells)}\n{_rows(np.column_stack([cells + 1, LABELS]))}\nEnd\n".encode()


def _su2(nodes: int) -> bytes:
    points, cells = _second_order() if nodes == 10 else (POINTS, TETRAHEDRA)
    rows = np.column_stack([np.full(len(cells), {4: 10, 10: 24}[nodes]), cells, np.arange(len(cells))])
    text = f"NDIME= 3\nNELEM= {len(cells)}\n{_rows(rows)}\nNPOIN= {len(points)}\n{_rows(points)}\n"
    return f"{text}NMARK= 1\nMARKER_TAG= side\nMARKER_ELEMS= 1\n5 0 1 4\n".encode()


def tables() -> Iterator[tuple[str, dict[str, bytes]]]:
    """NIRFAST's files, by their suffixes."""

    def text(rows: Any) -> bytes:
        return "\n".join(" ".join(f"{value:g}" for value in np.atleast_1d(row)) for row in rows).encode()

    nodes, cells = text(np.column_stack([np.ones(len(POINTS)), POINTS])), text(TETRAHEDRA + 1)
    labels = text(LABELS)
    right = {"node": nodes, "elem": cells, "region": labels}
    yield "right", right
    yield "no regions", {"node": nodes, "elem": cells}
    yield "regions of nodes", {**right, "region": text(np.where(POINTS[:, 2] < 3, 1, 2))}
    yield "nodes only", {"node": nodes}
    for suffix, whole in right.items():
        for name, content in (
            ("empty", b""),
            ("words", b"a b c\n"),
            ("noise", bytes(range(256))),
            ("one row", b"1 2 3 4"),
        ):
            yield f"{suffix} {name}", {**right, suffix: content}
        yield f"{suffix} cut", {**right, suffix: whole[: len(whole) // 2]}
        yield f"{suffix} of nan", {**right, suffix: whole.replace(b"1", b"nan")}
        yield f"{suffix} with commas", {**right, suffix: whole.replace(b" ", b", ")}
    yield "plane", {"node": text(np.ones((9, 3))), "elem": text(np.ones((9, 3)))}
    yield "numbered from 0", {**right, "elem": text(TETRAHEDRA)}
    yield "numbers too large", {**right, "elem": text(TETRAHEDRA + 7)}
