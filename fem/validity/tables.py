"""How far diffusion is from radiative transfer, by one cause at a time.

The figures are ``|diffusion/transfer - 1|`` of the exitance as ``python -m tests.tables.validity`` prints them. Between
them they are interpolated, by the logarithm of ``1 - albedo``; outside of them the nearest holds, but for great
distances. Lengths are in transport mean free paths 1/sigma_t'.
"""

from typing import Literal

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray

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

# Thin beams and points, beams wider than what is near, and light from everywhere.
Spread = Literal["narrow", "wide", "everywhere"]


def near_rows(albedo: FloatArray, cosine: FloatArray | None) -> FloatArray:
    """Errors near thin beams' entries, or near point sources, by ring.

    Parameters
    ----------
    albedo : (n,) ndarray
        Reduced albedo of the medium there.
    cosine : (n,) ndarray, optional
        Mean cosine of scattering at the entry of a beam; None for point sources.

    Returns
    -------
    (n, 6) ndarray
    """
    if cosine is None:
        return _at(np.array(SOURCE), _by_albedo(albedo))
    return _at(np.array(BEAM), _by_value(cosine, COSINES), _by_albedo(albedo))


def near_error(rows: FloatArray, distance: FloatArray) -> FloatArray:
    """Errors at distances (n,) from a thin beam's entry, or a point source, each with its own of the rows (n, 6)."""
    return _along((*_middles(NEAR_RINGS), FADED), np.column_stack([rows, np.zeros(len(rows))]), distance)


def far_error(albedo: FloatArray, distance: FloatArray) -> FloatArray:
    """Errors at distances (n,) from all light, where the reduced albedo is (n,).

    Beyond the table they grow, as diffusion decays faster than radiative transfer does, by
    ``0.4 (1 - albedo) sigma_tr`` (Case and Zweifel 1967, of isotropic scattering, to first order).
    """
    at = _middles(FAR_RINGS)
    rows = _at(np.array(FAR), _by_albedo(albedo))
    error = _along((BEGINS, *at), np.column_stack([np.zeros(len(rows)), rows]), distance)
    # sigma_tr times the mean free path is sqrt(3 (1 - albedo)).
    excess = 0.4 * (1.0 - albedo) * np.sqrt(3.0 * (1.0 - albedo))
    return np.asarray(1.0 - (1.0 - error) * np.exp(-excess * np.maximum(distance - at[-1], 0.0)))


def wide_error(albedo: FloatArray, eta: float) -> FloatArray:
    """Errors under a wide beam, where the reduced albedo is (n,)."""
    return _at(np.array(WIDE), _by_value(np.full(len(albedo), eta), INDICES), _by_albedo(albedo))


def thin_error(cosine: FloatArray, thickness: FloatArray, light: Spread) -> FloatArray:
    """Errors where the mean cosine is (n,) and the body so thick (n,), beyond those of a thick one.

    Large bodies too are grazed by a wide beam somewhere, which is most of their error in it, and is left in.
    """
    columns, table = (THICKNESSES, PLATE) if light == "narrow" else (DIAMETERS, THIN)
    rows = _at(np.array(table), _by_value(cosine, COSINES))
    return _along(columns, rows if light == "wide" else np.maximum(rows - rows[:, -1:], 0.0), thickness)


def _middles(rings: tuple[float, ...]) -> FloatArray:
    edges = np.array(rings)
    return np.asarray(0.5 * (edges[1:] + edges[:-1]))


_Place = tuple[IntArray, FloatArray]


def _by_value(value: FloatArray, knots: tuple[float, ...]) -> _Place:
    """The knot below each value (n,), and how far it is from there to the next one, as a share."""
    place = np.interp(value, knots, np.arange(len(knots)))
    low = np.minimum(place.astype(np.int64), len(knots) - 2)
    return low, place - low


def _by_albedo(albedo: FloatArray) -> _Place:
    scale = -np.log(1.0 - np.array(ALBEDOS))
    return _by_value(-np.log(np.maximum(1.0 - albedo, 1e-9)), tuple(scale))


def _at(table: FloatArray, *places: _Place) -> FloatArray:
    """A table interpolated at places (n,) along its first axes: what is left of its axes, for each of these."""
    found = 0.0
    for corner in np.ndindex(*(2 for _ in places)):
        weight = np.ones(len(places[0][0]))
        index = []
        for up, (low, share) in zip(corner, places, strict=True):
            weight = weight * (share if up else 1.0 - share)
            index.append(low + up)
        values = table[tuple(index)]
        found = found + weight.reshape(-1, *(1,) * (values.ndim - 1)) * values
    return np.asarray(found)


def _along(knots: tuple[float, ...], rows: FloatArray, value: FloatArray) -> FloatArray:
    """Rows (n, k) of values at ascending knots (k,), each interpolated at a value of its own (n,)."""
    low, share = _by_value(value, knots)
    every = np.arange(len(rows))
    return np.asarray((1.0 - share) * rows[every, low] + share * rows[every, low + 1])
