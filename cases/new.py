"""`write_new_case`: a commented case file to start from."""

import re
from pathlib import Path

from tetlux.cases.shipped import library_folder, schema_line

TEMPLATE = """\
# NAME: say here what it is for.
SCHEMA
# Check it: tetlux check NAME.yaml. Run it: tetlux run NAME.yaml. All keys: docs/case-files.md, or tetlux schema.

# All lengths are in this unit, and coefficients in 1 over it.
unit: mm

# The body: a closed surface, or one of sphere, slab, box, cylinder, torus.
surface: {sphere: {radius: 10}}
# surface: {file: scan.stl, scale: 1.0}
# up: [0, 1, 0]  # what is up in pictures, if not z

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
  - pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 1.0}
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


def write_new_case(name: str) -> Path:
    """Write a commented case file that runs as it is.

    Parameters
    ----------
    name : str
        Name of the case, or the path of its file; without a suffix, ``.yaml`` is added.

    Returns
    -------
    Path
        The new file.

    Raises
    ------
    InputError
        If the name is none that a case may have, the file exists, or cannot be written.
    """
    from tetlux.meshing.errors import InputError  # noqa: PLC0415 - takes half a second

    path = Path(name)
    path = path if path.suffix in (".yaml", ".yml") else path.with_name(f"{path.name}.yaml")
    if not re.fullmatch(r"\w[\w .+=,-]*", path.stem):
        raise InputError(f'"{path.stem}" is no name of a case; use letters, digits, spaces and . + = , - _ in it.')
    if (library_folder() / f"{name}.yaml").exists():
        raise InputError(f'"{name}" is a shipped case; take another name, or copy it: tetlux show {name} > mine.yaml')
    text = TEMPLATE.replace("NAME", path.stem).replace("SCHEMA", schema_line())
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise InputError(f"{path} exists; take another name.") from error
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}; take another name.") from error
    return path
