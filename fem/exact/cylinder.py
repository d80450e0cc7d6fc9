"""An infinite cylinder along z in the diffusion approximation, with the exact (Robin) boundary.

The axis is the z axis; sources are at the angle 0. All functions return values for unit power, or for unit power per
unit length of a line. Exitance is ``M = phi/(2A)``. With ``k = sigma_tr``, radius a, ``beta = zb/a``,
``rho_m(r) = I_m(kappa r)/I_m(kappa a)`` and the logarithmic derivatives u, v of `bessel.WallRates` at ``kappa a``, a
point source at radius r0 gives

    M = 1/(2 pi² a) ∫0..inf dq cos(q z) sum_m e_m cos(m theta) rho_m(r0)/(1 + beta u_m),   kappa² = k² + q²

with ``e_0 = 1``, else 2: the Fourier transform of ``e^{-k d}/d`` along z, and the addition theorem of K_0
(Watson 1944, 11.3). A line parallel to the axis is its order q = 0.
"""

import math

import numpy as np
import numpy.typing as npt
from scipy import special

from tetlux.fem.exact import checks
from tetlux.fem.exact.numerics.bessel import CYLINDRICAL, TABLE_SIZE, inner_ratios, order_needed, wall_rates
from tetlux.fem.exact.numerics.cylindrical import cosine_sum, multiplicity, reach, reflection
from tetlux.fem.exact.numerics.quadrature import CUTOFF, composite_rule
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError

# Largest order of a series, and largest number of terms of a double sum.
LINE_ORDERS = 400_000
POINT_TERMS = 200_000_000


def line_exitance(medium: Medium, *, radius: float, source_radius: float, theta: npt.ArrayLike) -> FloatArray:
    """Exitance of a cylinder with a line source parallel to its axis.

    Parameters
    ----------
    medium : Medium
        What the cylinder is made of; ``sigma_a = 0`` is allowed.
    radius : float
        Radius of the cylinder, unit.
    source_radius : float
        Distance of the line from the axis, from 0 to less than `radius`, unit.
    theta : (...) array_like
        Angle at the axis between the line and the point of the surface, radians.

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)`` for 1 W/unit, W/unit², to about 1e-13 of the largest value.

    Raises
    ------
    InputError
        If the radius is not positive, or the line not inside or less than 1e-4 of the radius below the surface.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> line_exitance(medium, radius=5.0, source_radius=4.0, theta=[0.0, 1.0]).round(6).tolist()
    [0.131746, 0.021549]
    """
    a, t = checks.source_in_body(radius, source_radius, "cylinder")
    angle = checks.numbers("theta", theta)
    x = np.array([medium.sigma_tr * a])
    order = _line_order(float(x[0]), t)
    growth = wall_rates(order, x, CYLINDRICAL).growth[:, 0]
    ratio = inner_ratios(order, x, np.array([t]), CYLINDRICAL)[:, 0]
    series = multiplicity(order) * ratio / (1.0 + medium.extrapolation_length / a * growth)
    return (cosine_sum(series[:, None], angle.ravel()) / (2.0 * math.pi * a)).reshape(angle.shape)


