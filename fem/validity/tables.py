"""Relative errors of diffusion compared with radiative transfer, by one cause at a time.

The figures are ``|diffusion/transfer - 1|`` of the exitance, printed by ``python -m tests.tables.validity``. They are
interpolated linearly, over ``log(1 - albedo)``, the mean cosine, the index and the distance. Outside a table its
nearest value is used, except at large distances. Lengths are in transport mean free paths 1/sigma_t'.
"""

from typing import Literal

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray

ALBEDOS = (0.6, 0.9, 0.99)
COSINES = (0.0, 0.8)
INDICES = (1.0, 1.4)
# Near the entry of a thin beam that is deposited at a point: by mean cosine of scattering, albedo, and ring of
# distances from the entry. Each value is the largest error from that ring on, since the error changes its sign.
NEAR_RINGS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0)
BEAM = (
    ((1.00, 1.00, 1.00, 1.00, 0.69, 0.27), (0.73, 0.49, 0.49, 0.49, 0.38, 0.24), (0.70, 0.30, 0.30, 0.30, 0.23, 0.13)),
    ((0.63, 0.63, 0.63, 0.41, 0.15, 0.11), (0.52, 0.24, 0.24, 0.18, 0.09, 0.01), (0.49, 0.15, 0.15, 0.11, 0.07, 0.02)),
)
# Near an isotropic point source 0.25 to 4 deep: by albedo and ring of distances from the source.
SOURCE = (
    (0.94, 0.94, 0.77, 0.53, 0.44, 0.25),
    (0.45, 0.45, 0.34, 0.22, 0.17, 0.08),
    (0.37, 0.34, 0.23, 0.13, 0.07, 0.04),
)
# Far from a thin beam, deposited at a point or along its path: by albedo and ring of distances.
FAR_RINGS = (6.0, 10.0, 15.0)
FAR = ((0.32, 0.72), (0.06, 0.16), (0.03, 0.03))
# A wide beam on a half-space: by index and albedo.
WIDE = ((0.07, 0.03, 0.01), (0.22, 0.07, 0.01))
# A ball in a wide beam, mean over its surface: by mean cosine and diameter.
DIAMETERS = (0.5, 1.0, 2.0, 4.0, 10.0, 20.0, 40.0)
THIN = ((0.03, 0.05, 0.05, 0.05, 0.04, 0.02, 0.02), (0.57, 0.35, 0.14, 0.09, 0.07, 0.06, 0.05))
# A pencil beam on a plate, mean of both faces away from its axis: by mean cosine and thickness.
THICKNESSES = (0.5, 1.0, 2.0, 4.0, 8.0)
PLATE = ((1.78, 0.79, 0.41, 0.20, 0.16), (1.16, 0.36, 0.10, 0.06, 0.06))
# Distance at which the errors near a light have decreased to 0, and at which those far from it start.
NEAR_LIMIT, FAR_START = 8.0, 4.0

# Thin beams and points; beams with a radius of more than `NEAR_LIMIT`; light everywhere.
Spread = Literal["narrow", "wide", "everywhere"]


def near_rows(albedo: FloatArray, cosine: FloatArray | None) -> FloatArray:
    """Errors near the entries of thin beams, or near point sources, by ring of distances.

    Parameters
    ----------
    albedo : (n,) ndarray
        Reduced albedo of the medium at each.
    cosine : (n,) ndarray, optional
        Mean cosine of scattering at the entry of each beam; None for point sources.

    Returns
    -------
    (n, 6) ndarray
    """
    if cosine is None:
        return _interpolate(np.array(SOURCE), _locate_albedo(albedo))
    return _interpolate(np.array(BEAM), _locate(cosine, COSINES), _locate_albedo(albedo))


def near_error(rows: FloatArray, distance: FloatArray) -> FloatArray:
    """Errors near the entry of a thin beam, or near a point source.

    Parameters
    ----------
    rows : (n, 6) ndarray
        See `near_rows`.
    distance : (n,) ndarray
        From the entry or source, mean free paths.

    Returns
    -------
    (n,) ndarray
    """
    return _interpolate_rows(
        (*_midpoints(NEAR_RINGS), NEAR_LIMIT), np.column_stack([rows, np.zeros(len(rows))]), distance
    )


