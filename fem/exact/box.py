"""The box in the diffusion approximation, with a point source, all faces Robin.

The fluence is a sum over products of modes ``cos(q x - delta)`` along two edges; along the third, each product decays
from the source as in a slab. A mode fits between two Robin planes L apart if ``tan delta = 1/(q zb)`` and
``q L = m pi + 2 delta``, m = 0, 1, ... With ``k² = sigma_tr² + q1² + q2²`` and ``r = (1 - k zb)/(1 + k zb)`` the decay
from x to x', x < x', is

    exp(-k (x' - x))/(2 D k) (1 - r exp(-2 k x)) (1 - r exp(-2 k (L - x')))/(1 - r² exp(-2 k L))

The third edge is the one along which the point is farthest from the source, where the fewest modes are needed and their
sum cancels least.
"""

import math

import numpy as np
import numpy.typing as npt

from tetlux.fem.exact import checks
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.errors import InputError

# Modes that decay to less than this share on their way from the source to a point are left out.
CUTOFF = 1e-16
# Newton steps for the wave numbers, which converge quadratically from above.
NEWTON_STEPS = 12
# Most modes along one edge.
MOST_MODES = 6000


def point_fluence(medium: Medium, *, size: Vector, source: Vector, points: npt.ArrayLike) -> FloatArray:
    """Fluence in a box with an isotropic point source of unit power.

    Parameters
    ----------
    medium : Medium
        What the box is made of; ``sigma_a = 0`` is allowed.
    size : (3,) floats
        Lengths of the edges, unit.
    source : (3,) floats
        Position of the source, where the box lies around the origin, unit.
    points : (n, 3) array_like
        Points in the box or on its faces, unit.

    Returns
    -------
    (n,) ndarray
        Fluence, W/unit², to about 1e-9 of itself.

    Raises
    ------
    InputError
        If a length is not positive, the source or a point is outside, or a point so close to the source that the sum is
        too long.

    Examples
    --------
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> point_fluence(tissue, size=(10, 10, 10), source=(0, 0, 4), points=[[0, 0, 5], [0, 0, -5]]).round(6).tolist()
    [0.246234, 0.002707]
    """
    edges = np.array([checks.positive_number("size", length) for length in size])
    half = 0.5 * edges
    x0 = np.array([checks.number_within("source", s, -h, h, "box") for s, h in zip(source, half, strict=True)]) + half
    places = checks.points(points) + half
    if np.any((places < -1e-9 * edges) | (places > (1.0 + 1e-9) * edges)):
        raise InputError("points holds one outside the box; give points in it or on its faces.", field="points")
    return np.array([_at_point(medium, edges, x0, place) for place in places])


def point_exitance(medium: Medium, *, size: Vector, source: Vector, points: npt.ArrayLike) -> FloatArray:
    """Exitance ``M = phi/(2A)`` at points (n, 3) of the faces, (n,), W/unit²: see `point_fluence`."""
    return point_fluence(medium, size=size, source=source, points=points) / (2.0 * medium.boundary_factor)


def _at_point(medium: Medium, edges: FloatArray, source: FloatArray, place: FloatArray) -> float:
    third = int(np.abs(place - source).argmax())
    away, length = float(np.abs(place - source)[third]), float(edges[third])
    waves, values = [], []
    for other in range(3):
        if other != third:
            wave, phase, square = _modes(medium, float(edges[other]), away)
            waves.append(wave)
            values.append(np.cos(place[other] * wave - phase) * np.cos(source[other] * wave - phase) / square)
    k = np.hypot(medium.sigma_tr, np.hypot(waves[0][:, None], waves[1]))
    below = min(place[third], source[third])
    above = length - max(place[third], source[third])
    zb = medium.extrapolation_length
    with np.errstate(under="ignore"):
        r = (1.0 - k * zb) / (1.0 + k * zb)
        echoes = (1.0 - r * np.exp(-2.0 * k * below)) * (1.0 - r * np.exp(-2.0 * k * above))
        decay = np.exp(-k * away) / (2.0 * medium.diffusion * k) * echoes / (1.0 - r**2 * np.exp(-2.0 * k * length))
    return float(values[0] @ decay @ values[1])


def _modes(medium: Medium, length: float, away: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Wave numbers (m,) along an edge, their phases, and the integrals of their squares."""
    reach = -math.log(CUTOFF) * length / math.pi
    if reach > MOST_MODES * away:
        raise InputError(
            f"a point is only {away:.1g} from the source, too close for the series of the box; use half_space for it.",
            field="points",
        )
    zb, order = medium.extrapolation_length, np.arange(2 + math.ceil(reach / away), dtype=np.float64)
    wave = (order + 1.0) * math.pi / length
    for _ in range(NEWTON_STEPS):
        excess = wave * length - order * math.pi - 2.0 * np.arctan2(1.0, wave * zb)
        wave = np.asarray(wave - excess / (length + 2.0 * zb / (1.0 + (wave * zb) ** 2)))
    phase = np.asarray(np.arctan2(1.0, wave * zb))
    return wave, phase, np.asarray(0.5 * length + 0.5 * np.sin(2.0 * phase) / wave)
