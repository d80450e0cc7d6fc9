"""Malformed files of coefficients, of light and of bodies: arrays, images and volume meshes."""

import base64
import io
import pickle
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from PIL import Image

from tests.fuzz.meshes import broken, damaged, tables

# A file holds one of these, and a case names it there.
ARRAY, VOLUME, IMAGES, SPOT, SKY, MESH = "array", "volume", "images", "spot", "environment", "mesh"


@dataclass(frozen=True)
class MalformedVolume:
    """A file by its name and what it is of, with what it holds; and files beside it, by their suffixes."""

    name: str
    kind: str
    suffix: str
    content: bytes
    beside: Mapping[str, bytes] = field(default_factory=dict)


def case_of(kind: str, file: str) -> dict[str, Any]:
    """A case that is right, but for the file."""
    medium: dict[str, Any] = {"sigma_a": 0.01, "sigma_s_prime": 1.0, "eta": 1.4}
    light: dict[str, Any] = {"diffuse": {"irradiance": 1.0}}
    if kind == MESH:
        labels = {1: medium, 2: {**medium, "sigma_a": 0.1}}
        light = {"point": {"position": [5.1, 5.2, 5.3]}}
        return {"mesh": {"file": file, "labels": labels}, "lights": [light], "tolerance": 0.9, "outputs": ["volume"]}
    if kind == ARRAY:
        medium["sigma_a"] = {"array": {"file": file, "origin": [-6, -6, -6], "spacing": 4}}
    elif kind == VOLUME:
        medium["sigma_a"] = {"volume": {"file": file, "name": "coefficient"}}
    elif kind == IMAGES:
        placed = {"origin": [-6, -6, 0], "spacing": [1, 1, 20], "values": [0.01, 0.1]}
        medium["sigma_a"] = {"images": {"files": file, **placed}}
    elif kind == SPOT:
        image = {"file": file, "center": [0, 0, 9], "width": 5}
        light = {"collimated": {"direction": [0, 0, -1], "irradiance": 1, "spot": {"image": image}}}
    else:
        light = {"environment": {"file": file, "brightest": 1.0}}
    return {"surface": {"box": {"size": [10, 10, 10]}}, "medium": medium, "lights": [light]}


def _npy(array: Any, **keywords: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, **keywords)
    return buffer.getvalue()


def _head(text: str, version: bytes = b"\x01\x00") -> bytes:
    """The head of an .npy file that says what it likes, and four numbers."""
    padded = text.ljust(117) + "\n"
    return b"\x93NUMPY" + version + struct.pack("<H", len(padded)) + padded.encode() + bytes(32)


