"""Images as light: pixels in linear red, green and blue."""

import warnings
from pathlib import Path

import numpy as np

from tetlux.cases.file.colours import LUMINANCE, to_linear
from tetlux.cases.file.schema.parts import Encoding
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.filesystem import is_file

# White of Pillow's grey images of more than 8 bits.
DEEP = {"I;16": 65535.0, "I;16B": 65535.0, "I": 65535.0}


def read_pixels(path: Path, encoding: Encoding) -> FloatArray:
    """Red, green and blue of an image in linear light.

    Parameters
    ----------
    path : Path
        Anything that Pillow reads; what is transparent is dark.
    encoding : {"srgb", "linear"}
        What the values in the file are.

    Returns
    -------
    (rows, columns, 3) ndarray
        From 0 to 1, the upper row first.

    Raises
    ------
    InputError
        If it is missing or no readable image.
    """
    from PIL import Image  # noqa: PLC0415

    if not is_file(path):
        raise InputError(f"{path} does not exist or is no file; check its path.")
    try:
        # Of what a file cut short lacks, Pillow only warns.
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with Image.open(path) as image:
                white = DEEP.get(image.mode)
                values = np.asarray(image if white else image.convert("RGBA"), dtype=float)
    except Exception as error:  # Pillow raises whatever its decoders ran into
        raise unreadable(path, error) from error
    if white:
        colours, alpha = np.repeat(values[..., None] / white, 3, axis=2), np.ones((*values.shape, 1))
    else:
        colours, alpha = values[..., :3] / 255.0, values[..., 3:] / 255.0
    return alpha * (to_linear(colours) if encoding == "srgb" else colours)


def unreadable(path: Path, error: Exception) -> InputError:
    """What to say of an image that Pillow refused."""
    from PIL import Image  # noqa: PLC0415

    if isinstance(error, Image.DecompressionBombWarning | Image.DecompressionBombError):
        return InputError(f"{path} has more than {Image.MAX_IMAGE_PIXELS:,} pixels; scale it down.")
    return InputError(f"{path} is not a readable image; export it again, as PNG or TIFF say.")


def of_channel(pixels: FloatArray, channel: int, count: int) -> FloatArray:
    """What of an image (rows, columns, 3) one of the channels sees: its colour if they are three, or luminance."""
    return np.asarray(pixels[..., channel] if count == 3 else pixels @ LUMINANCE)
