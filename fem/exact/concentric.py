"""A ball with a core of another medium around its centre: in diffuse light, or with a core that glows.

In both parts the fluence depends on r alone, so that ``f = r phi`` obeys ``f'' = k² f``; phi and ``D dphi/dr`` are
continuous at the core, and ``phi + zb dphi/dr`` is given at the surface. Each solution is integrated in the
direction in which it grows, so that no digits are lost at any contrast.
"""

import math

from tetlux.fem.exact import checks
from tetlux.fem.media.fresnel import moments
from tetlux.fem.media.medium import Medium


def diffuse_exitance(core: Medium, shell: Medium, *, core_radius: float, radius: float) -> float:
    """Flux that leaves the ball in unit diffuse irradiance (transmitted), ``M = 1 - D dphi/dr``.

    Parameters
    ----------
    core, shell : Medium
        Of one refractive index.
    core_radius, radius : float
        Unit.

    Returns
    -------
    float
        W/unit² for 1 W/unit² that passes into the ball.

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
    b = checks.positive("radius", radius)
    a = checks.within("core_radius", core_radius, 0.0, b, "ball")
    # At the core f = a, for a fluence of 1 there.
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
    b = checks.positive("radius", radius)
    a = checks.within("core_radius", core_radius, 0.0, b, "ball")
    # From the surface, where the fluence is 1, inward: f = b, and -f' = b/zb - 1.
    k, zb = shell.sigma_tr, shell.extrapolation_length
    value, slope = _integrate(k, b - a, b, b / zb - 1.0)
    decay = slope / value + 1.0 / a
    # What the core emits less what it absorbs passes its surface: phi = Q0/sigma_a (1 - c i_0(k r)).
    x = core.sigma_tr
    emitted = a / 3.0 if x == 0 else _growth(x, a) / x**2
    conducted = core.diffusion * _growth(x, a) + shell.diffusion * decay
    at_core = emitted / conducted
    # The same solution, as phi at the surface over phi at the core; `value` is scaled by e^{-k (b - a)}.
    return at_core * a / value * math.exp(-k * (b - a)) / (2.0 * shell.boundary_factor)


def _growth(k: float, r: float) -> float:
    """``phi'/phi`` of ``sinh(k r)/r``."""
    x = k * r
    if x < 0.01:
        return k * x * (1.0 / 3.0 - x**2 / 45.0)
    return k / math.tanh(x) - 1.0 / r


def _integrate(k: float, length: float, value: float, slope: float) -> tuple[float, float]:
    """Integrate f and f' over a length from their values at its start; both times ``e^{-k length}``."""
    x = k * length
    fall = math.exp(-2.0 * x)
    cosh, sinh = 0.5 * (1.0 + fall), 0.5 * (1.0 - fall)
    over_k = length * math.exp(-x) if x < 1e-8 else sinh / k
    return value * cosh + slope * over_k, value * k * sinh + slope * cosh