class _Trap:
    """What leaves a file behind if it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (Path("pwned"),)


def arrays() -> Iterator[tuple[str, bytes]]:
    right = np.full((4, 4, 4), 0.1)
    content = _npy(right)
    yield "right", content
    for share in (0.01, 0.2, 0.5, 0.99):
        yield f"cut at {share:.0%}", content[: int(share * len(content))]
    for name, value in (("nan", np.nan), ("infinity", np.inf), ("-1", -1.0), ("1e300", 1e300), ("1e-320", 1e-320)):
        one = right.copy()
        one[1, 2, 3] = value
        yield f"one {name}", _npy(one)
        yield f"all {name}", _npy(np.full_like(right, value))
    for shape in ((), (0,), (4,), (4, 4), (4, 4, 0), (1, 1, 1), (4, 4, 4, 1), (2, 4, 4), (1, 4, 64)):
        yield f"shape {shape}", _npy(np.full(shape, 0.1))
    for kind in ("?", "i1", "u8", "f2", ">f8", "c16", "S4", "U4", "M8[s]", "m8[s]", "V8"):
        yield f"type {kind}", _npy(np.zeros((4, 4, 4), dtype=kind))
    yield "type of fields", _npy(np.zeros((4, 4, 4), dtype=[("a", "f8"), ("b", "i4")]))
    yield "objects", _npy(np.full((4, 4, 4), None, dtype=object), allow_pickle=True)
    trap = np.empty((4, 4, 4), dtype=object)
    trap[0, 0, 0] = _Trap()
    yield "objects that do something", _npy(trap, allow_pickle=True)
    yield "a pickle", pickle.dumps(_Trap())
    yield "fortran order", _npy(np.asfortranarray(right))
    for claimed in (
        "(1000000000000,)",
        "(10000, 10000, 10000)",
        "(-1, 4, 4)",
        "(4, 4)",
        "('a',)",
        "4",
        "(1e3,)",
        "(99999999999999999999, 1, 1)",
    ):
        yield f"head with shape {claimed}", _head(f"{{'descr': '<f8', 'fortran_order': False, 'shape': {claimed}, }}")
    for kind in ("'|O'", "'<f99'", "'x'", "None", "[('a', '<f8')]", "'<f8', 'x': 1", "__import__('os')"):
        yield f"head with type {kind}", _head(f"{{'descr': {kind}, 'fortran_order': False, 'shape': (4, 1, 1), }}")
    yield "head of brackets", _head("[" * 100)
    yield "head of version 9", _head("{'descr': '<f8', 'fortran_order': False, 'shape': (4, 1, 1), }", b"\x09\x00")
    yield "nothing", b""
    yield "noise", np.random.default_rng(0).bytes(1000)
    buffer = io.BytesIO()
    np.savez(buffer, a=right)
    yield "an archive", buffer.getvalue()


def _png(width: int, height: int, rows: bytes, depth: int = 8, colour: int = 0) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def images() -> Iterator[tuple[str, str, bytes]]:
    shades = np.arange(144, dtype=np.uint8).reshape(12, 12)
    random = np.random.default_rng(0)
    for suffix in ("png", "tif"):
        buffer = io.BytesIO()
        Image.fromarray(shades).save(buffer, "PNG" if suffix == "png" else "TIFF")
        content = buffer.getvalue()
        yield "right", suffix, content
        for share in (0.05, 0.3, 0.6, 0.95):
            yield f"cut at {share:.0%}", suffix, content[: int(share * len(content))]
        for damage in (1, 5, 30):
            spoilt = bytearray(content)
            for at in random.integers(8, len(spoilt), damage):
                spoilt[at] = random.integers(0, 256)
            yield f"{damage} wrong bytes", suffix, bytes(spoilt)
        yield "nothing", suffix, b""
        yield "noise", suffix, random.bytes(1000)
        for mode in ("1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "I;16", "I", "F"):
            buffer = io.BytesIO()
            try:
                Image.new(mode, (12, 12)).save(buffer, "PNG" if suffix == "png" else "TIFF")
            except (OSError, ValueError):
                continue
            yield f"black in mode {mode}", suffix, buffer.getvalue()
    yield "of one pixel", "png", _png(1, 1, b"\0\xff")
    yield "of no pixels", "png", _png(0, 0, b"")
    yield "of 60,000 x 60,000 pixels", "png", _png(60_000, 60_000, bytes(1000))
    yield "of 2e9 x 2e9 pixels", "png", _png(2**31 - 1, 2**31 - 1, bytes(1000))
    yield "that swells to 100 MB", "png", _png(10_000, 10_000, bytes(10_001 * 10_000))
    yield "of 100,000 x 1 pixels", "png", _png(100_000, 1, bytes(100_001))
    yield "of depth 3", "png", _png(4, 4, bytes(20), depth=3)
    values = np.full((12, 12), np.nan, dtype=np.float32)
    buffer = io.BytesIO()
    Image.fromarray(values).save(buffer, "TIFF")
    yield "of nan", "tif", buffer.getvalue()
    yield "as text", "png", b"P2\n2 2\n255\n0 1 2 3\n"
    yield "as vectors", "png", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\nshowpage\n"
    yield "as another suffix", "gif", _png(1, 1, b"\0\xff")


def meshes() -> Iterator[tuple[str, bytes]]:
    corners = np.array([[-50.0, -50, -50], [150, -50, -50], [-50, 150, -50], [-50, -50, 150]])
    four = np.array([[0, 1, 2, 3]])

    def vtu(points: Any = corners, cells: Any = None, values: Any = None, **more: Any) -> bytes:
        import tempfile  # noqa: PLC0415

        data = {"coefficient": np.full(len(points), 0.1) if values is None else values}
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "mesh.vtu"
            meshio.Mesh(points, [("tetra", four)] if cells is None else cells, point_data=data).write(path, **more)
            return path.read_bytes()

    content = vtu()
    text = vtu(binary=False)
    yield "right", content
    yield "right, as text", text
    for share in (0.01, 0.3, 0.6, 0.9, 0.99):
        yield f"cut at {share:.0%}", content[: int(share * len(content))]
        yield f"text cut at {share:.0%}", text[: int(share * len(text))]
    yield "nothing", b""
    yield "noise", np.random.default_rng(0).bytes(1000)
    for bad in (np.nan, np.inf, -1.0, 1e300):
        yield f"values of {bad}", vtu(values=np.full(4, bad))
        moved = corners.copy()
        moved[0, 0] = bad
        yield f"a corner at {bad}", vtu(points=moved)
    yield "values in threes", vtu(values=np.ones((4, 3)))
    yield "values of integers", vtu(values=np.arange(4))
    yield "another name", content.replace(b"coefficient", b"coefficiant")
    yield "no cells", vtu(cells=[])
    yield "triangles", vtu(cells=[("triangle", four[:, :3])])
    yield "points", vtu(cells=[("vertex", four.T)])
    yield "hexahedra", vtu(points=np.vstack([corners, corners + 1]), cells=[("hexahedron", np.arange(8)[None])])
    yield "tetrahedra and triangles", vtu(cells=[("tetra", four), ("triangle", four[:, :3])])
    yield (
        "curved tetrahedra",
        vtu(points=np.random.default_rng(0).normal(size=(10, 3)), cells=[("tetra10", np.arange(10)[None])]),
    )
    yield "an inverted one", vtu(cells=[("tetra", four[:, [1, 0, 2, 3]])])
    yield "a flat one", vtu(points=corners * [1, 1, 0])
    yield "one given twice", vtu(cells=[("tetra", np.vstack([four, four]))])
    yield "all at one place", vtu(points=corners * 0)
    yield "far away", vtu(points=corners + 1e9)
    yield "in another unit", vtu(points=corners * 1e-3)
    for number in (4, -1, 2**31 - 1, -(2**31)):
        yield f"a corner of number {number}", text.replace(b"0\n1\n2\n3", f"0\n1\n2\n{number}".encode())
    yield "more cells than there are", text.replace(b'NumberOfCells="1"', b'NumberOfCells="1000000000000"')
    yield "more points than there are", text.replace(b'NumberOfPoints="4"', b'NumberOfPoints="1000000000000"')
    laughs = b"".join(b'<!ENTITY l%d "%s">' % (i + 1, b"&l%d;" % i * 10) for i in range(9))
    yield "a billion laughs", b'<!DOCTYPE m [<!ENTITY l0 "ha">' + laughs + b"]><VTKFile>&l9;</VTKFile>"
    yield "a reference", b'<!DOCTYPE m [<!ENTITY x SYSTEM "file:///dev/zero">]><VTKFile>&x;</VTKFile>'
    yield "nested deeply", b"<VTKFile>" * 100_000
    yield "another dialect", b'<?xml version="1.0"?><VTKFile type="PolyData"></VTKFile>'
    big = base64.b64encode(struct.pack("<IIII", 2**31, 2**31, 0, 12) + bytes(12))
    yield "blocks that lie", content.replace(content[content.find(b"AQAAA") :][:16], big[:16])


def volumes(seed: int = 0) -> Iterator[MalformedVolume]:
    """All of them, each for what it may be named in a case as; what is random in them depends on the seed."""
    for name, content in arrays():
        yield MalformedVolume(f"array, {name}", ARRAY, "npy", content)
    for name, suffix, content in images():
        for kind in (IMAGES, SPOT, SKY):
            yield MalformedVolume(f"{kind}, {name}", kind, suffix, content)
    for name, content in meshes():
        yield MalformedVolume(f"volume, {name}", VOLUME, "vtu", content)
    for name, content in broken():
        yield MalformedVolume(f"mesh, {name}", MESH, "vtu", content)
    for suffix, name, content in damaged(seed):
        yield MalformedVolume(f"mesh, {name}", MESH, suffix, content)
    for name, files in tables():
        yield MalformedVolume(f"mesh, NIRFAST, {name}", MESH, "node", files["node"], files)
