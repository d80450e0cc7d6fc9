"""Surface files, held against their bodies' volumes and against a second reader."""

import json
import logging
import struct
import warnings
import zipfile
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh

from tetlux.meshing import InputError, box, read_surface, sphere
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.files.formats.obj import read_obj
from tetlux.meshing.files.formats.off import read_off
from tetlux.meshing.files.formats.ply import read_ply
from tetlux.meshing.files.formats.scene import check_gltf
from tetlux.meshing.files.formats.stl import read_stl
from tetlux.meshing.host.quiet import quiet
from tetlux.meshing.surface.triangles import signed_volume

BALL = sphere(10.0, subdivisions=2)
CUBE = b"v 0 0 0\nv 0 0 2\nv 0 2 0\nv 0 2 2\nv 2 0 0\nv 2 0 2\nv 2 2 0\nv 2 2 2\n"
QUADS = b"f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"


def volume(read: tuple[FloatArray, IntArray]) -> float:
    return signed_volume(*read)


def exported(kind: str) -> bytes:
    data = trimesh.Trimesh(BALL.points, BALL.faces, process=False).export(file_type=kind)
    assert isinstance(data, str | bytes)
    return data.encode() if isinstance(data, str) else data


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "off"])
def test_readers_agree_with_a_second_one(suffix: str, tmp_path: Path) -> None:
    """meshio's files, read by ours and by trimesh: the same corners of the same triangles."""
    path = tmp_path / f"ball.{suffix}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        meshio.Mesh(BALL.points, [("triangle", BALL.faces)]).write(path)
    reader = {"obj": read_obj, "stl": read_stl, "ply": read_ply, "off": read_off}[suffix]
    points, faces = reader(path.read_bytes())
    other = trimesh.load_mesh(path, process=False)
    assert points[faces] == pytest.approx(np.asarray(other.vertices)[np.asarray(other.faces)], rel=1e-6)


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(CUBE + QUADS, id="quads"),
        pytest.param((CUBE + QUADS).replace(b"\n", b"\r\n"), id="CRLF"),
        pytest.param((CUBE + QUADS).replace(b"\n", b"\r"), id="CR"),
        pytest.param((CUBE + QUADS).replace(b" ", b"\t"), id="tabs"),
        pytest.param(b"\xef\xbb\xbf" + CUBE + QUADS, id="byte order mark"),
        pytest.param(b"  " + (CUBE + QUADS).replace(b"\n", b" # f 1 2 3\n  "), id="comments and blanks before"),
        pytest.param(CUBE.replace(b"\n", b" 0.5 0.5 0.5\n") + QUADS, id="colours"),
        pytest.param(CUBE.replace(b"2\n", b"2 1.0\n") + QUADS, id="weights of some"),
        pytest.param(CUBE + QUADS.replace(b"4 ", b"\\\n4 "), id="continued lines"),
        pytest.param(CUBE + QUADS.replace(b"8", b"8/3/2").replace(b"7", b"7//1").replace(b"6", b"6/9"), id="slashes"),
        pytest.param(QUADS + CUBE, id="faces first"),
        pytest.param(
            b"mtllib x.mtl\no f\ng v\n" + CUBE + b"usemtl v 1 2 3\ns 1\n" + QUADS + b"l 1 2\np 3\n", id="words"
        ),
        pytest.param(CUBE + b"vt 0 0\nvn 0 0 1\nvp 1\n" + QUADS, id="other vertices"),
        pytest.param(CUBE + QUADS.replace(b"f 1 2 4 3\n", b"f 1 2 4\nf 1 4 3\n"), id="triangles and quads"),
        pytest.param(CUBE + QUADS + b"f 1 2\nf 3\n", id="edges"),
        pytest.param(CUBE.replace(b"2", b"2.0e0") + QUADS, id="exponents"),
        pytest.param((CUBE + QUADS).upper() + b"VT 0 0\nVN 0 0 1\n", id="capitals"),
    ],
)
def test_obj_in_every_spelling(data: bytes) -> None:
    assert volume(read_obj(data)) == pytest.approx(8.0)


