"""Parts of the series for a ball: distances, coefficients, and integrals along beams through it."""

import math

import numpy as np

from tetlux.fem.exact.numerics.bessel import SPHERICAL, TABLE_SIZE, inner_ratios, wall_rates
from tetlux.fem.exact.numerics.quadrature import CUTOFF, composite_rule, graded_rule
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray


def residual_weight(order: int, x: FloatArray, beta: float) -> FloatArray:
    """``1/(1 + beta u) - (2/beta)/(u + v)`` without cancellation, for l = 0..order."""
    rates = wall_rates(order, x, SPHERICAL)
    u, v = rates.growth[:, 0], rates.decay[:, 0]
    return np.asarray((beta * (v - u) - 2.0) / (beta * (1.0 + beta * u) * (u + v)))


def chord(missing: FloatArray, gamma: FloatArray) -> FloatArray:
    """Distance from the surface of the unit ball to a point at the radius ``1 - missing``, at the angle gamma."""
    return np.asarray(np.hypot(missing, 2.0 * np.sqrt(1.0 - missing) * np.sin(0.5 * gamma)))


def along_diameter(x: float, extinction: float, gamma: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
    """Integrate over the diameter ``e^{-extinction s}`` times ``rho_l P_l(+-1)``, and times ``e^{-x d}/d``.

    Lengths are in radii, and s is the distance from the entry. Panels shrink towards both ends of the diameter.

    Parameters
    ----------
    x, extinction : float
        ``k a``, and the extinction coefficient of the beam times the radius.
    gamma : (n,) ndarray
        Angles at the centre between the entry and points of the surface, radians; d is the distance from these.
    order : int
        Largest l.

    Returns
    -------
    moments : (order + 1,) ndarray
        With rho_l, and the sign of ``P_l`` on the axis.
    singular : (n,) ndarray
        With ``e^{-x d}/d``.
    """
    nodes, weights = graded_rule(30, 12)
    # Deeper than this, the beam is below the cutoff.
    reach = min(1.0, CUTOFF / extinction)
    missing = np.concatenate([reach * nodes, nodes])
    density = np.concatenate(
        [
            reach * weights * np.exp(-extinction * reach * nodes),
            weights * np.exp(-extinction * (2.0 - nodes)),
        ]
    )
    far = np.repeat([False, True], nodes.size)
    result = np.zeros(order + 1)
    odd = np.arange(order + 1) % 2 == 1
    chunk = max(1, TABLE_SIZE // (order + 1))
    for start in range(0, missing.size, chunk):
        part = slice(start, start + chunk)
        ratio = inner_ratios(order, x, 1.0 - missing[part], SPHERICAL)
        near_side = ratio @ np.where(far[part], 0.0, density[part])
        far_side = ratio @ np.where(far[part], density[part], 0.0)
        result += near_side + np.where(odd, -far_side, far_side)
    angle = np.where(far[:, None], math.pi - gamma, gamma)
    distance = chord(missing[:, None], angle)
    return result, density @ (np.exp(-x * distance) / distance)


def beam_series(medium: Medium, a: float, *, decay: float, volume: float, forward: float, order: int) -> FloatArray:
    """Coefficients c_l of ``4 pi a² M = sum_l c_l P_l(cos gamma)`` in a uniform beam.

    Parameters
    ----------
    medium : Medium
        Of index 1.
    a : float
        Radius of the ball, unit.
    decay, volume, forward : float
        `extinction`, `volume` and `forward` of `tetlux.fem.exact.beam.BeamSource`.
    order : int
        Largest l.

    Returns
    -------
    (order + 1,) ndarray
    """
    x, extinction = medium.sigma_tr * a, decay * a
    # A chord is given by the angle between beam and surface at its entry; panels shrink towards grazing incidence.
    # Along a chord, rho_l P_l changes fastest within 1/l of both ends.
    steps = np.linspace(0.0, 0.5 * math.pi, 25)
    edges = np.concatenate([[0.0], steps[1] * 2.0 ** np.arange(-6, 0, dtype=float), steps[1:]])
    elevation, weight = composite_rule(edges, 14)
    mu, mu_weight = np.sin(elevation), weight * np.cos(elevation)
    s, s_weight = composite_rule(0.5 - 0.5 * np.cos(np.linspace(0.0, math.pi, 25)), 12)
    reach = np.minimum(2.0 * mu, CUTOFF / extinction)
    depth = (reach[:, None] * s).ravel()
    density = ((mu_weight * mu * reach)[:, None] * s_weight).ravel() * np.exp(-extinction * depth)
    cosine = np.repeat(mu, s.size)
    height = cosine - depth
    r = np.sqrt(np.maximum(height**2 + 1.0 - cosine**2, 1e-300))
    inside = _legendre_moments(density, height / r, r, x, order)
    entry = _legendre_moments(mu_weight * mu, mu, np.ones_like(mu), x, order)
    leaving = _legendre_moments(mu_weight * mu * np.exp(-2.0 * extinction * mu), -mu, np.ones_like(mu), x, order)
    growth = wall_rates(order, np.array([x]), SPHERICAL).growth[:, 0]
    beta = medium.extrapolation_length / a
    power = volume * a * inside + forward * (leaving - entry)
    return np.asarray(2.0 * math.pi * a**2 * (2.0 * np.arange(order + 1) + 1.0) * power / (1.0 + beta * growth))


def _legendre_moments(
    density: FloatArray, cosine: FloatArray, fraction: FloatArray, x: float, order: int
) -> FloatArray:
    """``sum_j density_j rho_l(r_j) P_l(cosine_j)`` for l = 0..order."""
    result = np.zeros(order + 1)
    chunk = max(1, TABLE_SIZE // (order + 1))
    for start in range(0, density.size, chunk):
        part = slice(start, start + chunk)
        ratio = inner_ratios(order, x, fraction[part], SPHERICAL) * density[part]
        previous, value = np.zeros_like(cosine[part]), np.ones_like(cosine[part])
        for l in range(order + 1):  # noqa: E741
            result[l] += ratio[l] @ value
            previous, value = value, ((2 * l + 1) * cosine[part] * value - l * previous) / (l + 1)
    return result