def far_error(albedo: FloatArray, distance: FloatArray) -> FloatArray:
    """Errors far from all light.

    Beyond the table they grow: diffusion decays faster than radiative transfer by ``0.4 (1 - albedo) sigma_tr`` (Case
    and Zweifel 1967, for isotropic scattering, to first order).

    Parameters
    ----------
    albedo : (n,) ndarray
        Reduced albedo of the medium at each place.
    distance : (n,) ndarray
        From the nearest light, mean free paths.

    Returns
    -------
    (n,) ndarray
    """
    at = _midpoints(FAR_RINGS)
    rows = _interpolate(np.array(FAR), _locate_albedo(albedo))
    error = _interpolate_rows((FAR_START, *at), np.column_stack([np.zeros(len(rows)), rows]), distance)
    # sigma_tr times the mean free path is sqrt(3 (1 - albedo)).
    excess = 0.4 * (1.0 - albedo) * np.sqrt(3.0 * (1.0 - albedo))
    return np.asarray(1.0 - (1.0 - error) * np.exp(-excess * np.maximum(distance - at[-1], 0.0)))


def wide_error(albedo: FloatArray, eta: float) -> FloatArray:
    """Errors under a wide beam.

    Parameters
    ----------
    albedo : (n,) ndarray
        Reduced albedo of the medium at each place.
    eta : float
        Relative refractive index.

    Returns
    -------
    (n,) ndarray
    """
    return _interpolate(np.array(WIDE), _locate(np.full(len(albedo), eta), INDICES), _locate_albedo(albedo))


def thin_error(cosine: FloatArray, thickness: FloatArray, light: Spread) -> FloatArray:
    """Errors in thin parts of a body, beyond those of a thick body.

    A wide beam grazes large bodies too, which makes most of their error; for wide beams that error is included.

    Parameters
    ----------
    cosine : (n,) ndarray
        Mean cosine of scattering at each place.
    thickness : (n,) ndarray
        Of the body, mean free paths.
    light : {"narrow", "wide", "everywhere"}
        See `Spread`.

    Returns
    -------
    (n,) ndarray
    """
    columns, table = (THICKNESSES, PLATE) if light == "narrow" else (DIAMETERS, THIN)
    rows = _interpolate(np.array(table), _locate(cosine, COSINES))
    return _interpolate_rows(columns, rows if light == "wide" else np.maximum(rows - rows[:, -1:], 0.0), thickness)


def _midpoints(rings: tuple[float, ...]) -> FloatArray:
    edges = np.array(rings)
    return np.asarray(0.5 * (edges[1:] + edges[:-1]))


_Position = tuple[IntArray, FloatArray]


def _locate(value: FloatArray, knots: tuple[float, ...]) -> _Position:
    """Number of the knot below each value (n,), and the value's position from there to the next knot, 0 to 1."""
    position = np.interp(value, knots, np.arange(len(knots)))
    low = np.minimum(position.astype(np.int64), len(knots) - 2)
    return low, position - low


def _locate_albedo(albedo: FloatArray) -> _Position:
    scale = -np.log(1.0 - np.array(ALBEDOS))
    return _locate(-np.log(np.maximum(1.0 - albedo, 1e-9)), tuple(scale))


def _interpolate(table: FloatArray, *positions: _Position) -> FloatArray:
    """Interpolate a table along its first axes, one for each of the positions (n,): (n, ...) with its other axes."""
    found = 0.0
    for corner in np.ndindex(*(2 for _ in positions)):
        weight = np.ones(len(positions[0][0]))
        index = []
        for up, (low, share) in zip(corner, positions, strict=True):
            weight = weight * (share if up else 1.0 - share)
            index.append(low + up)
        values = table[tuple(index)]
        found = found + weight.reshape(-1, *(1,) * (values.ndim - 1)) * values
    return np.asarray(found)


def _interpolate_rows(knots: tuple[float, ...], rows: FloatArray, value: FloatArray) -> FloatArray:
    """Interpolate rows (n, k) of values at ascending knots (k,), each at a value of its own, (n,)."""
    low, share = _locate(value, knots)
    every = np.arange(len(rows))
    return np.asarray((1.0 - share) * rows[every, low] + share * rows[every, low + 1])
