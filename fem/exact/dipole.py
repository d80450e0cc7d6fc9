"""The half-space z >= 0 with the extrapolated boundary: a source and its mirror image, the dipole.

Fluence vanishes on the plane z = -zb instead of satisfying the Robin boundary condition at z = 0. This model differs
from `half_space` by a quarter near the source, and agrees with it far away. The factor A in ``zb = 2 A D`` is that of
the medium: ``Medium(..., boundary="classic")`` gives the published curves. Symbols are those of `half_space`.
"""

import math

import numpy as np
import numpy.typing as npt

from tetlux.fem.exact import checks
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray


def fluence(medium: Medium, *, depth: float, points: npt.ArrayLike) -> FloatArray:
    """Fluence of an isotropic point source of unit power at (0, 0, depth), zero on z = -zb.

    ``phi = [e^{-k r1}/r1 - e^{-k r2}/r2]/(4 pi D)``, with the mirror source at ``z = -depth - 2 zb``.

    Parameters
    ----------
    medium : Medium
        What fills the half-space.
    depth : float
        Depth of the source, greater than 0, unit.
    points : (n, 3) array_like
        Where to evaluate, ``z >= -zb``, unit.

    Returns
    -------
    (n,) ndarray
        Fluence, W/unit²; infinite at the source.

    Raises
    ------
    InputError
        If the source is outside, or a point beyond the extrapolated plane.
    """
    z0 = checks.positive_number("depth", depth)
    zb, k = medium.extrapolation_length, medium.sigma_tr
    rho, z = checks.points_in_slab(points, low=-zb)
    r1 = np.hypot(rho, z - z0)
    r2 = np.hypot(rho, z + z0 + 2.0 * zb)
    with np.errstate(divide="ignore"):
        difference = np.exp(-k * r1) / r1 - np.exp(-k * r2) / r2
    return np.asarray(difference / (4.0 * math.pi * medium.diffusion))


def flux(medium: Medium, *, depth: float, rho: npt.ArrayLike) -> FloatArray:
    """Flux ``D dphi/dz`` through the real surface z = 0, above a point source of unit power.

    ``1/(4 pi) sum_i z_i (1 + k d_i) e^{-k d_i}/d_i³`` over the depth ``z_1 = depth`` and the height
    ``z_2 = depth + 2 zb`` (Farrell 1992, eq. 14). With this boundary it differs from phi/(2A).

    Parameters
    ----------
    medium : Medium
        What fills the half-space.
    depth : float
        Depth of the source, greater than 0, unit.
    rho : (...) array_like
        Distance on the surface from the point above the source, unit.

    Returns
    -------
    (...) ndarray
        W/unit².

    Raises
    ------
    InputError
        If the source is outside, or a distance negative.
    """
    z0 = checks.positive_number("depth", depth)
    distance = checks.numbers("rho", rho, low=0.0)
    k = medium.sigma_tr
    total = np.zeros(distance.shape)
    for z in (z0, z0 + 2.0 * medium.extrapolation_length):
        d = np.hypot(distance, z)
        total += z * (1.0 + k * d) * np.exp(-k * d) / d**3
    return total / (4.0 * math.pi)


def reflectance(medium: Medium, *, rho: npt.ArrayLike) -> FloatArray:
    """Diffuse reflectance ``R_d`` around a pencil beam (Farrell 1992; Jensen 2001, eq. 4).

    The `flux` of one point source of power alpha' at the depth 1/sigma_t'.

    Parameters
    ----------
    medium : Medium
        What fills the half-space.
    rho : (...) array_like
        Distance on the surface from the entry, unit.

    Returns
    -------
    (...) ndarray
        For unit power that enters, 1/unit². It holds for an albedo near 1 and rho above a mean free path.

    Raises
    ------
    InputError
        If a distance is negative.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> reflectance(medium, rho=[1.0, 5.0]).round(6).tolist()
    [0.029716, 0.001198]
    """
    return medium.albedo * flux(medium, depth=medium.mean_free_path, rho=rho)


def total_reflectance(medium: Medium) -> float:
    """Integral of `reflectance` over the surface: ``alpha'/2 (e^{-k z_1} + e^{-k z_2})`` (Farrell 1992).

    Parameters
    ----------
    medium : Medium
        What fills the half-space.

    Returns
    -------
    float
        Share of the power that enters, between 0 and 1.
    """
    k, z1 = medium.sigma_tr, medium.mean_free_path
    z2 = z1 + 2.0 * medium.extrapolation_length
    return float(0.5 * medium.albedo * (np.exp(-k * z1) + np.exp(-k * z2)))