def line_fluence(medium: Medium, *, radius: float, source_radius: float, points: npt.ArrayLike) -> FloatArray:
    """Fluence in a cylinder with a line source of 1 W/unit at x = source_radius, y = 0.

    It is the free field of the line, ``K_0(k d)/(2 pi D)``, plus the reflection by the surface as a series.

    Parameters
    ----------
    medium : Medium
        What the cylinder is made of.
    radius, source_radius : float
        Radius of the cylinder, distance of the line from the axis, unit.
    points : (n, 3) array_like
        Where to evaluate, in the cylinder or on its surface, unit; z does not matter.

    Returns
    -------
    (n,) ndarray
        W/unit², to about 1e-13 of the largest value on the surface; infinite on the line.

    Raises
    ------
    InputError
        If the radius is not positive, a point outside, or the line not inside or less than 1e-4 of the radius below the
        surface.
    """
    a, t = checks.source_in_body(radius, source_radius, "cylinder")
    fraction, theta, distance, _ = _places(points, a, t)
    x = medium.sigma_tr * a
    order = _line_order(x, t)
    weight = reflection(medium.extrapolation_length / a, np.array([x]), order)
    if x == 0.0:
        # Order 0 has its logarithm in the free field: K_0(x d) + order 0 -> log(1/d) + beta.
        weight[0] = medium.extrapolation_length / a
    weight *= inner_ratios(order, x, np.array([t]), CYLINDRICAL)
    with np.errstate(divide="ignore"):
        field = -np.log(distance) if x == 0.0 else special.k0(x * distance)
    chunk = max(1, TABLE_SIZE // (order + 1))
    for start in range(0, fraction.size, chunk):
        part = slice(start, start + chunk)
        series = weight * inner_ratios(order, x, fraction[part], CYLINDRICAL)
        field[part] += cosine_sum(series, theta[part])
    return np.asarray(field / (2.0 * math.pi * medium.diffusion))


def line_total(medium: Medium, *, radius: float, source_radius: float) -> float:
    """Power that leaves a cylinder, of 1 W from a point source or from a unit length of a line source.

    ``I_0(k r0)/[I_0(k a) + zb k I_1(k a)]``. The rest is absorbed.

    Parameters
    ----------
    medium : Medium
        What the cylinder is made of.
    radius, source_radius : float
        Radius of the cylinder, distance of the source from the axis, unit.

    Returns
    -------
    float
        Between 0 and 1, W.

    Raises
    ------
    InputError
        If the radius is not positive or the source not inside.
    """
    a, t = checks.source_in_body(radius, source_radius, "cylinder")
    x = np.array([medium.sigma_tr * a])
    growth = wall_rates(0, x, CYLINDRICAL).growth[0, 0]
    ratio = inner_ratios(0, x, np.array([t]), CYLINDRICAL)[0, 0]
    return float(ratio / (1.0 + medium.extrapolation_length / a * growth))


def point_exitance(
    medium: Medium, *, radius: float, source_radius: float, theta: npt.ArrayLike, z: npt.ArrayLike
) -> FloatArray:
    """Exitance of a cylinder with an isotropic point source of unit power at z = 0.

    The integral over q is computed by the trapezoidal rule, which converges exponentially: its sum is the field of a
    row of sources, so far apart that their fields do not overlap.

    Parameters
    ----------
    medium : Medium
        What the cylinder is made of; ``sigma_a = 0`` is allowed.
    radius : float
        Radius of the cylinder, unit.
    source_radius : float
        Distance of the source from the axis, from 0 to less than `radius`, unit.
    theta, z : (...) array_like
        Angle at the axis from the source, radians, and distance from the source along the axis, unit; their shapes
        must broadcast.

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)``, W/unit², to about 1e-13 of the largest value.

    Raises
    ------
    InputError
        If the radius is not positive, or the source is not inside, or closer to the surface than about 1/500 of the
        radius, where the sum is too long.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> point_exitance(medium, radius=5.0, source_radius=4.0, theta=0.0, z=[0.0, 5.0]).round(6).tolist()
    [0.042886, 0.001306]
    """
    a, t = checks.source_in_body(radius, source_radius, "cylinder")
    angle, height = np.broadcast_arrays(checks.numbers("theta", theta), checks.numbers("z", z))
    angles, heights = angle.ravel(), height.ravel()
    k, beta = medium.sigma_tr, medium.extrapolation_length / a
    order = _line_order(k * a, t)
    # The slowest decay along z, from a lower bound of the first root of ``beta y J_1(y) = J_0(y)``.
    slowest = math.hypot(k, math.sqrt(4.0 / (1.0 + 2.0 * beta)) / a)
    period = 2.0 * float(np.max(np.abs(heights), initial=0.0)) + CUTOFF / slowest
    step = 2.0 * math.pi / period
    count = int(reach(k, a, t) / step) + 2
    if order * count > POINT_TERMS:
        raise InputError(
            f"source_radius {source_radius:g} with z up to {np.max(np.abs(heights)):g} needs too long a sum; use "
            "half_space for a source close below the surface, or a smaller z."
        )
    waves = np.cos(np.outer(angles, np.arange(order + 1))) * multiplicity(order)
    total = np.zeros(angles.size)
    chunk = max(1, TABLE_SIZE // (order + 1))
    for start in range(0, count, chunk):
        q = step * np.arange(start, min(start + chunk, count))
        x = a * np.hypot(k, q)
        growth = wall_rates(order, x, CYLINDRICAL).growth
        ratio = inner_ratios(order, x, np.full(x.shape, t), CYLINDRICAL)
        along = np.cos(np.outer(heights, q)) * np.where(q == 0.0, 0.5 * step, step)
        total += np.sum(waves @ (ratio / (1.0 + beta * growth)) * along, axis=1)
    return np.asarray(total / (2.0 * math.pi**2 * a)).reshape(angle.shape)


def point_fluence(medium: Medium, *, radius: float, source_radius: float, points: npt.ArrayLike) -> FloatArray:
    """Fluence in a cylinder with an isotropic point source of unit power at (source_radius, 0, 0).

    It is the free field of the source plus the reflection by the surface, an integral over a series.

    Parameters
    ----------
    medium : Medium
        What the cylinder is made of.
    radius, source_radius : float
        Radius of the cylinder, distance of the source from the axis, unit.
    points : (n, 3) array_like
        Where to evaluate, in the cylinder or on its surface, unit. Slow for many points, since each needs a table.

    Returns
    -------
    (n,) ndarray
        W/unit², to about 1e-12 of the largest value on the surface; infinite at the source.

    Raises
    ------
    InputError
        If the radius is not positive, a point outside, or the source not inside or too close below the surface for the
        series.
    """
    a, t = checks.source_in_body(radius, source_radius, "cylinder")
    fraction, theta, distance, z = _places(points, a, t)
    x = medium.sigma_tr * a
    order = _line_order(x, t)
    largest = reach(medium.sigma_tr, a, t) * a
    # Panels shrink towards q = 0, where order 0 is logarithmic, and resolve the oscillation along z.
    panels = max(8, int(np.max(np.abs(z), initial=0.0) * largest / 8.0) + 1)
    first = largest / panels
    edges = np.concatenate([[0.0], first * 2.0 ** np.arange(-36, 0, dtype=float), first * np.arange(1, panels + 1)])
    q, weights = composite_rule(edges, 12)
    if order * q.size > TABLE_SIZE * 10:
        raise checks.too_close_source(t, "cylinder")
    wall = np.hypot(x, q)
    weight = reflection(medium.extrapolation_length / a, wall, order)
    weight *= inner_ratios(order, wall, np.full(wall.shape, t), CYLINDRICAL)
    with np.errstate(divide="ignore"):
        total = np.exp(-x * np.hypot(distance, z)) / np.hypot(distance, z)
    for i in range(total.size):
        series = weight * inner_ratios(order, wall, np.full(wall.shape, fraction[i]), CYLINDRICAL)
        around = np.cos(np.arange(order + 1) * theta[i]) @ series
        total[i] += 2.0 / math.pi * float((weights * np.cos(q * z[i])) @ around)
    return np.asarray(total / (4.0 * math.pi * medium.diffusion * a))


def _line_order(x: float, t: float) -> int:
    """The order at which the series is truncated; an error if it is too large."""
    order = order_needed(x, t, CYLINDRICAL, CUTOFF)
    if order > LINE_ORDERS:
        raise checks.too_close_source(t, "cylinder")
    return order


def _places(points: npt.ArrayLike, a: float, t: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Distance from the axis, angle, distance from the line through the source, and z of points; lengths in radii."""
    where = checks.points(points) / a
    fraction = checks.numbers("|(x, y)|/radius of points", np.hypot(where[:, 0], where[:, 1]), high=1.0 + 1e-12)
    theta = np.arctan2(where[:, 1], where[:, 0])
    return np.minimum(fraction, 1.0), theta, np.hypot(where[:, 0] - t, where[:, 1]), where[:, 2]
