"""A ball in the diffusion approximation, with the exact (Robin) boundary.

The ball is centred at the origin. All functions return values for unit power, or unit irradiance.
Exitance is ``M = phi/(2A)`` in W/unit². With ``k = sigma_tr``, radius a, ``beta = zb/a``, and the
logarithmic derivatives u and v of `bessel.WallRates` at k a, a point source at radius r0 gives

    M = 1/(4 pi a²) sum_l (2l + 1) P_l(cos gamma) rho_l(r0)/(1 + beta u_l),   rho_l(r) = i_l(k r)/i_l(k a)

which follows from the expansion of ``e^{-k d}/d`` (DLMF 10.60.3) and the boundary ``phi + zb dphi/dr = 0``.
"""

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from tetlux.fem.exact import checks
from tetlux.fem.exact.numerics.ball import chord, residual_weight
from tetlux.fem.exact.numerics.bessel import SPHERICAL, TABLE_SIZE, inner_ratios, order_needed, wall_rates
from tetlux.fem.exact.numerics.legendre import legendre_sum
from tetlux.fem.exact.numerics.quadrature import CUTOFF, graded_rule
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray, freeze

# Above this order, the singular part of the exitance is separated from the series.
DIRECT_ORDERS = 20_000
# Largest order of the series for the fluence.
POINT_ORDERS = 400_000


def point_exitance(medium: Medium, *, radius: float, source_radius: float, gamma: npt.ArrayLike) -> FloatArray:
    """Exitance of a ball with an isotropic point source of unit power.

    Parameters
    ----------
    medium : Medium
        What the ball is made of; ``sigma_a = 0`` is allowed.
    radius : float
        Radius of the ball, unit.
    source_radius : float
        Distance of the source from the centre, from 0 to less than `radius`, unit.
    gamma : (...) array_like
        Angle at the centre between the source and the point of the surface, radians.

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)``, W/unit². The error is about 1e-13 of the largest value on the surface, and about 1e-9 for a
        source less than 1/500 of the radius below the surface; smaller values are rounding errors.

    Raises
    ------
    InputError
        If the radius is not positive, the source not inside, or an angle not finite.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> point_exitance(medium, radius=10.0, source_radius=9.0, gamma=[0.0, 0.5]).round(6).tolist()
    [0.042908, 0.001929]
    """
    a, t = checks.source_in_body(radius, source_radius, "ball")
    angle = checks.numbers("gamma", gamma)
    flat = angle.ravel()
    order = order_needed(medium.sigma_tr * a, t, SPHERICAL, CUTOFF)
    sum_series = _sum_directly if order <= DIRECT_ORDERS else _sum_split
    sums = sum_series(medium, a, t, flat, order)
    return np.asarray(sums / (4.0 * math.pi * a**2)).reshape(angle.shape)