def test_obj_counts_back_from_the_line_that_says_so(tmp_path: Path) -> None:
    """Three boxes, each with its vertices before its faces: trimesh makes one of them."""
    parts = []
    for i in range(3):
        corners = box((20.0, 20.0, 20.0), center=(30.0 * i, 0.0, 0.0))
        parts += ["v " + " ".join(map(str, point)) for point in corners.points.tolist()]
        parts += ["f " + " ".join(str(k - 8) for k in face) for face in corners.faces.tolist()]
    path = tmp_path / "boxes.obj"
    path.write_text("\n".join(parts))
    surface = read_surface(path)
    assert surface.volume == pytest.approx(24_000)
    assert np.ptp(surface.points[:, 0]) == pytest.approx(80.0)
    assert surface.repairs == ()


def test_a_hollow_polygon_covers_itself_only() -> None:
    """A prism over an L, each end one polygon that no fan covers from its first corner."""
    ring = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]])
    # The fan from corner 1 would leave the L.
    ring = np.roll(ring, -1, axis=0)
    lines = [f"v {x} {y} {z}" for z in (0, 2) for x, y in ring.tolist()]
    lines += ["f 6 5 4 3 2 1", "f 7 8 9 10 11 12"]
    lines += [f"f {i + 1} {(i + 1) % 6 + 1} {(i + 1) % 6 + 7} {i + 7}" for i in range(6)]
    points, faces = read_obj("\n".join(lines).encode())
    corners = points[faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert volume((points, faces)) == pytest.approx(10.0)
    assert area == pytest.approx(2 * 5 + 2 * 12)


@pytest.mark.parametrize("face", [b"f 0 1 2\n", b"f 1 2 99\n", b"f -99 1 2\n"])
def test_obj_that_names_a_vertex_that_is_not_there(face: bytes, tmp_path: Path) -> None:
    path = tmp_path / "far.obj"
    path.write_bytes(CUBE + QUADS.replace(b"f 1 2 4 3\n", b"f 1 2 4\n") + face)
    with pytest.raises(InputError):
        read_surface(path)


def binary_stl(extra: bytes = b"", head: bytes = b"", claimed: int | None = None) -> bytes:
    rows = np.zeros(len(BALL.faces), dtype=[("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")])
    rows["c"] = BALL.points[BALL.faces]
    count = len(rows) if claimed is None else claimed
    return head.ljust(80, b"\0") + struct.pack("<I", count) + rows.tobytes() + extra


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(binary_stl(), id="binary"),
        pytest.param(binary_stl(b"x" * 37), id="trailing bytes"),
        pytest.param(binary_stl(b"\0" * 50), id="a trailing record"),
        pytest.param(binary_stl(head=b"solid ball"), id="solid"),
        pytest.param(binary_stl(b"x" * 37, head=b"solid facet of a ball"), id="solid with trailing bytes"),
        pytest.param(exported("stl_ascii"), id="text"),
        pytest.param(exported("stl_ascii").replace(b"\n", b"\r\n"), id="text with CRLF"),
        pytest.param(b"\n " + exported("stl_ascii").upper(), id="capitals"),
        pytest.param(b" ".join(exported("stl_ascii").split()), id="one line"),
        pytest.param(b"solid a vertex of a facet\nendsolid\n" + exported("stl_ascii"), id="several solids, named"),
    ],
)
def test_stl_in_every_spelling(data: bytes) -> None:
    assert volume(read_stl(data)) == pytest.approx(BALL.volume, rel=1e-6)


@pytest.mark.parametrize("claimed", [0, 1, 100, 319])
def test_stl_that_claims_too_few_triangles_is_read_whole(claimed: int) -> None:
    assert volume(read_stl(binary_stl(claimed=claimed))) == pytest.approx(BALL.volume, rel=1e-6)


@pytest.mark.parametrize("extra", [b"x" * 50, b"\0" * 100, b"\0\0\x80\x3f" * 25, np.full(25, np.nan, "<f4").tobytes()])
def test_stl_records_that_are_no_triangles_are_ignored(extra: bytes) -> None:
    assert len(read_stl(binary_stl(extra))[1]) == len(BALL.faces)
    with pytest.raises(InputError, match="claims no triangles and holds 100 bytes of something else"):
        read_stl(b"\0" * 84 + b"x" * 100)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "off"])
