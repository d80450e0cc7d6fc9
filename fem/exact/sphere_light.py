"""A ball in light from outside (a pencil beam, a wide beam, diffuse light), and a ball that emits.

The notation is that of `sphere`. A beam is given by its source densities, `beam.BeamSource`.
"""

import math

import numpy as np
import numpy.typing as npt

from tetlux.fem.exact import checks
from tetlux.fem.exact.beam import Source, beam_source
from tetlux.fem.exact.numerics.ball import along_diameter, beam_series, chord, residual_weight
from tetlux.fem.exact.numerics.bessel import SPHERICAL, inner_ratios, wall_rates
from tetlux.fem.exact.numerics.legendre import legendre_sum
from tetlux.fem.exact.numerics.quadrature import CUTOFF, convolve_decays, graded_rule
from tetlux.fem.media.fresnel import moments
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError

# Orders of the series for a wide beam, see `beam_exitance` for the error.
BEAM_ORDERS = 200


def pencil_exitance(
    medium: Medium, *, radius: float, gamma: npt.ArrayLike, source: Source = "delta-eddington"
) -> FloatArray:
    """Exitance of a ball that a pencil beam of no width crosses through the centre.

    It is `sphere.point_exitance` integrated along the diameter from the entry at gamma = 0. The term of the first
    moment is integrated by parts, and the singular parts at both ends are separated as for a point: twice the free
    field, and the series at k = 0. The coefficients that remain fall like l^-3.

    Parameters
    ----------
    medium : Medium
        What the ball is made of.
    radius : float
        Radius of the ball, unit.
    gamma : (...) array_like
        Angle at the centre from the entry, greater than 0 and less than pi, radians. M is singular at both ends of the
        diameter, see `half_space.pencil_exitance`.
    source : {"delta-eddington", "similarity"}
        How the beam scatters, see `beam.beam_source`.

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)`` for unit power that enters, W/unit², to about 1e-8 of M at one mean free path from the entry.

    Raises
    ------
    InputError
        If the radius is not positive, or an angle not between 0 and pi.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> pencil_exitance(medium, radius=10.0, gamma=[0.1, 1.0]).round(6).tolist()
    [0.02648, 0.000308]
    """
    a = checks.positive_number("radius", radius)
    tiny = np.finfo(float).tiny
    angle = checks.numbers("gamma", gamma, low=tiny, high=float(np.nextafter(math.pi, 0.0)))
    flat = angle.ravel()
    beam = beam_source(medium, source)
    x, beta = medium.sigma_tr * a, medium.extrapolation_length / a
    extinction = beam.extinction * a
    order = int(max(1500, 10.0 * x, 5.0 * extinction))
    l = np.arange(order + 1)  # noqa: E741
    static = 1.0 - 2.0 / beta
    weight = (2.0 * l + 1.0) * residual_weight(order, np.array([x]), beta)

    along, singular = along_diameter(x, extinction, flat, order)
    # At k = 0, with e^{-l s} for (1 - s)^l: ``sum_l P_l/[(1 + beta l)(l + extinction)]``.
    nodes, weights = graded_rule()
    reach = CUTOFF * max(beta, 1.0 / extinction)
    s = reach * nodes
    images = 1.0 / chord(-np.expm1(-s[:, None]), flat)
    line = (reach * weights * convolve_decays(s, 1.0 / beta, extinction) / beta) @ images
    residual = weight * along - static / ((1.0 + beta * l) * (l + extinction))
    total = beam.volume * a * (2.0 / beta * singular + static * line + legendre_sum(residual, flat))

    # The terms at both ends are sources on the surface.
    s = CUTOFF * beta * nodes
    residual = weight - static / (1.0 + beta * l)
    for end, share in ((flat, -1.0), (math.pi - flat, math.exp(-2.0 * extinction))):
        distance = 2.0 * np.sin(0.5 * end)
        point = 2.0 / beta * np.exp(-x * distance) / distance + legendre_sum(residual, end)
        images = 1.0 / chord(-np.expm1(-s[:, None]), end)
        point += static * (CUTOFF * weights * np.exp(-s / beta)) @ images
        total += beam.forward * share * point
    return np.asarray(total / (4.0 * math.pi * a**2)).reshape(angle.shape)


def pencil_total(medium: Medium, *, radius: float, source: Source = "delta-eddington") -> float:
    """Power that leaves a ball in a pencil beam through its centre, without the ballistic share ``e^{-2 sigma a}``.

    It is `pencil_exitance` integrated over the surface.

    Parameters
    ----------
    medium : Medium
        What the ball is made of.
    radius : float
        Radius of the ball, unit.
    source : {"delta-eddington", "similarity"}
        How the beam scatters, see `beam.beam_source`.

    Returns
    -------
    float
        Share of the power that enters, between 0 and 1.

    Raises
    ------
    InputError
        If the radius is not positive.
    """
    a = checks.positive_number("radius", radius)
    beam = beam_source(medium, source)
    x = medium.sigma_tr * a
    extinction = beam.extinction * a
    along, _ = along_diameter(x, extinction, np.empty(0), 0)
    growth = wall_rates(0, np.array([x]), SPHERICAL).growth[0, 0]
    ends = beam.forward * math.expm1(-2.0 * extinction)
    return float((beam.volume * a * along[0] + ends) / (1.0 + medium.extrapolation_length / a * growth))