def point_fluence(medium: Medium, *, radius: float, source_radius: float, points: npt.ArrayLike) -> FloatArray:
    """Fluence in a ball with an isotropic point source of unit power at (0, 0, source_radius).

    It is the free field of the source plus the reflection by the surface as a series,

        4 pi D a phi = a e^{-k d}/d + sum_l (2l+1) P_l rho_l(r0) rho_l(r) (beta v_l - 1)/[(1 + beta u_l)(u_l + v_l)]

    Parameters
    ----------
    medium : Medium
        What the ball is made of.
    radius : float
        Radius of the ball, unit.
    source_radius : float
        Distance of the source from the centre, unit.
    points : (n, 3) array_like
        Where to evaluate, in the ball or on its surface, unit.

    Returns
    -------
    (n,) ndarray
        Fluence, W/unit², to about 1e-13 of the largest value on the surface; infinite at the source.

    Raises
    ------
    InputError
        If the source or a point is outside, or the source is less than 1e-4 of the radius below the surface.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> point_fluence(medium, radius=10.0, source_radius=9.0, points=[[0.0, 0.0, 5.0]]).round(6).tolist()
    [0.026082]
    """
    a, t = checks.source_in_body(radius, source_radius, "ball")
    where = checks.points(points) / a
    # A point on the surface may be outside by rounding.
    fraction = np.minimum(checks.numbers("|points|/radius", np.linalg.norm(where, axis=1), high=1 + 1e-12), 1.0)
    x = medium.sigma_tr * a
    order = order_needed(x, t, SPHERICAL, CUTOFF)
    if order > POINT_ORDERS:
        raise checks.too_close_source(t, "ball")
    distance = np.linalg.norm(where - [0.0, 0.0, t], axis=1)
    gamma = np.arctan2(np.hypot(where[:, 0], where[:, 1]), where[:, 2])
    with np.errstate(divide="ignore"):
        field = np.exp(-x * distance) / distance
    rates = wall_rates(order, np.array([x]), SPHERICAL)
    u, v = rates.growth, rates.decay
    beta = medium.extrapolation_length / a
    weight = (2.0 * np.arange(order + 1)[:, None] + 1.0) * (beta * v - 1.0) / ((1.0 + beta * u) * (u + v))
    weight *= inner_ratios(order, x, np.array([t]), SPHERICAL)
    chunk = max(1, TABLE_SIZE // order)
    for start in range(0, fraction.size, chunk):
        part = slice(start, start + chunk)
        field[part] += legendre_sum(weight * inner_ratios(order, x, fraction[part], SPHERICAL), gamma[part])
    return np.asarray(field / (4.0 * math.pi * medium.diffusion * a))


def point_total(medium: Medium, *, radius: float, source_radius: float) -> float:
    """Power that leaves a ball with an isotropic point source of unit power.

    Order 0 of the series: ``i_0(k r0)/[i_0(k a) + zb k i_0'(k a)]``. The rest is absorbed.

    Parameters
    ----------
    medium : Medium
        What the ball is made of.
    radius, source_radius : float
        Radius of the ball, distance of the source from its centre, unit.

    Returns
    -------
    float
        Between 0 and 1, W.

    Raises
    ------
    InputError
        If the radius is not positive or the source not inside.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> round(point_total(medium, radius=10.0, source_radius=9.0), 6)
    0.790333
    """
    a, t = checks.source_in_body(radius, source_radius, "ball")
    x = np.array([medium.sigma_tr * a])
    ratio = inner_ratios(0, x, np.array([t]), SPHERICAL)[0, 0]
    growth = wall_rates(0, x, SPHERICAL).growth[0, 0]
    return float(ratio / (1.0 + medium.extrapolation_length / a * growth))


def _sum_directly(medium: Medium, a: float, t: float, gamma: FloatArray, order: int) -> FloatArray:
    """``4 pi a² M`` by the series."""
    return legendre_sum(_coefficients(medium, a, t, order), gamma)


@lru_cache(maxsize=4)
def _coefficients(medium: Medium, a: float, t: float, order: int) -> FloatArray:
    """Those of the series, which takes most of its time for few points."""
    x = np.array([medium.sigma_tr * a])
    ratio = inner_ratios(order, x, np.array([t]), SPHERICAL)[:, 0]
    growth = wall_rates(order, x, SPHERICAL).growth[:, 0]
    beta = medium.extrapolation_length / a
    return freeze((2.0 * np.arange(order + 1) + 1.0) * ratio / (1.0 + beta * growth))


def _sum_split(medium: Medium, a: float, t: float, gamma: FloatArray, order: int) -> FloatArray:
    """``4 pi a² M`` for a source close below the surface, as a singular part plus a series.

    The singular part is twice the free field of the source, plus the remainder of the series at k = 0 in closed form.
    The coefficients of the series that remains fall like l^-3.
    """
    x = np.array([medium.sigma_tr * a])
    order = min(order, int(max(4000, 40.0 * x[0])))
    l = np.arange(order + 1)  # noqa: E741
    beta = medium.extrapolation_length / a
    distance = chord(np.asarray(1.0 - t), gamma)
    image = 2.0 / beta * np.exp(-x * distance) / distance
    ratio = inner_ratios(order, x, np.array([t]), SPHERICAL)[:, 0]
    residual = (2.0 * l + 1.0) * ratio * residual_weight(order, x, beta)
    residual -= (1.0 - 2.0 / beta) * t**l / (1.0 + beta * l)
    return image + (1.0 - 2.0 / beta) * _static_sum(t, beta, gamma) + legendre_sum(residual, gamma)


def _static_sum(t: float, beta: float, gamma: FloatArray) -> FloatArray:
    """``sum_l t^l P_l(cos gamma)/(1 + beta l)`` by ``1/(1 + beta l) = ∫ e^{-s} e^{-beta l s} ds``, a line of images."""
    nodes, weights = graded_rule()
    s = CUTOFF * nodes[:, None]
    missing = -np.expm1(-beta * s) * t + (1.0 - t)
    return np.asarray((CUTOFF * weights) @ (np.exp(-s) / chord(missing, gamma)))