def test_text_in_utf_16_is_read(suffix: str, encoding: str, tmp_path: Path) -> None:
    kind, options = ("stl_ascii", {}) if suffix == "stl" else (suffix, {"encoding": "ascii"} if suffix == "ply" else {})
    data = trimesh.Trimesh(BALL.points, BALL.faces, process=False).export(file_type=kind, **options)
    assert isinstance(data, str | bytes)
    text = data.decode() if isinstance(data, bytes) else data
    path = tmp_path / f"ball.{suffix}"
    path.write_bytes(text.encode(encoding))
    assert read_surface(path).volume == pytest.approx(BALL.volume, rel=1e-4)


def test_3mf_in_another_unit_says_so(tmp_path: Path) -> None:
    path = tmp_path / "ball.3mf"
    path.write_bytes(exported("3mf"))
    assert read_surface(path).warnings == ()
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, content.replace(b'unit="millimeter"', b'unit="inch"'))
    assert read_surface(path).warnings == (
        "the file says that its unit is the inch, and its numbers are taken as mm; give scale: 25.4 for its true size.",
    )
    assert read_surface(path, unit="in").warnings == read_surface(path, scale=25.4).warnings == ()


def test_stl_that_was_cut_says_how_much_is_there(tmp_path: Path) -> None:
    path = tmp_path / "cut.stl"
    path.write_bytes(binary_stl()[:-60])
    with pytest.raises(InputError, match="claims 320 triangles and holds 318"):
        read_surface(path)
    path.write_bytes(exported("stl_ascii")[:-150])
    with pytest.raises(InputError, match="was cut short"):
        read_surface(path)


def ply_head(form: str, lines: str) -> bytes:
    return f"ply\nformat {form} 1.0\ncomment TextureFile skin.png\n{lines}end_header\n".encode()


