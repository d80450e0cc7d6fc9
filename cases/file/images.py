"""Images of light patterns and surroundings, read as linear red, green and blue."""

import warnings
from pathlib import Path

import numpy as np

from tetlux.cases.file.colours import LUMINANCE, to_linear
from tetlux.cases.file.schema.parts import Encoding
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.filesystem import is_file

# The value of white in Pillow's grey images of more than 8 bits, by mode.
DEEP = {"I;16": 65535.0, "I;16B": 65535.0, "I": 65535.0}


def read_pixels(path: Path, encoding: Encoding) -> FloatArray:
    """Read an image as linear red, green and blue.

    Parameters
    ----------
    path : Path
        Any format that Pillow reads; transparent pixels are dark.
    encoding : {"srgb", "linear"}
        The encoding of the values in the file.

    Returns
    -------
    (rows, columns, 3) ndarray
        From 0 to 1, the top row first.

    Raises
    ------
    InputError
        If the file is missing or no readable image.
    """
    from PIL import Image  # noqa: PLC0415

    if not is_file(path):
        raise InputError(f"{path} does not exist or is no file; check its path.")
    try:
        # Pillow only warns of a truncated file.
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with Image.open(path) as image:
                white = DEEP.get(image.mode)
                values = np.asarray(image if white else image.convert("RGBA"), dtype=float)
    except Exception as error:  # Pillow passes on any error of its decoders
        raise unreadable_image(path, error) from error
    if white:
        colours, alpha = np.repeat(values[..., None] / white, 3, axis=2), np.ones((*values.shape, 1))
    else:
        colours, alpha = values[..., :3] / 255.0, values[..., 3:] / 255.0
    return alpha * (to_linear(colours) if encoding == "srgb" else colours)


def unreadable_image(path: Path, error: Exception) -> InputError:
    """The error for an image that Pillow cannot read."""
    from PIL import Image  # noqa: PLC0415

    if isinstance(error, Image.DecompressionBombWarning | Image.DecompressionBombError):
        return InputError(f"{path} has more than {Image.MAX_IMAGE_PIXELS:,} pixels; scale it down.")
    return InputError(f"{path} is not a readable image; export it again, for instance as PNG or TIFF.")


def pixels_in_channel(pixels: FloatArray, channel: int, count: int) -> FloatArray:
    """The part of an image (rows, columns, 3) that a channel sees: its colour if there are three, else luminance."""
    return np.asarray(pixels[..., channel] if count == 3 else pixels @ LUMINANCE)
