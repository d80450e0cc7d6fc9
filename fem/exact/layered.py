"""A slab of several layers in the diffusion approximation, both faces Robin, with a point source.

Layer i has its own coefficients; all have one refractive index, so that fluence and the flux ``-D dphi/dz`` are
continuous between them. In each layer, the Hankel transform over the distance from the axis satisfies
``phi'' = mu_i² phi`` with ``mu_i² = q² + k_i²``. The ratio of flux to fluence, an admittance, is 1/(2A) at a face, and
through a layer of thickness t it becomes

    Y' = d (Y + d tanh(mu t)) / (d + Y tanh(mu t)),    d = D mu,

as along a transmission line. At the source the fluence is ``1/(Y_up + Y_down)``, and towards a face it falls by
``1/(cosh(mu t) + Y/d sinh(mu t))`` in each layer. The inverse transform is computed by Gauss-Legendre quadrature.
"""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy import special

from tetlux.fem.exact import checks
from tetlux.fem.exact.checks import Face
from tetlux.fem.exact.numerics.quadrature import CUTOFF, composite_rule
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError

# Panels that halve towards q = 0, and quadrature points of each.
LEVELS = 30
PANEL_ORDER = 16


def point_exitance(
    media: Sequence[Medium], thicknesses: Sequence[float], *, depth: float, rho: npt.ArrayLike, face: Face = "front"
) -> FloatArray:
    """Exitance at a face of a layered slab for an isotropic point source of unit power.

    Parameters
    ----------
    media : sequence of Medium
        The media of the layers from the front (z = 0) to the back, all of one refractive index.
    thicknesses : sequence of float
        The thicknesses of the layers, unit.
    depth : float
        Depth of the source, unit.
    rho : (...) array_like
        Distance on the face from the axis through the source, unit.
    face : {"front", "back"}
        The face z = 0, or the other face.

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)``, W/unit², to about 1e-12 of the largest exitance.

    Raises
    ------
    InputError
        If there are not as many media as thicknesses, or the media differ in index or boundary; or if the source is
        outside, a distance negative, or the face unknown.
    """
    up, down = _split_at_source(media, thicknesses, depth, face)
    distance = checks.numbers("rho", rho, low=0.0)
    far = sum(thickness for _, thickness in up)
    # The transform at the face falls at least like exp(-q far).
    largest = CUTOFF / far
    count = max(32, math.ceil(largest * float(distance.max(initial=0.0)) / math.pi))
    edges = np.union1d(largest * 2.0 ** np.arange(-LEVELS, 1.0), np.linspace(0.0, largest, count + 1))
    q, weights = composite_rule(edges, PANEL_ORDER)
    transform = weights * q * _at_face(up, down, q)
    flat = [float(special.j0(q * r) @ transform) for r in distance.ravel()]
    return np.asarray(flat).reshape(distance.shape) / (2.0 * math.pi)


def point_total(media: Sequence[Medium], thicknesses: Sequence[float], *, depth: float, face: Face = "front") -> float:
    """Power that leaves a layered slab through a face, of an isotropic point source of unit power.

    It is the transform of `point_exitance` at q = 0.

    Parameters
    ----------
    media, thicknesses : sequence
        The layers from the front to the back, as for `point_exitance`.
    depth : float
        Depth of the source, unit.
    face : {"front", "back"}
        The face z = 0, or the other face.

    Returns
    -------
    float
        W, between 0 and 1.

    Raises
    ------
    InputError
        As `point_exitance` does.
    """
    up, down = _split_at_source(media, thicknesses, depth, face)
    return float(_at_face(up, down, np.zeros(1))[0])


_Layers = list[tuple[Medium, float]]


def _split_at_source(
    media: Sequence[Medium], thicknesses: Sequence[float], depth: float, face: Face
) -> tuple[_Layers, _Layers]:
    """The layers from the source to a face, and from the source to the other face."""
    back_wanted = checks.is_back(face)
    if len(media) != len(thicknesses) or len(media) == 0:
        raise InputError(f"there are {len(media)} media for {len(thicknesses)} layers; give one for each layer.")
    if len({(medium.eta, medium.boundary) for medium in media}) > 1:
        raise InputError("the layers have different refractive indices or boundaries; give all the same.")
    lengths = [checks.positive_number("a thickness", thickness) for thickness in thicknesses]
    z0 = checks.number_within("depth", depth, 0.0, sum(lengths), "slab")
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
    return (back, front) if back_wanted else (front, back)


def _at_face(up: _Layers, down: _Layers, q: FloatArray) -> FloatArray:
    """Transform of the exitance at the face where the layers `up` end."""
    robin = 0.5 / up[0][0].boundary_factor
    upward, share = _admittance(up, robin, q)
    downward, _ = _admittance(down, robin, q)
    return robin * share / (upward + downward)


def _admittance(layers: _Layers, robin: float, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Flux over fluence at the source, and fluence at the face over fluence at the source."""
    admittance, share = np.full(len(q), robin), np.ones(len(q))
    for medium, thickness in reversed(layers):
        mu = np.hypot(q, medium.sigma_tr)
        # tanh(mu t)/d has the limit t/D at mu = 0.
        safe = np.where(mu > 0, mu, 1.0)
        d, tanh = medium.diffusion * mu, np.tanh(mu * thickness)
        tanh_over_d = np.where(mu > 0, tanh / (medium.diffusion * safe), thickness / medium.diffusion)
        share = share / (np.cosh(np.minimum(mu * thickness, 700.0)) * (1.0 + admittance * tanh_over_d))
        admittance = (admittance + d * tanh) / (1.0 + admittance * tanh_over_d)
    return admittance, share
