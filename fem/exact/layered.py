"""A plate of several layers in the diffusion approximation, both faces Robin, with a point source.

Layer i has its own coefficients; all have one refractive index, so that fluence and the flux ``-D dphi/dz`` are
continuous between them. In the Hankel transform over the distance from the axis each layer obeys ``phi'' = mu_i² phi``
with ``mu_i² = q² + k_i²``. The ratio of flux to fluence (an admittance) is 1/(2A) at a face, and through a layer of
thickness t it becomes

    Y' = d (Y + d tanh(mu t)) / (d + Y tanh(mu t)),    d = D mu,

as along a transmission line. At the source the fluence is ``1/(Y_up + Y_down)``, and towards a face it falls by
``1/(cosh(mu t) + Y/d sinh(mu t))`` in each layer. The integral back over q is by Gauss-Legendre quadrature.
"""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy import special

from tetlux.fem.exact import checks
from tetlux.fem.exact.numerics.quadrature import CUTOFF, composite_rule
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError

# Panels halve this often towards q = 0.
LEVELS = 30
ORDER = 16


def point_exitance(
    media: Sequence[Medium], thicknesses: Sequence[float], *, depth: float, rho: npt.ArrayLike, face: str = "front"
) -> FloatArray:
    """Exitance at a face of a plate of layers, of an isotropic point source of unit power.

    Parameters
    ----------
    media : sequence of Medium
        Of the layers, from the front (z = 0) to the back, all of one refractive index.
    thicknesses : sequence of float
        Of the layers, unit.
    depth : float
        Depth of the source, unit.
    rho : (...) array_like
        Distance on the face from the axis through the source, unit.
    face : {"front", "back"}

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)``, W/unit², to about 1e-12 of the largest exitance.

    Raises
    ------
    InputError
        If layers and thicknesses do not go together, the source is outside, or a distance negative.
    """
    up, down = _split(media, thicknesses, depth, face)
    distance = checks.numbers("rho", rho, low=0.0)
    far = sum(thickness for _, thickness in up)
    # What gets to the face has faded by exp(-q far) at least.
    most = CUTOFF / far
    count = max(32, math.ceil(most * float(distance.max(initial=0.0)) / math.pi))
    edges = np.union1d(most * 2.0 ** np.arange(-LEVELS, 1.0), np.linspace(0.0, most, count + 1))
    q, weights = composite_rule(edges, ORDER)
    transform = weights * q * _at_face(up, down, q)
    flat = [float(special.j0(q * r) @ transform) for r in distance.ravel()]
    return np.asarray(flat).reshape(distance.shape) / (2.0 * math.pi)


def point_total(media: Sequence[Medium], thicknesses: Sequence[float], *, depth: float, face: str = "front") -> float:
    """Power that leaves through a face: parameters and errors are those of `point_exitance`.

    Returns
    -------
    float
        W.
    """
    up, down = _split(media, thicknesses, depth, face)
    return float(_at_face(up, down, np.zeros(1))[0])


_Layers = list[tuple[Medium, float]]


def _split(media: Sequence[Medium], thicknesses: Sequence[float], depth: float, face: str) -> tuple[_Layers, _Layers]:
    """Layers from the source to the face that is asked for, and from the source to the other one."""
    if face not in ("front", "back"):
        raise InputError(f'face is "{face}"; it is "front" or "back".')
    if len(media) != len(thicknesses) or len(media) == 0:
        raise InputError(f"there are {len(media)} media for {len(thicknesses)} layers; give one for each layer.")
    if len({(medium.eta, medium.boundary) for medium in media}) > 1:
        raise InputError("the layers have different refractive indices or boundaries; give all the same.")
    lengths = [checks.positive("a thickness", thickness) for thickness in thicknesses]
    z0 = checks.within("depth", depth, 0.0, sum(lengths), "plate")
    front: _Layers = []
    back: _Layers = []
    low = 0.0
    for medium, length in zip(media, lengths, strict=True):
        above = min(max(z0 - low, 0.0), length)
        if above > 0:
            front.insert(0, (medium, above))
        if length > above:
            back.append((medium, length - above))
        low += length
    return (front, back) if face == "front" else (back, front)


def _at_face(up: _Layers, down: _Layers, q: FloatArray) -> FloatArray:
    """Transform of the exitance at the face that `up` ends at."""
    escape = 0.5 / up[0][0].boundary_factor
    upward, share = _admittance(up, escape, q)
    downward, _ = _admittance(down, escape, q)
    return escape * share / (upward + downward)


def _admittance(layers: _Layers, escape: float, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Flux over fluence where the source is, and fluence at the face over that at the source."""
    admittance, share = np.full(len(q), escape), np.ones(len(q))
    for medium, thickness in reversed(layers):
        mu = np.hypot(q, medium.sigma_tr)
        # d tanh(mu t) and sinh(mu t)/d have limits at mu = 0.
        safe = np.where(mu > 0, mu, 1.0)
        d, tanh = medium.diffusion * mu, np.tanh(mu * thickness)
        tanh_over_d = np.where(mu > 0, tanh / (medium.diffusion * safe), thickness / medium.diffusion)
        share = share / (np.cosh(np.minimum(mu * thickness, 700.0)) * (1.0 + admittance * tanh_over_d))
        admittance = (admittance + d * tanh) / (1.0 + admittance * tanh_over_d)
    return admittance, share
