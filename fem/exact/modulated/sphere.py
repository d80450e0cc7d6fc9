"""A point source in a ball, of light that is modulated or in time after a pulse."""

import numpy as np
import numpy.typing as npt
from numpy.polynomial import legendre

from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray, NumberArray

# Terms of the series, at least and at most, whose last one has this share of the first; those that start the continued
# fraction; nodes of the contour.
LEAST_TERMS, MOST_TERMS, LAST = 40, 4000, 1e-18
MORE_TERMS, NODES = 50, 32


def point_exitance(
    medium: Medium, *, radius: float, source_radius: float, gamma: npt.ArrayLike, shift: complex = 0.0
) -> NumberArray:
    """Exitance of a ball with a point source of 1 W, in the diffusion approximation with ``sigma_a + shift``.

    The series of `tetlux.fem.exact.sphere` with a complex wave number ``k = sqrt((sigma_a + shift)/D)``; its ratios of
    Bessel functions are continued fractions.

    Parameters
    ----------
    medium : Medium
    radius, source_radius : float
        Of the ball, and of the source, more than 0 and less than the radius; unit.
    gamma : (n,) array_like
        Angles from the source, radians.
    shift : complex
        ``i omega n/c`` for light modulated at the angular frequency omega, in a medium of index n, 1/unit.

    Returns
    -------
    (n,) ndarray
        Complex amplitude of the exitance, W/unit².

    Examples
    --------
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> shift = 2j * np.pi * 100e6 * 1.4 / 299_792_458e3
    >>> found = point_exitance(medium, radius=10.0, source_radius=10.0 - 1.0 / 1.01, gamma=[np.pi / 2], shift=shift)
    >>> round(float(abs(found[0])), 9), round(float(-np.degrees(np.angle(found[0]))), 4)
    (8.7201e-05, 11.1179)
    """
    k = np.sqrt((medium.sigma_a + shift) / medium.diffusion + 0j)
    beyond = medium.extrapolation_length
    terms = int(np.clip(np.log(LAST) / np.log(source_radius / radius), LEAST_TERMS, MOST_TERMS))
    at_surface, at_source = _ratios(k * radius, terms), _ratios(k * source_radius, terms)
    shape = np.exp(k * (source_radius - radius)) * np.expm1(-2 * k * source_radius) / np.expm1(-2 * k * radius)
    shape *= radius / source_radius
    weights = np.zeros(terms, complex)
    for order in range(terms):
        weights[order] = (2 * order + 1) * shape / (1 + beyond * k * (order / (k * radius) + at_surface[order]))
        shape *= at_source[order] / at_surface[order]
    found = legendre.legval(np.cos(np.asarray(gamma, dtype=float)), weights) / (4 * np.pi * radius**2)
    return np.asarray(found)


def pulse_exitance(
    medium: Medium, *, radius: float, source_radius: float, gamma: npt.ArrayLike, path: float
) -> FloatArray:
    """Exitance of a ball at a time after a pulse of 1 J from a point, in the diffusion approximation.

    By Talbot's contour with 32 nodes (Weideman 2006, SIAM J. Numer. Anal. 44, 2342): without absorption it is right
    to some 1e-9 of the largest exitance in time, and a factor ``exp(-sigma_a path)`` is that of absorption.

    Parameters
    ----------
    medium : Medium
    radius, source_radius, gamma
        As for `point_exitance`.
    path : float
        How far light has come in the medium, ``c t/n``, unit.

    Returns
    -------
    (n,) ndarray
        For each unit of path, 1/unit³: times c/n it is for each second.

    Examples
    --------
    >>> medium, v = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4), 299.792458 / 1.4  # mm/ns
    >>> found = pulse_exitance(medium, radius=10.0, source_radius=10.0 - 1.0 / 1.01, gamma=[np.pi / 2], path=0.2 * v)
    >>> round(float(v * found[0]), 9)
    0.000301044
    """
    theta = np.pi * (2 * np.arange(NODES // 2) + 1) / NODES
    rates = NODES / path * (0.5017 * theta / np.tan(0.6407 * theta) - 0.6122 + 0.2645j * theta)
    slopes = 0.5017 / np.tan(0.6407 * theta) - 0.32143919 * theta / np.sin(0.6407 * theta) ** 2 + 0.2645j
    terms = [
        np.exp(rate * path)
        * (NODES / path * slope)
        * point_exitance(medium, radius=radius, source_radius=source_radius, gamma=gamma, shift=rate - medium.sigma_a)
        for rate, slope in zip(rates.tolist(), slopes.tolist(), strict=True)
    ]
    return np.asarray(np.exp(-medium.sigma_a * path) * (2 * np.sum(terms, axis=0) / (1j * NODES)).real)


def _ratios(z: complex, terms: int) -> NumberArray:
    """Ratios ``i_{l+1}/i_l`` of modified spherical Bessel functions, by their continued fraction."""
    ratios, ratio = np.zeros(terms, complex), z / (2 * (terms + MORE_TERMS))
    for order in range(terms + MORE_TERMS, -1, -1):
        ratio = 1 / ((2 * order + 3) / z + ratio)
        if order < terms:
            ratios[order] = ratio
    return ratios