def beam_exitance(
    medium: Medium, *, radius: float, gamma: npt.ArrayLike, source: Source = "delta-eddington"
) -> FloatArray:
    """Exitance of a ball in a uniform collimated beam of unit irradiance, at matched indices.

    It is the series of `sphere` integrated over the source densities along all chords.

    Parameters
    ----------
    medium : Medium
        What the ball is made of; its index must be 1, since refraction would focus the beam.
    radius : float
        Radius of the ball, unit.
    gamma : (...) array_like
        Angle at the centre from the point that the beam meets first, radians.
    source : {"delta-eddington", "similarity"}
        How the beam scatters, see `beam.beam_source`.

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)``, W/unit² for 1 W/unit². The series ends at order 200, with a relative error of about 1e-6 for a
        radius of ten mean free paths, 1e-5 with a first moment, and 1e-3 for hundreds of mean free paths.

    Raises
    ------
    InputError
        If the radius is not positive, an angle not finite, or the medium's index not 1.
    """
    angle = checks.numbers("gamma", gamma)
    a = checks.positive_number("radius", radius)
    series = _beam_series(medium, a, source, BEAM_ORDERS)
    return np.asarray(legendre_sum(series, angle.ravel()) / (4.0 * math.pi * a**2)).reshape(angle.shape)


def beam_total(medium: Medium, *, radius: float, source: Source = "delta-eddington") -> float:
    """Power that leaves a ball in a uniform beam, of the incident power pi a², without the ballistic share.

    It is `beam_exitance` integrated over the surface.

    Parameters
    ----------
    medium : Medium
        What the ball is made of; its index must be 1.
    radius : float
        Radius of the ball, unit.
    source : {"delta-eddington", "similarity"}
        How the beam scatters, see `beam.beam_source`.

    Returns
    -------
    float
        W for 1 W/unit².

    Raises
    ------
    InputError
        If the radius is not positive, or the medium's index not 1.
    """
    a = checks.positive_number("radius", radius)
    return float(_beam_series(medium, a, source, 0)[0])


def diffuse_fluence(medium: Medium, *, radius: float, distance: npt.ArrayLike) -> FloatArray:
    """Fluence in a ball in uniform diffuse light of unit transmitted irradiance.

    ``phi = C i_0(k r)``, with the constant C from ``phi + 2 A D dphi/dr = 4/(1 - 2 C1)`` at the surface. C1 is the
    first moment of the internal reflectance by Fresnel's law, also if the medium computes A by the classic fit.

    Parameters
    ----------
    medium : Medium
        What the ball is made of.
    radius : float
        Radius of the ball, unit.
    distance : (...) array_like
        Distance from the centre, from 0 to `radius`, unit.

    Returns
    -------
    (...) ndarray
        W/unit² for 1 W/unit² that enters the ball.

    Raises
    ------
    InputError
        If the radius is not positive, or a distance outside the ball.
    """
    a = checks.positive_number("radius", radius)
    r = checks.numbers("distance", distance, low=0.0, high=a)
    x = np.array(medium.sigma_tr * a)
    denominator = 1.0 + medium.extrapolation_length / a * wall_rates(0, x, SPHERICAL).growth[0]
    ratio = inner_ratios(0, x, r / a, SPHERICAL)[0]
    return np.asarray(4.0 / (1.0 - 2.0 * moments(medium.eta)[0]) * ratio / denominator)


def diffuse_exitance(medium: Medium, *, radius: float) -> float:
    """Flux that leaves a ball in uniform diffuse light of unit transmitted irradiance, ``M = 1 - D dphi/dr``.

    Parameters
    ----------
    medium : Medium
        What the ball is made of.
    radius : float
        Radius of the ball, unit.

    Returns
    -------
    float
        W/unit² for 1 W/unit² that enters the ball; 1 without absorption.

    Raises
    ------
    InputError
        If the radius is not positive.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> round(diffuse_exitance(medium, radius=10.0), 6)
    0.795337
    """
    a = checks.positive_number("radius", radius)
    growth = wall_rates(0, np.array(medium.sigma_tr * a), SPHERICAL).growth[0]
    surface = diffuse_fluence(medium, radius=a, distance=a)
    return float(1.0 - medium.diffusion / a * growth * surface)


def glow_exitance(medium: Medium, *, radius: float) -> float:
    """Exitance ``M = phi/(2A)`` of a ball that emits 1 W/unit³ uniformly.

    ``phi = (1 - C i_0(k r)/i_0(k a))/sigma_a`` with ``phi + zb dphi/dr = 0`` at the surface, so that
    ``2 A M = q/((1 + q) sigma_a)`` with ``q = zb (k coth(k a) - 1/a)``; without absorption ``M = a/3``.

    Parameters
    ----------
    medium : Medium
        What the ball is made of.
    radius : float
        Radius a of the ball, unit.

    Returns
    -------
    float
        W/unit² for 1 W/unit³.

    Raises
    ------
    InputError
        If the radius is not positive.
    """
    a = checks.positive_number("radius", radius)
    x = medium.sigma_tr * a
    if x < 1e-3:
        # k coth(k a) - 1/a = k² a/3 (1 - (k a)²/15 + ...).
        q = medium.extrapolation_length * x**2 / (3.0 * a)
        return a / 3.0 * (1.0 - x**2 / 15.0) / (1.0 + q)
    q = medium.extrapolation_length * (x / math.tanh(x) - 1.0) / a
    return q / ((1.0 + q) * medium.sigma_a * 2.0 * medium.boundary_factor)


def _beam_series(medium: Medium, a: float, source: Source, order: int) -> FloatArray:
    if medium.eta != 1.0:
        raise InputError(f"eta is {medium.eta:g}; the closed form for a ball in a beam needs eta 1.", field="eta")
    beam = beam_source(medium, source)
    return beam_series(medium, a, decay=beam.extinction, volume=beam.volume, forward=beam.forward, order=order)
