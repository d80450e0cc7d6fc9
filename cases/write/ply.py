"""Surfaces with values at their vertices as PLY, which mesh tools and viewers of 3D models read."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tetlux.meshing.surface.surface import Surface

# PLY's names of the types of values.
TYPES = {"f8": "double", "u1": "uchar"}


def write_ply(
    surface: Surface, path: Path, values: Mapping[str, npt.NDArray[np.generic]], comments: Sequence[str] = ()
) -> None:
    """Write a triangle mesh as binary PLY.

    Parameters
    ----------
    surface : Surface
    path : Path
    values : mapping of str to (v,) ndarray
        Values at the vertices, floating-point numbers or bytes, by names without spaces.
    comments : sequence of str
        Lines of text for the header.
    """
    columns = {**dict(zip("xyz", surface.points.T, strict=True)), **values}
    kinds = {name: "u1" if column.dtype == np.uint8 else "f8" for name, column in columns.items()}
    vertices = np.empty(len(surface.points), dtype=[(name, "<" + kind) for name, kind in kinds.items()])
    for name, column in columns.items():
        vertices[name] = column
    faces = np.empty(len(surface.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, surface.faces
    head = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {line}" for line in comments),
        f"element vertex {len(vertices)}",
        *(f"property {TYPES[kind]} {name}" for name, kind in kinds.items()),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    with path.open("wb") as file:
        # The header must be ASCII, which ² is not.
        file.write(("\n".join(head) + "\n").replace("²", "^2").encode("ascii", "replace"))
        file.write(vertices.tobytes())
        file.write(faces.tobytes())