PLACES = "element vertex 8\nproperty double x\nproperty double y\nproperty double z\n"
CORNERS = np.array([line.split()[1:] for line in CUBE.decode().splitlines()], dtype=np.float64)
# Two quads, the rest triangles.
MIXED = [[0, 1, 3, 2], [4, 6, 7, 5], *([a, b, c] for a, b, c in ((0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6)))]
MIXED += [[0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("texture", [False, True])
def test_binary_ply_of_polygons(order: str, texture: bool) -> None:
    """Triangles and quads in one file, with what photogrammetry writes beside them."""
    form = "binary_little_endian" if order == "<" else "binary_big_endian"
    lines = PLACES.replace("z\n", "z\nproperty uchar red\n") + f"element face {len(MIXED)}\n"
    lines += "property uchar flags\nproperty list uchar int vertex_indices\n"
    lines += "property list uchar float texcoord\n" if texture else ""
    data = ply_head(form, lines + "element camera 1\nproperty float f\n")
    data += b"".join(struct.pack(order + "dddB", *place, 200) for place in CORNERS.tolist())
    for face in MIXED:
        data += struct.pack(f"{order}BB{len(face)}i", 0, len(face), *face)
        data += struct.pack(f"{order}B{2 * len(face)}f", 2 * len(face), *([0.5] * 2 * len(face))) if texture else b""
    assert volume(read_ply(data + struct.pack(order + "f", 1.0))) == pytest.approx(8.0)


def test_text_ply_of_polygons() -> None:
    lines = PLACES + f"element face {len(MIXED)}\nproperty list uchar int vertex_index\nproperty uchar red\n"
    rows = [" ".join(map(str, place)) for place in CORNERS.tolist()]
    rows += [" ".join(map(str, [len(face), *face, 255])) for face in MIXED]
    assert volume(read_ply(ply_head("ascii", lines) + "\n".join(rows).encode())) == pytest.approx(8.0)
    with pytest.raises(InputError, match="was cut short"):
        read_ply(ply_head("ascii", lines) + "\n".join(rows[:-1]).encode())


def test_ply_whose_comment_names_the_last_line_of_the_head() -> None:
    data = ply_head("binary_little_endian", PLACES + "element tristrips 1\nproperty list int int vertex_indices\n")
    data += CORNERS.astype("<f8").tobytes() + struct.pack("<5i", 4, 0, 1, 2, 3)
    for head in (b"ply\ncomment no end_header yet\n", b"ply\nobj_info\nend_header_of mine\n"):
        assert len(read_ply(data.replace(b"ply\n", head, 1).replace(b"end_header\n\0", b"end_header \n\0", 1))[1]) == 2


@pytest.mark.parametrize("lists", [1, 3])
def test_ply_of_triangle_strips(lists: int) -> None:
    """A cube: a strip ends by -1 or with its list; corners named twice make no triangle."""
    strips = [[0, 1, 2, 3, 6, 7, 4, 5, 0, 1], [0, 2, 4, 6], [1, 1, 1, 5, 3, 7]]
    if lists == 1:
        strips = [[*strips[0], -1, *strips[1], -1, *strips[2], -1]]
    data = ply_head("binary_big_endian", PLACES + f"element tristrips {lists}\nproperty list int int vertex_indices\n")
    data += CORNERS.astype(">f8").tobytes()
    data += b"".join(struct.pack(f">i{len(strip)}i", len(strip), *strip) for strip in strips)
    points, faces = read_ply(data)
    assert len(faces) == 12
    assert volume((points, faces)) == pytest.approx(8.0)


@pytest.mark.parametrize(
    "head",
    [
        b"OFF\n8 6 12\n",
        b"OFF 8 6 0\n",
        b"OFF\n8 6\n",
        b"8 6 0\n",
        b"# made by hand\nOFF # a cube\n\n# counts\n8 6 0\n",
        b"COFF\n8 6 0\n",
        b"NOFF\n8 6 0\n",
        b"STCNOFF\n8 6 0\n",
        b"off\n8 6 0\n",
        b"OFF8 6 0\n",
    ],
)
def test_off_in_every_spelling(head: bytes) -> None:
    beside = b" 0.1 0.2 0.3 1" if b"OFF" in head and head[:1] in b"CNS" else b""
    body = CUBE.replace(b"v ", b"").replace(b"\n", beside + b"\n")
    faces = b"".join(
        b"4 " + b" ".join(b"%d" % (int(k) - 1) for k in line.split()[1:]) + b" 255 0 0\n" for line in QUADS.splitlines()
    )
    assert volume(read_off(head + body + b"\n" + faces)) == pytest.approx(8.0)


@pytest.mark.parametrize(("head", "message"), [(b"4OFF\n1 1 0\n", "dimensions"), (b"OFF BINARY\n", "binary")])
def test_off_that_is_not_read(head: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_off(head)


def gltf(**change: object) -> dict[str, object]:
    head: dict[str, object] = {
        "accessors": [{"componentType": 5126}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    }
    return head | change


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (gltf(extensionsRequired=["KHR_draco_mesh_compression"]), "is Draco-compressed; export it without compression"),
        (gltf(extensionsRequired=["EXT_meshopt_compression"]), "compressed by meshopt"),
        (gltf(extensionsRequired=["EXT_mesh_gpu_instancing"]), "requires the glTF extension EXT_mesh_gpu_instancing"),
        (gltf(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}]), "triangle fans"),
        (gltf(accessors=[{"sparse": {}}]), "sparse or normalized"),
        (gltf(accessors=[{"normalized": True}]), "sparse or normalized"),
    ],
)
def test_gltf_that_would_be_another_shape(head: dict[str, object], message: str, tmp_path: Path) -> None:
    path = tmp_path / "scan.gltf"
    path.write_text(json.dumps(head))
    with pytest.raises(InputError, match=message):
        read_surface(path)


def test_gltf_that_only_looks_special_is_read() -> None:
    check_gltf(gltf(extensionsRequired=["KHR_materials_unlit", "KHR_mesh_quantization"]))


def test_nothing_of_another_library_reaches_the_terminal(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    logging.getLogger("trimesh").addHandler(logging.StreamHandler())
    data = exported("ply").replace(b"element vertex", b"comment TextureFile skin.png\nelement vertex", 1)
    for name, content in (("skin.ply", data), ("cut.glb", exported("glb")[:-200]), ("names.3mf", b"PK\x03\x04")):
        path = tmp_path / name
        path.write_bytes(content)
        try:
            read_surface(path)
        except InputError:
            assert name != "skin.ply"
    with quiet():
        logging.getLogger("trimesh.child").error("not this")
        print("nor this")
        warnings.warn("nor that", stacklevel=1)
    logging.getLogger("trimesh").handlers.clear()
    assert capfd.readouterr() == ("", "")
    assert caplog.records == []
    logging.getLogger("tetlux.test").warning("heard again")
    assert caplog.messages == ["heard again"]
