"""Volume meshes of other programs: what they hold is read, and what cannot be used is said."""

import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import meshio
import numpy as np
import numpy.typing as npt
import pytest

from tests.meshes_made import cube_of_cubes
from tetlux.meshing import InputError, TetMesh, read_mesh
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.files.meshes import write_mesh

POINTS, TETRAHEDRA, PLACES = cube_of_cubes(2, 1.0)
# The lower half is bone, the upper one muscle.
LABELS = np.where(PLACES[:, 2] == 0, 7, 3)
NAMES = {7: "bone", 3: "soft tissue"}
# One triangle below, in a surface without a physical group.
TRIANGLE = [1, 2, 4]


def halves(mesh: TetMesh) -> bool:
    """Whether it is the cube, with its labels where they belong."""
    middles = mesh.points[mesh.tetrahedra].mean(axis=1)
    return mesh.volume == pytest.approx(8.0) and bool((mesh.regions == np.where(middles[:, 2] < 1.0, 7, 3)).all())


def gmsh_41(path: Path, *, physical: dict[int, Sequence[int]], version: str = "4.1", kind: int = 4) -> None:
    """Write text in which entities 1 and 2 are the halves."""
    lines = ["$MeshFormat", f"{version} 0 8", "$EndMeshFormat", "$PhysicalNames", "3"]
    lines += ['2 7 "a surface of that number"', *(f'3 {n} "{name}"' for n, name in NAMES.items()), "$EndPhysicalNames"]
    lines += ["$Entities", "1 0 1 2", "1 0 0 0 0", "1 0 0 0 2 2 0 0 0"]
    for entity in (1, 2):
        groups = " ".join(map(str, physical[entity]))
        lines.append(f"{entity} 0 0 0 2 2 2 {len(physical[entity])} {groups} 1 1")
    lines += ["$EndEntities", "$Nodes", f"1 {len(POINTS)} 1 {len(POINTS)}", f"3 1 0 {len(POINTS)}"]
    lines += [str(i + 1) for i in range(len(POINTS))] + [" ".join(map(str, row)) for row in POINTS.tolist()]
    lines += ["$EndNodes", "$Elements", f"3 {len(TETRAHEDRA) + 1} 1 {len(TETRAHEDRA) + 1}", "2 1 2 1", "1 1 2 4"]
    for entity, label in ((1, 7), (2, 3)):
        inside = np.flatnonzero(np.equal(LABELS, label))
        lines.append(f"3 {entity} {kind} {len(inside)}")
        lines += [f"{i + 2} {' '.join(map(str, TETRAHEDRA[i] + 1))}" for i in inside]
    path.write_text("\n".join([*lines, "$EndElements", ""]))


def gmsh_22(path: Path, *, binary: bool, order: str = "<", labels: IntArray = LABELS) -> None:
    rows = [(2, [0, 1], TRIANGLE), *((4, [n, 9], c + 1) for n, c in zip(labels, TETRAHEDRA, strict=True))]
    names = "".join(f'3 {n} "{name}"\n' for n, name in NAMES.items())
    head = f"$PhysicalNames\n{len(NAMES)}\n{names}$EndPhysicalNames\n$Nodes\n{len(POINTS)}\n".encode()
    if binary:
        content = b"$MeshFormat\n2.2 1 8\n" + struct.pack(order + "i", 1) + b"\n$EndMeshFormat\n" + head
        content += b"".join(struct.pack(order + "i3d", i, *point) for i, point in enumerate(POINTS.tolist(), 1))
        content += f"\n$EndNodes\n$Elements\n{len(rows)}\n".encode()
        for i, (kind, tags, nodes) in enumerate(rows, 1):
            numbers = [kind, 1, len(tags), i, *tags, *nodes]
            content += struct.pack(f"{order}{len(numbers)}i", *numbers)
        content += b"\n$EndElements\n"
    else:
        content = b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n" + head
        content += "".join(f"{i} {x} {y} {z}\n" for i, (x, y, z) in enumerate(POINTS.tolist(), 1)).encode()
        content += f"$EndNodes\n$Elements\n{len(rows)}\n".encode()
        for i, (kind, tags, nodes) in enumerate(rows, 1):
            content += (" ".join(map(str, [i, kind, len(tags), *tags, *nodes])) + "\n").encode()
        content += b"$EndElements\n"
    path.write_bytes(content)


