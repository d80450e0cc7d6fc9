"""The slab 0 <= z <= L in one dimension: its reflectance and transmittance for a wide collimated beam along z."""

import numpy as np

from tetlux.fem.exact import checks
from tetlux.fem.exact.beam import Source, beam_source
from tetlux.fem.exact.numerics.quadrature import CUTOFF, composite_rule
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray


def escape_front(medium: Medium, thickness: float, depth: FloatArray) -> FloatArray:
    """Share of the power of a source at `depth` that leaves through z = 0.

    ``[sinh k(L - z) + zb k cosh k(L - z)]/[(1 + zb² k²) sinh k L + 2 zb k cosh k L]``, the solution of
    ``D phi'' = sigma_a phi - delta`` with Robin boundaries, computed without overflow and also at k = 0.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness : float
        L, unit.
    depth : (...) ndarray
        From 0 to L, unit.

    Returns
    -------
    (...) ndarray
    """
    k, zb = medium.sigma_tr, medium.extrapolation_length
    below = thickness - depth
    numerator = _scaled_sinh(k, below) + zb * _scaled_cosh(k, below)
    denominator = (1.0 + (zb * k) ** 2) * _scaled_sinh(k, np.asarray(thickness)) + 2.0 * zb * _scaled_cosh(
        k, np.asarray(thickness)
    )
    return np.asarray(np.exp(-k * depth) * numerator / denominator)


def beam_reflectance(medium: Medium, *, thickness: float, source: Source = "delta-eddington") -> float:
    """Diffuse reflectance of a slab in a wide beam that enters at z = 0, both faces Robin.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness : float
        L, unit.
    source : {"delta-eddington", "similarity"}
        How the beam scatters, see `beam.beam_source`.

    Returns
    -------
    float
        Share of the power that enters. The part of the beam that reaches the far face leaves there, unreflected.

    Raises
    ------
    InputError
        If the thickness is not positive.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> round(beam_reflectance(medium, thickness=5.0), 6), round(beam_transmittance(medium, thickness=5.0), 6)
    (0.577633, 0.249017)
    """
    return _beam_exit(medium, checks.positive_number("thickness", thickness), source, transmitted=False)


def beam_transmittance(medium: Medium, *, thickness: float, source: Source = "delta-eddington") -> float:
    """Diffuse transmittance of a slab in a wide beam that enters at z = 0, both faces Robin.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness : float
        L, unit.
    source : {"delta-eddington", "similarity"}
        How the beam scatters, see `beam.beam_source`.

    Returns
    -------
    float
        Share of the power that enters, without `ballistic_transmittance`.

    Raises
    ------
    InputError
        If the thickness is not positive.
    """
    return _beam_exit(medium, checks.positive_number("thickness", thickness), source, transmitted=True)


def ballistic_transmittance(medium: Medium, *, thickness: float, source: Source = "delta-eddington") -> float:
    """Share of a beam that crosses a slab without scattering as `source` defines it: ``e^{-sigma L}``.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness : float
        L, unit.
    source : {"delta-eddington", "similarity"}
        How the beam scatters, see `beam.beam_source`.

    Returns
    -------
    float
        Share of the power that enters.

    Raises
    ------
    InputError
        If the thickness is not positive.
    """
    beam = beam_source(medium, source)
    return float(np.exp(-beam.extinction * checks.positive_number("thickness", thickness)))


def _beam_exit(medium: Medium, thickness: float, source: Source, *, transmitted: bool) -> float:
    """Integrate `escape_front` f over the beam: ``∫ e^{-sigma z}(q0 f + q1 f') dz``, the second term by parts."""
    beam = beam_source(medium, source)
    reach = min(thickness, CUTOFF / beam.extinction)
    z, weights = composite_rule(np.linspace(0.0, reach, 9), 16)

    def escape(depth: FloatArray) -> FloatArray:
        return escape_front(medium, thickness, thickness - depth if transmitted else depth)

    inside = beam.volume * float((weights * np.exp(-beam.extinction * z)) @ escape(z))
    ends = escape(np.array([0.0, thickness]))
    return inside + beam.forward * float(np.exp(-beam.extinction * thickness) * ends[1] - ends[0])


def _scaled_sinh(k: float, length: FloatArray) -> FloatArray:
    """``e^{-k l} sinh(k l)/k``, l at k = 0."""
    return np.asarray(length if k == 0.0 else -np.expm1(-2.0 * k * length) / (2.0 * k))


def _scaled_cosh(k: float, length: FloatArray) -> FloatArray:
    """``e^{-k l} cosh(k l)``."""
    return np.asarray(0.5 * (1.0 + np.exp(-2.0 * k * length)))
