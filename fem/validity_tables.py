"""How far diffusion is from radiative transfer, by one cause at a time.

The figures are ``|diffusion/transfer - 1|`` of the exitance as ``python -m tests.tables.validity`` prints them. Between
them they are interpolated, by the logarithm of ``1 - albedo``; outside of them the nearest holds, but for great
distances. Lengths are in transport mean free paths 1/sigma_t'.
"""

from typing import Literal

import numpy as np

from tetlux.fem.medium import Medium
from tetlux.meshing.arrays import FloatArray

ALBEDOS = (0.6, 0.9, 0.99)
COSINES = (0.0, 0.8)
INDICES = (1.0, 1.4)
# Near the entry of a thin beam whose deposit is a point: rows by mean cosine of scattering and albedo, columns by the
# distance from it; each is the largest error from there on, since diffusion errs either way and none in between.
NEAR_RINGS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0)
BEAM = (
    ((1.00, 1.00, 1.00, 1.00, 0.69, 0.27), (0.73, 0.49, 0.49, 0.49, 0.38, 0.24), (0.70, 0.30, 0.30, 0.30, 0.23, 0.13)),
    ((0.63, 0.63, 0.63, 0.41, 0.15, 0.11), (0.52, 0.24, 0.24, 0.18, 0.09, 0.01), (0.49, 0.15, 0.15, 0.11, 0.07, 0.02)),
)
# Near an isotropic point source, 0.25 to 4 deep: rows by albedo, columns by the distance from it.
SOURCE = (
    (0.94, 0.94, 0.77, 0.53, 0.44, 0.25),
    (0.45, 0.45, 0.34, 0.22, 0.17, 0.08),
    (0.37, 0.34, 0.23, 0.13, 0.07, 0.04),
)
# Far from a thin beam, whatever its deposit: rows by albedo.
FAR_RINGS = (6.0, 10.0, 15.0)
FAR = ((0.32, 0.72), (0.06, 0.16), (0.03, 0.03))
# A wide beam on a half-space: rows by index, columns by albedo.
WIDE = ((0.07, 0.03, 0.01), (0.22, 0.07, 0.01))
# A ball in a wide beam, the mean over its surface: rows by mean cosine, columns by diameter.
DIAMETERS = (0.5, 1.0, 2.0, 4.0, 10.0, 20.0, 40.0)
THIN = ((0.03, 0.05, 0.05, 0.05, 0.04, 0.02, 0.02), (0.57, 0.35, 0.14, 0.09, 0.07, 0.06, 0.05))
# A pencil beam on a plate, the mean of both faces away from its axis: rows by mean cosine, columns by thickness.
THICKNESSES = (0.5, 1.0, 2.0, 4.0, 8.0)
PLATE = ((1.78, 0.79, 0.41, 0.20, 0.16), (1.16, 0.36, 0.10, 0.06, 0.06))
# What is near has faded at the first distance, what is far begins at the second.
FADED, BEGINS = 8.0, 4.0

NearRow = FloatArray
# Thin beams and points, beams wider than what is near, and light from everywhere.
Spread = Literal["narrow", "wide", "everywhere"]


def near_row(medium: Medium, cosine: float | None) -> NearRow:
    """Errors near a thin beam's entry, with this mean cosine of scattering, or near a point source, by ring."""
    return _by_albedo(np.array(SOURCE) if cosine is None else _between(cosine, COSINES, np.array(BEAM)), medium)


def near_error(row: NearRow, distance: FloatArray) -> FloatArray:
    """Errors at distances from a thin beam's entry, or a point source."""
    return np.asarray(np.interp(distance, [*_middles(NEAR_RINGS), FADED], [*row, 0.0]))


def far_error(medium: Medium, distance: FloatArray) -> FloatArray:
    """Error at distances from all light.

    Beyond the table it grows, as diffusion decays faster than radiative transfer does, by
    ``0.4 (1 - albedo) sigma_tr`` (Case and Zweifel 1967, of isotropic scattering, to first order).
    """
    at = _middles(FAR_RINGS)
    error = np.interp(distance, [BEGINS, *at], [0.0, *_by_albedo(np.array(FAR), medium)])
    excess = 0.4 * (1.0 - medium.albedo) * medium.sigma_tr * medium.mean_free_path
    return np.asarray(1.0 - (1.0 - error) * np.exp(-excess * np.maximum(distance - at[-1], 0.0)))


def wide_error(medium: Medium) -> float:
    """Error under a wide beam."""
    rows = np.array(WIDE)
    return float(_by_albedo(_between(medium.eta, INDICES, rows), medium))


def thin_error(medium: Medium, thickness: FloatArray, light: Spread) -> FloatArray:
    """Error where the body is so thick, beyond that of a thick one.

    Large bodies too are grazed by a wide beam somewhere, which is most of their error in it, and is left in.
    """
    columns, table = (THICKNESSES, PLATE) if light == "narrow" else (DIAMETERS, THIN)
    row = _between(medium.mean_cosine, COSINES, np.array(table))
    return np.asarray(np.interp(thickness, columns, row if light == "wide" else np.maximum(row - row[-1], 0.0)))


def _middles(rings: tuple[float, ...]) -> FloatArray:
    edges = np.array(rings)
    return np.asarray(0.5 * (edges[1:] + edges[:-1]))


def _by_albedo(rows: FloatArray, medium: Medium) -> FloatArray:
    scale = -np.log(1.0 - np.array(ALBEDOS))
    return _between(-np.log(max(1.0 - medium.albedo, 1e-9)), tuple(scale), rows)


def _between(value: float, knots: tuple[float, ...], rows: FloatArray) -> FloatArray:
    """Rows (k, ...) at ascending knots (k,), interpolated at a value."""
    place = float(np.interp(value, knots, np.arange(len(knots))))
    low = min(int(place), len(knots) - 2)
    return np.asarray(rows[low] + (place - low) * (rows[low + 1] - rows[low]))