def with_values(path: Path, **arrays: object) -> None:
    data = {name: [np.asarray(values)] for name, values in arrays.items()}
    meshio.Mesh(POINTS, [("tetra", TETRAHEDRA)], cell_data=data).write(path)


WRITERS: dict[str, Callable[[Path], None]] = {
    "new.msh": lambda path: gmsh_41(path, physical={1: [7], 2: [-3, 7]}),
    "old.msh": lambda path: gmsh_22(path, binary=False),
    "old_binary.MSH": lambda path: gmsh_22(path, binary=True),
    "old_big.msh": lambda path: gmsh_22(path, binary=True, order=">"),
    "ours.msh": lambda path: write_mesh(TetMesh(POINTS, TETRAHEDRA, regions=LABELS, labels=NAMES), path),
}


@pytest.mark.parametrize("name", WRITERS)
def test_gmsh_files_bring_their_groups_and_names(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    WRITERS[name](path)
    mesh = read_mesh(path, unit="cm", scale=1.0)
    assert halves(mesh)
    assert mesh.labels == NAMES
    assert mesh.unit == "cm"
    several = ("a volume is in several physical groups; the smallest group is the label.",)
    assert mesh.warnings == (several if name == "new.msh" else ())
    assert read_mesh(path, scale=2.0).volume == pytest.approx(64.0)


def test_gmsh_files_without_groups(tmp_path: Path) -> None:
    path = tmp_path / "a.msh"
    gmsh_41(path, physical={1: [], 2: []})
    mesh = read_mesh(path)
    assert (mesh.regions == np.where(LABELS == 7, 1, 2)).all()
    assert mesh.warnings == ("it has no physical groups of volumes; labels are the numbers of its volumes.",)
    gmsh_41(path, physical={1: [7], 2: []})
    mesh = read_mesh(path)
    assert (mesh.regions == np.where(LABELS == 7, 7, 0)).all()
    assert mesh.warnings == ("24 tetrahedra are in no physical group; their label is 0.",)
    gmsh_22(path, binary=False, labels=0 * LABELS)
    assert read_mesh(path).warnings == ("it has no physical groups of volumes; all tetrahedra are of label 0.",)


def test_gmsh_groups_that_overlap(tmp_path: Path) -> None:
    """A group of all and one of a part of it: the part is not lost."""
    path = tmp_path / "a.msh"
    gmsh_41(path, physical={1: [3, 7], 2: [3]})
    assert halves(read_mesh(path))


def test_gmsh_files_that_cannot_be_read(tmp_path: Path) -> None:
    path = tmp_path / "a.msh"
    gmsh_41(path, physical={1: [7], 2: [3]}, version="4.0")
    with pytest.raises(InputError, match=r"a\.msh: it is of gmsh's version 4\.0; save it as version 4\.1 or 2\.2"):
        read_mesh(path)
    gmsh_41(path, physical={1: [7], 2: [3]}, kind=77)
    with pytest.raises(InputError, match=r"elements of gmsh's type 77, which is not read"):
        read_mesh(path)
    for name, writer in WRITERS.items():
        writer(tmp_path / name)
        content = (tmp_path / name).read_bytes()
        for share in (0.02, 0.3, 0.5, 0.8, 0.97):
            path.write_bytes(content[: int(share * len(content))])
            with pytest.raises(InputError, match=r"a\.msh"):
                read_mesh(path)


@pytest.mark.parametrize("name", ["a.vtu", "a.VTU", "a.vtk"])
def test_arrays_of_cells_are_labels(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    with_values(path.with_suffix(path.suffix.lower()), material=LABELS.astype(np.float64), area=LABELS + 0.5)
    path.with_suffix(path.suffix.lower()).rename(path)
    mesh = read_mesh(path)
    assert halves(mesh)
    assert mesh.warnings == ()


def test_which_array_is_the_labels(tmp_path: Path) -> None:
    path = tmp_path / "a.vtu"
    numbers = np.arange(len(LABELS))
    with_values(path, numbers=numbers % 5, label=LABELS)
    mesh = read_mesh(path)
    assert halves(mesh)
    assert mesh.warnings == ('labels are the array "label"; "numbers" may be labels too.',)
    assert (read_mesh(path, labels="numbers").regions == numbers % 5).all()
    with pytest.raises(
        InputError, match='it holds no array "tissue" of cell values; the arrays there are: numbers, la'
    ):
        read_mesh(path, labels="tissue")
    with_values(path, region=LABELS + 0.5)
    assert read_mesh(path).warnings == (
        'its array "region" holds no whole numbers, one for each tetrahedron, and is not taken for labels.',
    )
    with_values(path, odd=LABELS)
    assert read_mesh(path).warnings == ('labels are the array "odd".',)
    with_values(path, odd=LABELS, even=LABELS)
    mesh = read_mesh(path)
    assert not mesh.regions.any()
    assert "may be labels; choose one of them" in mesh.warnings[0]
    with_values(path, half=LABELS + 0.5)
    with pytest.raises(InputError, match='the values of "half" are no whole numbers'):
        read_mesh(path, labels="half")


def test_medit_and_abaqus(tmp_path: Path) -> None:
    data = {"medit:ref": [LABELS.astype(np.int32)]}
    for suffix in (".mesh", ".meshb"):
        meshio.Mesh(POINTS, [("tetra", TETRAHEDRA)], cell_data=data).write(tmp_path / f"a{suffix}")
        assert halves(read_mesh(tmp_path / f"a{suffix}")), suffix
    lines = ["*NODE", *(f"{i}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(POINTS.tolist(), 1))]
    for name, label in (("Bone", 7), ("Muscle", 3)):
        lines.append(f"*ELEMENT, TYPE=C3D4, ELSET={name}")
        lines += [f"{i + 1}, {', '.join(map(str, TETRAHEDRA[i] + 1))}" for i in np.flatnonzero(np.equal(LABELS, label))]
    (tmp_path / "a.inp").write_text("\n".join([*lines, "*END STEP", ""]))
    mesh = read_mesh(tmp_path / "a.inp")
    assert mesh.labels == {1: "Bone", 2: "Muscle"}
    assert mesh.region_volumes == pytest.approx({1: 4.0, 2: 4.0})
    # Gmsh writes each physical group beside the volume that it is of.
    volumes = "\n".join(lines).replace("Bone", "Volume1").replace("Muscle", "Volume2")
    numbers = ", ".join(str(i + 1) for i in np.flatnonzero(np.equal(LABELS, 7)))
    (tmp_path / "a.inp").write_text(f"{volumes}\n*ELSET, ELSET=Bone\n{numbers}\n*END STEP\n")
    mesh = read_mesh(tmp_path / "a.inp")
    assert mesh.labels == {1: "Bone", 2: "Volume2"}
    assert mesh.warnings == ()


def nirfast(folder: Path, regions: Sequence[float] | None, first: int = 1, stem: str = "head.v2") -> Path:
    flipped = np.where(np.arange(len(TETRAHEDRA))[:, None] % 2, TETRAHEDRA[:, [1, 0, 2, 3]], TETRAHEDRA)
    np.savetxt(folder / f"{stem}.node", np.column_stack([np.ones(len(POINTS)), POINTS]))
    np.savetxt(folder / f"{stem}.elem", flipped + first, fmt="%d")
    if regions is not None:
        np.savetxt(folder / f"{stem}.region", regions)
    return folder / stem


def test_nirfast_files_by_any_of_their_names(tmp_path: Path) -> None:
    stem = nirfast(tmp_path, LABELS.tolist())
    for suffix in (".node", ".elem", ".region", ""):
        mesh = read_mesh(Path(f"{stem}{suffix}"))
        assert halves(mesh), suffix
        assert mesh.repairs == ("24 of 48 tetrahedra were inverted and have been turned.",)
    Path(f"{stem}.elem").rename(f"{stem}.ELEM")
    assert halves(read_mesh(Path(f"{stem}.node")))
    assert halves(read_mesh(nirfast(tmp_path, LABELS.tolist(), first=0, stem="from_zero")))


def test_nirfast_regions_of_nodes(tmp_path: Path) -> None:
    mesh = read_mesh(nirfast(tmp_path, np.where(POINTS[:, 2] == 0, 7, 3).tolist()))
    # Of a tetrahedron of the lower half one, two or three corners are below; of two and two the lower number counts.
    below = (POINTS[TETRAHEDRA][:, :, 2] == 0).sum(axis=1)
    assert (mesh.regions == np.where(below >= 3, 7, 3)).all()
    assert mesh.warnings == ("24 tetrahedra have nodes of several regions; each is in that of most of its corners.",)


def test_nirfast_files_that_are_wrong(tmp_path: Path) -> None:
    stem = nirfast(tmp_path, [1.0, 2.0])
    with pytest.raises(InputError, match="there are 2 regions for 27 nodes and 48 tetrahedra"):
        read_mesh(stem)
    Path(f"{stem}.elem").write_text("1 2 3 4\n1 2 x 5\n")
    with pytest.raises(InputError, match=r"head\.v2\.elem is no table of numbers"):
        read_mesh(stem)
    Path(f"{stem}.elem").write_text("1 2 3\n")
    with pytest.raises(InputError, match=r"4 columns and head\.v2\.elem 3; give a mark and three coordinates"):
        read_mesh(stem)
    Path(f"{stem}.elem").unlink()
    for suffix in (".region", ".node"):
        with pytest.raises(InputError, match=r"needs the \.elem file of the same name beside it"):
            read_mesh(Path(f"{stem}{suffix}"))
    with pytest.raises(InputError, match=r"needs the \.elem file of the same name beside it"):
        read_mesh(Path(f"{stem}.region"))


def test_numbers_from_one_are_recognised(tmp_path: Path) -> None:
    meshio.Mesh(POINTS, [("tetra", TETRAHEDRA + 1)], cell_data={"region": [LABELS]}).write(tmp_path / "a.vtu")
    mesh = read_mesh(tmp_path / "a.vtu")
    assert halves(mesh)
    assert mesh.repairs == ("nodes are numbered from 1.",)


def test_other_cells(tmp_path: Path) -> None:
    path = tmp_path / "a.vtu"
    cube = np.array([[0, 1, 4, 3, 9, 10, 13, 12]])
    blocks = [("tetra", TETRAHEDRA), ("hexahedron", np.vstack([cube, cube])), ("pyramid", cube[:, :5])]
    meshio.Mesh(POINTS, blocks).write(path)
    with pytest.raises(InputError, match="it holds 2 hexahedra and 1 pyramids, and only tetrahedra are solved on"):
        read_mesh(path)
    beside = [("triangle", cube[:, :3]), ("tetra", TETRAHEDRA), ("line", cube[:, :2]), ("vertex", cube[:, :1])]
    values = {"region": [np.full(1, 99), LABELS, np.full(1, 98), np.full(1, 97)]}
    meshio.Mesh(POINTS, beside, cell_data=values).write(path)
    assert halves(read_mesh(path))
    meshio.Mesh(POINTS, beside[:1]).write(path)
    with pytest.raises(InputError, match="it holds no tetrahedra"):
        read_mesh(path)


def second_order() -> tuple[FloatArray, IntArray]:
    """The cube's nodes with the midpoints of edges, and its tetrahedra of ten nodes."""
    middles = [POINTS[TETRAHEDRA[:, [i, j]]].mean(axis=1) for i, j in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))]
    new = len(POINTS) + np.arange(6 * len(TETRAHEDRA)).reshape(6, -1).T
    return np.vstack([POINTS, *middles]), np.hstack([TETRAHEDRA, new])


def rows(values: npt.NDArray[np.generic]) -> str:
    return "".join(" ".join(map(str, row)) + "\n" for row in values.tolist())


def test_curved_tetrahedra_are_taken_by_their_corners(tmp_path: Path) -> None:
    points, cells = second_order()
    meshio.Mesh(points, [("tetra10", cells)], cell_data={"region": [LABELS]}).write(tmp_path / "a.vtu")
    mesh = read_mesh(tmp_path / "a.vtu")
    assert halves(mesh)
    assert len(mesh.points) == len(POINTS)
    assert mesh.repairs == ("48 tetrahedra of higher order were taken by their corners, with straight edges.",)


def test_second_order_tetrahedra_of_medit_and_su2(tmp_path: Path) -> None:
    points, cells = second_order()
    labels, beside = LABELS[:, None], np.zeros((len(points), 1), dtype=int)
    medit = f"MeshVersionFormatted 2\nDimension 3\nVertices\n{len(points)}\n" + rows(np.hstack([points, beside]))
    medit += f"TrianglesP2\n1\n1 2 4 5 6 7 1\nTetrahedraP2\n{len(cells)}\n" + rows(np.hstack([cells + 1, labels]))
    path = tmp_path / "a.mesh"
    path.write_text(medit + "End\n")
    mesh = read_mesh(path)
    assert halves(mesh)
    assert mesh.warnings == ("48 tetrahedra of higher order were taken by their corners, with straight edges.",)
    path.write_text(medit[:-60])
    with pytest.raises(InputError, match=r"a\.mesh is not a readable MESH mesh"):
        read_mesh(path)
    numbers = np.arange(len(cells))[:, None]
    su2 = f"NDIME= 3\nNELEM= {len(cells)}\n" + rows(np.hstack([np.full_like(numbers, 24), cells, numbers]))
    su2 += f"NPOIN= {len(points)}\n" + rows(points) + "NMARK= 1\nMARKER_TAG= side\nMARKER_ELEMS= 1\n22 0 1 3 4 5 6\n"
    (tmp_path / "a.su2").write_text(su2)
    mesh = read_mesh(tmp_path / "a.su2")
    assert mesh.volume == pytest.approx(8.0)
    assert (len(mesh.tetrahedra), len(mesh.warnings)) == (48, 1)


def test_paths_that_are_no_mesh(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.docx").write_text("")
    for name, words in (
        ("none.msh", "does not exist"),
        ("none", "does not exist"),
        ("a.docx", "is no volume mesh format here"),
        (".", "is a folder"),
    ):
        with pytest.raises(InputError, match=words):
            read_mesh(tmp_path / name)
    for suffix in ("vtu", "vtk", "msh", "mesh", "meshb", "inp", "med", "node", "elem"):
        (tmp_path / f"broken.{suffix}").write_bytes(b"\x00broken")
        with pytest.raises(InputError, match="broken"):
            read_mesh(tmp_path / f"broken.{suffix}")
        (tmp_path / f"broken.{suffix}").unlink()
    with pytest.raises(InputError, match="scale is 0"):
        read_mesh(tmp_path / "a.vtu", scale=0.0)
    # Nothing of another library reaches the terminal.
    assert capfd.readouterr() == ("", "")
