"""Colours: sRGB and linear light (IEC 61966-2-1), and a preview of red, green and blue exitance."""

import numpy as np

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import triangle_areas

# Channels with these names in this order are shown as colours.
RGB = ("red", "green", "blue")
# Weights of red, green and blue in the luminance of linear sRGB.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
# White in a preview is this quantile of the luminance, by area: small bright spots may be overexposed.
WHITE_SHARE = 0.99

Bytes = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]


def to_linear(encoded: FloatArray) -> FloatArray:
    """Convert sRGB values to linear light, both from 0 to 1."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def to_srgb(linear: FloatArray) -> FloatArray:
    """Convert linear light to sRGB values, both from 0 to 1; values outside are clipped."""
    light = np.clip(linear, 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)


def preview(surface: Surface, exitance: FloatArray) -> tuple[Bytes, float]:
    """Show the exitance of red, green and blue channels as colours of the surface.

    Parameters
    ----------
    surface : Surface
    exitance : (v, 3) ndarray
        Red, green and blue exitance at its vertices, W/unit².

    Returns
    -------
    colours : (v, 3) ndarray of uint8
        sRGB at its vertices.
    white : float
        The luminance that is shown as white, W/unit²; 0 if no light leaves.
    """
    luminance = exitance @ LUMINANCE
    _, areas = triangle_areas(surface.points, surface.faces)
    weights = np.bincount(surface.faces.ravel(), np.repeat(areas / 3.0, 3), minlength=len(surface.points))
    order = np.argsort(luminance)
    below = np.cumsum(weights[order])
    white = max(float(luminance[order][np.searchsorted(below, WHITE_SHARE * below[-1])]), 0.0)
    shares = exitance / white if white > 0 else np.zeros_like(exitance)
    return np.round(255.0 * to_srgb(shares)).astype(np.uint8), white
