"""GLB, GLTF and 3MF: scenes of several meshes, through trimesh."""

import json
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError

COMPRESSED = {
    "KHR_draco_mesh_compression": "Draco-compressed",
    "EXT_meshopt_compression": "compressed by meshopt",
    "KHR_meshopt_compression": "compressed by meshopt",
}
# Required extensions that do not affect the shape: materials, or quantized coordinates that a node scales.
HARMLESS = ("KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_", "EXT_lights_", "KHR_mesh_quantization")
FAN = 6
UNITS_OF_3MF = {"micron": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "inch": 25.4, "foot": 304.8, "meter": 1e3}
# Bytes of a model that are searched for its root element.
HEAD = 1 << 16


def read_scene(path: Path) -> tuple[FloatArray, IntArray]:
    """Points (n, 3) and triangles (m, 3) of all meshes, as placed in the scene.

    Raises
    ------
    InputError
        If the file has content that trimesh ignores or misreads.
    """
    import trimesh  # noqa: PLC0415
    from trimesh.resolvers import ZipResolver  # noqa: PLC0415

    if path.suffix.lower() in (".glb", ".gltf"):
        check_gltf(_gltf_head(path))
    # Pictures and materials are not read: only glTF keeps triangles in other files.
    resolver = None if path.suffix.lower() == ".gltf" else ZipResolver({})
    scene = trimesh.load_scene(path, resolver=resolver, process=False)
    meshes = [m for m in scene.dump() if isinstance(m, trimesh.Trimesh)]
    if not meshes:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes])
    points = np.vstack([m.vertices for m in meshes])
    faces = np.vstack([np.asarray(m.faces) + o for m, o in zip(meshes, offsets, strict=False)])
    return np.asarray(points, dtype=np.float64), np.asarray(faces, dtype=np.int64)


def unit_of_3mf(path: Path) -> tuple[str, float]:
    """The unit that a 3MF file is in, and how many millimetres it is (3MF Core Specification, section 3.4)."""
    with zipfile.ZipFile(path) as archive:
        part = next(name for name in archive.namelist() if name.lower().endswith(".model"))
        with archive.open(part) as model:
            head = re.search(rb"<(?:\w+:)?model\b[^>]*", model.read(HEAD))
    found = re.search(rb"\bunit\s*=\s*[\"'](\w+)", head[0]) if head else None
    unit = found[1].decode() if found else "millimeter"
    return unit, UNITS_OF_3MF.get(unit, 1.0)


def _gltf_head(path: Path) -> dict[str, Any]:
    """The JSON header of a scene."""
    data = path.read_bytes()
    if data[:4] == b"glTF":
        data = data[20 : 20 + int.from_bytes(data[12:16], "little")]
    head = json.loads(data)
    if not isinstance(head, dict):
        raise ValueError("no head")
    return head


def check_gltf(head: dict[str, Any]) -> None:
    """Refuse files that trimesh would read as empty or as another shape.

    Raises
    ------
    InputError
    """
    for extension in head.get("extensionsRequired", []):
        if extension in COMPRESSED:
            raise InputError(f"is {COMPRESSED[extension]}; export it without compression.")
        if not extension.startswith(HARMLESS):
            raise InputError(f"requires the glTF extension {extension}, which is not read; export it without.")
    for mesh in head.get("meshes", []):
        for primitive in mesh["primitives"]:
            place = head["accessors"][primitive["attributes"]["POSITION"]]
            if primitive.get("mode") == FAN:
                raise InputError("holds triangle fans, which are not read; export it as triangles.")
            if "sparse" in place or place.get("normalized"):
                raise InputError("holds sparse or normalized coordinates, which are not read; export plain ones.")
