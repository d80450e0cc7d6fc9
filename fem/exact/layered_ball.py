"""A ball of concentric layers, each of its own medium, with a point source in the outermost.

At each order l the fluence in a layer is ``a i_l(k r) + b k_l(k r)``; phi and ``D dphi/dr`` are continuous between
layers. Let y be the solution that is regular at the centre, ``rho = b k_l/(a i_l)`` the ratio of its decaying to its
growing part, and u and v the logarithmic derivatives of `bessel.WallRates`. Then

    g = r y'/y = (u - v rho)/(1 + rho),   rho(s)/rho(r) = [x (u + v)]_r/[x (u + v)]_s (i_l(k r)/i_l(k s))²

the latter by the Wronskian; at an interface D g is continuous. Green's identity for y and the fluence of a source at r0
gives the following, which for one layer is the series of `tetlux.fem.exact.sphere`:

    M = 1/(4 pi R²) sum_l (2l + 1) P_l(cos gamma) y(r0)/y(R)/(1 + zb g(R)/R)
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from tetlux.fem.exact import checks
from tetlux.fem.exact.numerics.bessel import SPHERICAL, inner_ratios, order_needed, wall_rates
from tetlux.fem.exact.numerics.legendre import legendre_sum
from tetlux.fem.exact.numerics.quadrature import CUTOFF
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError


def point_exitance(
    media: Sequence[Medium], radii: Sequence[float], *, source_radius: float, gamma: npt.ArrayLike
) -> FloatArray:
    """Exitance of a layered ball with an isotropic point source of unit power in its outermost layer.

    Parameters
    ----------
    media : sequence of Medium
        The media of the layers from the core outward, all of one refractive index, each with absorption.
    radii : sequence of float
        The outer radii of the layers, ascending, unit.
    source_radius : float
        Distance of the source from the centre, unit.
    gamma : (...) array_like
        Angle at the centre between the source and the point of the surface, radians.

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)``, W/unit².

    Raises
    ------
    InputError
        If the radii do not ascend, there are not as many radii as media, or the source is not in the outermost layer.
    """
    bounds = [checks.positive_number("radius", radius) for radius in radii]
    if len(bounds) != len(media) or any(a >= b for a, b in pairwise(bounds)):
        raise InputError("give one radius for each medium, ascending from the core outward.")
    inner, radius = ([0.0, *bounds[:-1]])[-1], bounds[-1]
    r0 = checks.number_within("source_radius", source_radius, inner, radius, "outermost layer")
    angle = checks.numbers("gamma", gamma)
    outer = media[-1]
    order = order_needed(outer.sigma_tr * radius, r0 / radius, SPHERICAL, CUTOFF)
    slope, rho, last = np.zeros(order + 1), np.zeros(order + 1), 0.0
    for number, (medium, bound) in enumerate(zip(media, bounds, strict=True)):
        if number > 0:
            slope *= media[number - 1].diffusion / medium.diffusion
            rates = wall_rates(order, np.array([medium.sigma_tr * last]), SPHERICAL)
            growth, decay = rates.growth[:, 0], rates.decay[:, 0]
            rho = (growth - slope) / (decay + slope)
        if number < len(media) - 1:
            slope, _ = _propagate(medium, order, last, bound, rho)
            last = bound
    at_surface, share = _propagate(outer, order, last, radius, rho)
    _, share_at_source = _propagate(outer, order, last, r0, rho)
    fall = inner_ratios(order, outer.sigma_tr * radius, np.array([r0 / radius]), SPHERICAL)[:, 0]
    weights = (2.0 * np.arange(order + 1) + 1.0) * fall * (1.0 + share_at_source) / (1.0 + share)
    weights /= 1.0 + outer.extrapolation_length / radius * at_surface
    sums = legendre_sum(weights, angle.ravel())
    return np.asarray(sums / (4.0 * math.pi * radius**2)).reshape(angle.shape)


def _propagate(medium: Medium, order: int, start: float, end: float, rho: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Propagate rho through a layer from the radius `start` to `end`: ``r y'/y`` and rho there, for each order."""
    k = medium.sigma_tr
    rates = wall_rates(order, np.array([k * end]), SPHERICAL)
    growth, decay = rates.growth[:, 0], rates.decay[:, 0]
    if start == 0.0:
        return growth, np.zeros(order + 1)
    before = wall_rates(order, np.array([k * start]), SPHERICAL)
    ratio = inner_ratios(order, k * end, np.array([start / end]), SPHERICAL)[:, 0]
    with np.errstate(under="ignore"):
        rho = rho * start * (before.growth + before.decay)[:, 0] / (end * (growth + decay)) * ratio**2
    return (growth - decay * rho) / (1.0 + rho), rho
