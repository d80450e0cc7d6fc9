"""Coefficients that vary in space, read from files: meshes with values, stacks of images, and NumPy arrays."""

import re
import warnings
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tetlux.cases.file.images import unreadable_image
from tetlux.fem.media.fields import grid_field, mesh_field
from tetlux.fem.media.varying import Field
from tetlux.meshing.arrays import Vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.files.meshes import read_with_meshio
from tetlux.meshing.host.filesystem import is_file, is_folder
from tetlux.meshing.tets.given import value_mesh

# The largest value: single precision holds it and sums of many such values.
LARGEST = 1e30
IMAGES = (".png", ".tif", ".tiff")
# The value of white in grey images, by Pillow's mode.
WHITE = {"1": 1, "L": 255, "I;16": 65535, "I;16B": 65535}


def read_mesh_field(path: str | Path, name: str, *, scale: float = 1.0) -> Field:
    """Read a field given at the nodes or in the tetrahedra of a volume mesh.

    Parameters
    ----------
    path : str or Path
        A VTU file.
    name : str
        Name of the array of values; if nodes and tetrahedra both have it, the one at the nodes is read.
    scale : float
        Factor on the file's coordinates.

    Returns
    -------
    Field
        See `tetlux.fem.media.fields.mesh_field`.

    Raises
    ------
    InputError
        If the file is missing or unreadable, holds no tetrahedra or no such array, or a value is not finite.
    """
    path = _check_file(path, (".vtu",))
    if not np.isfinite(scale) or scale <= 0:
        raise InputError(f"scale is {scale:g}; give a factor greater than 0.")
    data = read_with_meshio(path, "vtu")
    blocks = [number for number, block in enumerate(data.cells) if block.type == "tetra"]
    if not blocks:
        raise InputError(f"{path} holds no tetrahedra; give a tetrahedral mesh.")
    if name not in data.point_data and name not in data.cell_data:
        known = ", ".join(dict.fromkeys([*data.point_data, *data.cell_data])) or "none"
        raise InputError(f'{path} holds no array "{name}"; the arrays there are: {known}.')
    try:
        # Nodes of other cells are left out: their values do not matter and may be invalid.
        mesh, used = value_mesh(
            scale * np.asarray(data.points), np.vstack([data.cells[block].data for block in blocks])
        )
        if name in data.point_data:
            return mesh_field(mesh, data.point_data[name][used], at="nodes")
        values = np.concatenate([data.cell_data[name][block] for block in blocks])
        return mesh_field(mesh, values, at="tetrahedra")
    except InputError as error:
        raise InputError(f'{path}, array "{name}": {error}') from error


def read_image_field(
    path: str | Path, *, origin: Vector, spacing: float | Vector, values: tuple[float, float]
) -> Field:
    """Read a field from a stack of grey images.

    Columns run along x, rows along y (the first row has the smallest y), and slices along z.

    Parameters
    ----------
    path : str or Path
        A folder of PNG or TIFF images, in the order of their names (2 before 10); or one file with all slices as pages.
    origin : (3,) floats
        Centre of the first pixel of the first slice, unit.
    spacing : float or (3,) floats
        Width and height of a pixel, and distance between slices, unit.
    values : (2,) floats
        The values of black and white; grey is interpolated linearly.

    Returns
    -------
    Field
        See `tetlux.fem.media.fields.grid_field`.

    Raises
    ------
    InputError
        If an image is missing, unreadable or not grey, or they differ in size or depth.
    """
    path = Path(path)
    if is_folder(path):
        try:
            files = sorted((f for f in path.iterdir() if f.suffix.lower() in IMAGES and is_file(f)), key=_natural_order)
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror}.") from error
        if not files:
            raise InputError(f"{path} holds no images; give a folder of PNG or TIFF slices.")
    else:
        files = [_check_file(path, IMAGES)]
    low, high = np.asarray(values, dtype=float)
    if not (np.abs([low, high]) <= LARGEST).all():
        raise InputError(
            f"values are {values}; give two finite numbers up to {LARGEST:g}, the values of black and white."
        )
    slices: list[npt.NDArray[np.float32]] = []
    first = ""
    for file in files:
        for mode, pixels in _pages(file):
            rows, columns = pixels.shape
            kind = f"{columns} x {rows} pixels, mode {mode}"
            first = first or kind
            if kind != first:
                raise InputError(f"{file} has {kind}, and {files[0]} has {first}; give slices of one size and mode.")
            slices.append((low + (high - low) / WHITE[mode] * pixels).astype(np.float32))
    # Rows and columns of an image are y and x.
    try:
        return grid_field(np.stack(slices).transpose(2, 1, 0), origin=origin, spacing=spacing)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def read_array_field(path: str | Path, *, origin: Vector, spacing: float | Vector) -> Field:
    """Read a field from a three-dimensional NumPy array.

    Parameters
    ----------
    path : str or Path
        An .npy file of values ``[x, y, z]``.
    origin : (3,) floats
        Centre of the first voxel, unit.
    spacing : float or (3,) floats
        Distance between neighbouring values, unit.

    Returns
    -------
    Field
        See `tetlux.fem.media.fields.grid_field`.

    Raises
    ------
    InputError
        If the file is missing or unreadable, or its array not three-dimensional, real and finite.
    """
    path = _check_file(path, (".npy",))
    try:
        values = np.load(path, allow_pickle=False)
    except Exception as error:  # NumPy passes on any error of its parser
        raise InputError(f"{path} is not a readable array of numbers; save it again with numpy.save.") from error
    try:
        return grid_field(values, origin=origin, spacing=spacing)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _check_file(path: str | Path, suffixes: tuple[str, ...]) -> Path:
    """The path of a file that exists and has one of some suffixes."""
    path = Path(path)
    if not is_file(path):
        raise InputError(f"{path} does not exist or is no file; check its path.")
    if path.suffix.lower() not in suffixes:
        raise InputError(f'{path}: "{path.suffix}" files are not read here; give {" or ".join(suffixes)}.')
    return path


def _pages(file: Path) -> list[tuple[str, npt.NDArray[np.generic]]]:
    """Read the pages of a grey image file: Pillow's mode, and pixels (rows, columns)."""
    from PIL import Image, ImageSequence  # noqa: PLC0415

    try:
        # Pillow only warns of a truncated file.
        with warnings.catch_warnings():
            warnings.simplefilter("error", UserWarning)
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(file) as image:
                pages = [(page.mode, np.asarray(page)) for page in ImageSequence.Iterator(image)]
    except Exception as error:  # Pillow passes on any error of its decoders
        raise unreadable_image(file, error) from error
    for mode, _ in pages:
        if mode not in WHITE:
            raise InputError(f"{file} is not a grey image of 8 or 16 bits (its mode is {mode}); convert it to one.")
    return pages


def _natural_order(file: Path) -> list[tuple[int, str]]:
    """Sort key by which slice2 comes before slice10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", file.name)]
