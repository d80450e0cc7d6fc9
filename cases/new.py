"""`write_new_case`: a commented case file to start from."""

import json
import math
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from tetlux.cases.shipped import library_folder, schema_line

if TYPE_CHECKING:
    from tetlux.meshing.arrays import FloatArray

TEMPLATE = """\
# NAME: say here what it is for.
SCHEMA
# Check it: tetlux check NAME.yaml. Run it: tetlux run NAME.yaml. All keys: docs/case-files.md, or tetlux schema.

# All lengths are in this unit, and coefficients in 1 over it.
unit: mm

# The body: a closed surface, or one of sphere, slab, box, cylinder, torus.
BODY

# Absorption, reduced scattering, refractive index relative to what surrounds the body.
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
# medium: {material: skin1}  # measured in red, green and blue

# Other media inside the body:
# regions:
#   - name: core
#     surface: {sphere: {radius: 3, center: [0, 0, 4]}}
#     medium: {sigma_a: 0.1, sigma_s_prime: 1.0, eta: 1.4}

# Light, in W (power), W/mm² (irradiance).
lights:
  - pencil: BEAM
  # - point: {position: [0, 0, 5], power: 1.0}
  # - collimated: {direction: [0, 0, -1], irradiance: 1.0}
  # - diffuse: {irradiance: 1.0}

# What is read at places of the surface, each with its error:
# detectors:
#   - {name: side, disc: {center: [10, 0, 0], radius: 0.5}}

# Wanted relative error; a smaller one takes longer.
tolerance: 0.02
# tolerance: {exitance: 0.02, detectors: 0.01}

# Beside the summary; viewer is a page that turns, cuts and reads the body in any browser.
outputs: [surface, volume, picture, viewer]

# One run for each value of any key:
# sweep: {medium.sigma_a: [0.001, 0.01, 0.1]}
"""

BALL = """\
surface: {sphere: {radius: 10}}
# surface: {file: scan.stl, scale: 1.0}
# up: [0, 1, 0]  # what is up in pictures, if not z"""
BEAM = "{origin: [0, 0, 20], direction: [0, 0, -1], power: 1.0}"
# Files of these formats have y up: glTF always, OBJ mostly.
Y_UP = (".glb", ".gltf", ".obj")
# A file of so small a diagonal is taken to be in metres, as scans are, not in millimetres.
IN_METRES = 5.0
LYING = "if the body lies on its side in the picture"


def write_new_case(name: str, surface: str | None = None) -> Path:
    """Write a commented case file that runs as it is.

    Parameters
    ----------
    name : str
        Name of the case, or the path of its file; without a suffix, ``.yaml`` is added.
    surface : str, optional
        Path of a surface file: it becomes the body, and a beam from above is aimed at it.

    Returns
    -------
    Path
        The new file.

    Raises
    ------
    InputError
        If the name is none that a case may have, the file exists or cannot be written, or the surface bounds no body.
    """
    from tetlux.meshing.errors import InputError  # noqa: PLC0415 - takes half a second

    path = Path(name)
    path = path if path.suffix in (".yaml", ".yml") else path.with_name(f"{path.name}.yaml")
    if not re.fullmatch(r"\w[\w .+=,-]*", path.stem):
        raise InputError(f'"{path.stem}" is no name of a case; use letters, digits, spaces and . + = , - _ in it.')
    if (library_folder() / f"{name}.yaml").exists():
        raise InputError(f'"{name}" is a shipped case; take another name, or copy it: tetlux show {name} > mine.yaml')
    body, beam = (BALL, BEAM) if surface is None else _body_and_beam(Path(surface), path.parent)
    text = TEMPLATE.replace("NAME", path.stem).replace("SCHEMA", schema_line())
    text = text.replace("BEAM", beam).replace("BODY", body)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise InputError(f"{path} exists; take another name.") from error
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}; take another name.") from error
    return path


def _body_and_beam(file: Path, folder: Path) -> tuple[str, str]:
    """What a case in a folder says of a surface file, and a beam that meets it from above."""
    from tetlux.meshing.errors import InputError  # noqa: PLC0415
    from tetlux.meshing.files.surfaces import read_surface  # noqa: PLC0415

    holes = ""
    try:
        surface = read_surface(file)
    except InputError:
        if not file.is_file():
            raise
        # Scans are often open below.
        surface, holes = read_surface(file, holes="close"), ", holes: close"
    scale = 1000 if surface.diagonal < IN_METRES else 1
    low, high = scale * surface.points.min(axis=0), scale * surface.points.max(axis=0)
    y_up = file.suffix.lower() in Y_UP
    name = json.dumps(Path(os.path.relpath(file, folder)).as_posix(), ensure_ascii=False)
    lines = (
        f"surface: {{file: {name}, scale: {scale}{holes}}}",
        f"# The body is {' x '.join(f'{length:.4g}' for length in high - low)} mm, from {_rounded(low, high - low)} to "
        f"{_rounded(high, high - low)}. If that is not its size, change scale, and move the light.",
        f"up: [0, 1, 0]  # what is up in pictures; remove it {LYING}" if y_up else f"# up: [0, 1, 0]  # {LYING}",
    )
    return "\n".join(lines), _beam_from_above(scale * surface.points[surface.faces], 1 if y_up else 2)


def _beam_from_above(corners: "FloatArray", axis: int) -> str:
    """A beam against an axis, on the triangle near the middle that faces it, from above the body."""
    import numpy as np  # noqa: PLC0415

    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, axis] > 0
    places = corners[facing].mean(axis=1)
    level = [other for other in range(3) if other != axis]
    away = np.linalg.norm((places - 0.5 * (low + high))[:, level], axis=1)
    start = places[int(np.argmin(away))].copy()
    start[axis] = high[axis] + 0.25 * np.linalg.norm(high - low)
    direction = [-1 if each == axis else 0 for each in range(3)]
    return f"{{origin: {_rounded(start, high - low)}, direction: {direction}, power: 1.0}}"


def _rounded(place: "FloatArray", extent: "FloatArray") -> list[float]:
    """A place to about a ten-thousandth of the size of the body."""
    digits = 4 - math.ceil(math.log10(float(extent.max())))
    return [round(float(value), digits) for value in place]
