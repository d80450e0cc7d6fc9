"""A ball with a concentric core of another medium: in diffuse light, or with a core that emits.

In core and shell the fluence depends only on r, so that ``f = r phi`` satisfies ``f'' = k² f``; phi and ``D dphi/dr``
are continuous at the core, and ``phi + zb dphi/dr`` is given at the surface. Each solution is integrated in the
direction in which it grows, so that no digits are lost at any contrast.
"""

import math

from tetlux.fem.exact import checks
from tetlux.fem.media.fresnel import moments
from tetlux.fem.media.medium import Medium


def diffuse_exitance(core: Medium, shell: Medium, *, core_radius: float, radius: float) -> float:
    """Flux that leaves the ball in uniform diffuse light of unit transmitted irradiance, ``M = 1 - D dphi/dr``.

    Parameters
    ----------
    core, shell : Medium
        Of one refractive index.
    core_radius, radius : float
        Unit.

    Returns
    -------
    float
        W/unit² for 1 W/unit² that enters the ball.

    Raises
    ------
    InputError
        If a radius is not positive, or the core not inside.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> core = Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4)
    >>> round(diffuse_exitance(core, medium, core_radius=5.0, radius=10.0), 6)
    0.748327
    """
    a, b = checks.core_in_ball(core_radius, radius)
    # At the surface of the core f = a, for a fluence of 1.
    growth = core.diffusion / shell.diffusion * _growth(core.sigma_tr, a)
    value, slope = _integrate(shell.sigma_tr, b - a, a, 1.0 + a * growth)
    growth = slope / value - 1.0 / b
    fluence = 4.0 / (1.0 - 2.0 * moments(shell.eta)[0]) / (1.0 + shell.extrapolation_length * growth)
    return 1.0 - shell.diffusion * growth * fluence


def glow_exitance(core: Medium, shell: Medium, *, core_radius: float, radius: float) -> float:
    """Exitance ``M = phi/(2A)`` of the ball if its core emits 1 W/unit³.

    Parameters
    ----------
    core, shell : Medium
        Of one refractive index; ``sigma_a = 0`` is allowed in both.
    core_radius, radius : float
        Unit.

    Returns
    -------
    float
        W/unit² for 1 W/unit³.

    Raises
    ------
    InputError
        If a radius is not positive, or the core not inside.
    """
    a, b = checks.core_in_ball(core_radius, radius)
    # Inward from the surface, for a fluence of 1: f = b, and -f' = b/zb - 1.
    k, zb = shell.sigma_tr, shell.extrapolation_length
    value, slope = _integrate(k, b - a, b, b / zb - 1.0)
    decay = slope / value + 1.0 / a
    # The flux out of the core is emission minus absorption, with phi = Q0/sigma_a (1 - c i_0(k r)).
    k_core = core.sigma_tr
    emission = a / 3.0 if k_core == 0 else _growth(k_core, a) / k_core**2
    at_core = emission / (core.diffusion * _growth(k_core, a) + shell.diffusion * decay)
    # The fluence at the surface is a/f(a) times that at the core; `value` is f(a) e^{-k (b - a)}.
    return at_core * a / value * math.exp(-k * (b - a)) / (2.0 * shell.boundary_factor)


def _growth(k: float, r: float) -> float:
    """``phi'/phi`` of ``sinh(k r)/r``."""
    x = k * r
    if x < 0.01:
        return k * x * (1.0 / 3.0 - x**2 / 45.0)
    return k / math.tanh(x) - 1.0 / r


def _integrate(k: float, length: float, value: float, slope: float) -> tuple[float, float]:
    """Integrate ``f'' = k² f`` over a length, from f and f' at its start to both at its end times ``e^{-k length}``."""
    x = k * length
    fall = math.exp(-2.0 * x)
    cosh, sinh = 0.5 * (1.0 + fall), 0.5 * (1.0 - fall)
    over_k = length * math.exp(-x) if x < 1e-8 else sinh / k
    return value * cosh + slope * over_k, value * k * sinh + slope * cosh
