"""Fresnel reflectance at a smooth dielectric boundary, and the boundary factor A that follows from it."""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError


def reflectance(cosine: npt.ArrayLike, eta: float) -> FloatArray:
    """Unpolarised Fresnel reflectance of light inside a medium that meets its boundary.

    Parameters
    ----------
    cosine : (...) array_like
        Cosine of the angle between the direction of light and the boundary's normal, on the incident side.
    eta : float
        Refractive index of the incident side divided by that of the other side. Light that enters
        a medium of index n from air sees ``eta = 1/n``.

    Returns
    -------
    (...) ndarray
        Reflected share of the power, 1 beyond the critical angle.
    """
    mu = np.clip(np.asarray(cosine, dtype=float), 0.0, 1.0)
    if eta == 1.0:
        # Nothing at all: of what rounding would reflect, each crumb would be a ray to follow.
        return np.zeros(mu.shape)
    sine_squared = eta**2 * (1.0 - mu**2)
    mu_other = np.sqrt(np.maximum(1.0 - sine_squared, 0.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        r_s = (eta * mu - mu_other) / (eta * mu + mu_other)
        r_p = (mu - eta * mu_other) / (mu + eta * mu_other)
        value = 0.5 * (r_s**2 + r_p**2)
    return np.asarray(np.where((sine_squared >= 1.0) | ~np.isfinite(value), 1.0, value))


@lru_cache(maxsize=256)
def moments(eta: float) -> tuple[float, float]:
    """First and second angular moments of the internal reflectance.

    ``C1 = ∫0..1 F mu dmu`` and ``C2 = ∫0..1 F mu² dmu`` (d'Eon 2012; Haskell 1994), by Gauss-Legendre
    quadrature on both sides of the critical angle, where F has a square-root kink.
    """
    nodes, weights = np.polynomial.legendre.leggauss(64)
    # mu = mu_c + (1 - mu_c) t², and mu = mu_c for total reflection: the substitution removes the kink.
    critical = np.sqrt(max(1.0 - 1.0 / eta**2, 0.0))
    t, w = 0.5 * (nodes + 1.0), 0.5 * weights
    mu = critical + (1.0 - critical) * t**2
    weight = w * 2.0 * (1.0 - critical) * t * reflectance(mu, eta)
    c1 = critical**2 / 2.0 + float(weight @ mu)
    c2 = critical**3 / 3.0 + float(weight @ mu**2)
    return float(c1), float(c2)


def boundary_factor_exact(eta: float) -> float:
    """A of the partial-current boundary ``E.n = phi/(2A)``: ``(1 + 3 C2)/(1 - 2 C1)`` (Haskell 1994)."""
    c1, c2 = moments(eta)
    return (1.0 + 3.0 * c2) / (1.0 - 2.0 * c1)


def boundary_factor_classic(eta: float) -> float:
    """A as the published dipole has it: ``(1 + F_dr)/(1 - F_dr)`` with Egan's fit (Jensen 2001, sec. 2.1).

    11 % above `boundary_factor_exact` at an index of 1.3; it exists to match published figures.

    Raises
    ------
    InputError
        For an index below 1, where that fit does not hold.
    """
    if eta < 1.0:
        raise InputError(
            f'boundary "classic" is a fit for refractive indices of 1 and more, and eta is {eta:g}; '
            'use boundary "exact".'
        )
    f_dr = -1.440 / eta**2 + 0.710 / eta + 0.668 + 0.0636 * eta
    return (1.0 + f_dr) / (1.0 - f_dr)
