"""Surfaces with colours at their vertices as binary glTF (GLB), which 3D programs and browsers read."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tetlux.cases.file.colours import Bytes, to_linear
from tetlux.cases.picture.view import upright_axes
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.surface.surface import Surface

# glTF's codes of types of numbers, and how many numbers there are at a vertex.
CODES = {"f4": 5126, "u4": 5125, "u1": 5121}
KINDS = {1: "SCALAR", 3: "VEC3"}
ARRAY, ELEMENTS = 34962, 34963
# Unit of length of glTF is the metre.
METRES = {"nm": 1e-9, "um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}


def write_glb(
    surface: Surface, path: Path, colours: Bytes, exitance: FloatArray, up: Vector, notes: Mapping[str, str]
) -> None:
    """Write a triangle mesh as GLB, in metres with y up, as the format asks for.

    Parameters
    ----------
    surface : Surface
    path : Path
    colours : (v, 3) ndarray of uint8
        sRGB at the vertices. ``COLOR_0`` are these in linear light, as the format has it, shown without lamps;
        ``COLOR_1`` as they are.
    exitance : (v,) ndarray
        ``_EXITANCE`` at the vertices. No other name begins with ``_``: Blender 4.5 mixes up several such arrays, since
        it reads them into a set, and refuses the file if they differ in width.
    up : (3,) floats
        The direction that becomes y.
    notes : mapping of str to str
        Stored in ``asset.extras``.
    """
    middle = 0.5 * (surface.points.min(axis=0) + surface.points.max(axis=0))
    arrays: dict[str, npt.NDArray[Any]] = {
        # Relative to the middle, so that 32 bits do for a body far from the origin.
        "POSITION": (surface.points - middle).astype("<f4"),
        "COLOR_0": to_linear(colours / 255.0).astype("<f4"),
        "COLOR_1": (colours / 255.0).astype("<f4"),
        "_EXITANCE": exitance.astype("<f4"),
    }
    accessors: list[dict[str, Any]] = []
    views: list[dict[str, int]] = []
    data = b""
    for name, numbers in {**arrays, "index": surface.faces.astype("<u4").ravel()}.items():
        accessor: dict[str, Any] = {
            "bufferView": len(views),
            "componentType": CODES[numbers.dtype.str[1:]],
            "count": len(numbers),
            "type": KINDS[numbers.shape[1] if numbers.ndim > 1 else 1],
        }
        if name == "POSITION":
            accessor |= {"min": numbers.min(axis=0).tolist(), "max": numbers.max(axis=0).tolist()}
        accessors.append(accessor)
        target = ELEMENTS if name == "index" else ARRAY
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": numbers.nbytes, "target": target})
        data += numbers.tobytes()
    primitive = {"attributes": {name: i for i, name in enumerate(arrays)}, "indices": len(arrays), "material": 0}
    scene = {
        "asset": {"version": "2.0", "generator": "tetlux", "extras": dict(notes)},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": surface.name, "mesh": 0, "matrix": _to_metres(surface.unit, up, middle)}],
        "meshes": [{"name": surface.name, "primitives": [primitive]}],
        "materials": [{"name": "exitance", "extensions": {"KHR_materials_unlit": {}}}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    text = json.dumps(scene, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    head = b"glTF" + np.array([2, 12 + 8 + len(text) + 8 + len(data)], "<u4").tobytes()
    path.write_bytes(head + _chunk(b"JSON", text) + _chunk(b"BIN\0", data))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return np.array([len(data)], "<u4").tobytes() + kind + data


def _to_metres(unit: str, up: Vector, middle: FloatArray) -> list[float]:
    """The matrix (column by column) that turns `up` to y, and the front to z, of positions relative to `middle`."""
    first, second, above = upright_axes(up)
    turned = METRES[unit] * np.stack([first, above, -second])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turned, turned @ middle
    return [float(value) for value in matrix.T.ravel()]
