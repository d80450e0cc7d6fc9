"""The half-space z >= 0 in the diffusion approximation, with the exact (Robin) boundary.

The medium fills z >= 0, so z is depth, and the outward normal of the surface is -z. All functions return values for
unit power, or unit irradiance. Exitance is ``M = phi/(2A)`` in W/unit². In formulas ``k = sigma_tr`` is the effective
attenuation coefficient, ``zb = 2 A D`` the extrapolation length and alpha' the reduced albedo, all of `Medium`.
"""

import math

import numpy as np
import numpy.typing as npt

from tetlux.fem.exact import checks
from tetlux.fem.exact.beam import Source, beam_source
from tetlux.fem.exact.numerics.images import mirror_flux, sink_line
from tetlux.fem.exact.numerics.quadrature import CUTOFF, compute_in_chunks, convolve_decays, graded_rule
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray


def point_fluence(medium: Medium, *, depth: float, points: npt.ArrayLike) -> FloatArray:
    """Fluence of an isotropic point source of unit power at (0, 0, depth).

    With ``r1`` and ``r2`` the distances from the source and from its mirror image above the surface,

        4 pi D phi = e^{-k r1}/r1 - e^{-k r2}/r2 + 2 ∫0..inf e^{-l/zb} w (1 + k R) e^{-k R}/R³ dl

    with ``w = z + depth + l`` and ``R² = rho² + w²``: the mirror source and sink line (Bryan 1890; Carslaw and Jaeger
    1959, section 14.9), after an integration by parts that removes cancellation.

    Parameters
    ----------
    medium : Medium
        What fills the half-space; ``sigma_a = 0`` is allowed.
    depth : float
        Depth of the source, greater than 0, unit.
    points : (n, 3) array_like
        Where to evaluate, z >= 0, unit.

    Returns
    -------
    (n,) ndarray
        Fluence, W/unit², to about 1e-12 of itself; infinite at the source.

    Raises
    ------
    InputError
        If the source or a point is outside.
    """
    z0 = checks.positive_number("depth", depth)
    rho, z = checks.points_in_slab(points, low=0.0)
    k = medium.sigma_tr
    r1 = np.hypot(rho, z - z0)
    r2 = np.hypot(rho, z + z0)
    with np.errstate(divide="ignore"):
        direct = np.exp(-k * r1) / r1
    mirrored = direct - np.exp(-k * r2) / r2
    return (mirrored + 2.0 * sink_line(k, medium.extrapolation_length, rho, z + z0)) / (
        4.0 * math.pi * medium.diffusion
    )


def point_exitance(medium: Medium, *, depth: float, rho: npt.ArrayLike) -> FloatArray:
    """Exitance above an isotropic point source of unit power: `point_fluence` at z = 0 over 2A.

    Parameters
    ----------
    medium : Medium
        What fills the half-space.
    depth : float
        Depth of the source, greater than 0, unit.
    rho : (...) array_like
        Distance on the surface from the point above the source, unit.

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)``, W/unit², to about 1e-12 of itself.

    Raises
    ------
    InputError
        If the source is outside, or a distance negative.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> point_exitance(medium, depth=1.0, rho=[0.0, 5.0]).round(6).tolist()
    [0.041846, 0.001425]
    """
    z0 = checks.positive_number("depth", depth)
    distance = checks.numbers("rho", rho, low=0.0)
    line = sink_line(medium.sigma_tr, medium.extrapolation_length, distance.ravel(), np.full(distance.size, z0))
    return (line / (2.0 * math.pi * medium.extrapolation_length)).reshape(distance.shape)


def point_total(medium: Medium, *, depth: float) -> float:
    """Power that leaves through the surface, ``e^{-k z0}/(1 + k zb)`` from a depth z0; the rest of 1 W is absorbed.

    Parameters
    ----------
    medium : Medium
        What fills the half-space.
    depth : float
        Depth of the source, greater than 0, unit.

    Returns
    -------
    float
        Between 0 and 1, W.

    Raises
    ------
    InputError
        If the source is outside.
    """
    z0 = checks.positive_number("depth", depth)
    k = medium.sigma_tr
    return float(np.exp(-k * z0) / (1.0 + k * medium.extrapolation_length))


def pencil_exitance(medium: Medium, *, rho: npt.ArrayLike, source: Source = "delta-eddington") -> FloatArray:
    """Exitance around a pencil beam of no width that enters at the origin along z.

    It is `point_exitance` integrated along the beam; the integrals along the beam and along the sink line combine to
    one over their height ``w``. A beam of no width is singular at its entry: M grows like log(1/rho), or decreases like
    -1/rho, to values below zero, if the source has a first moment.

    Parameters
    ----------
    medium : Medium
        What fills the half-space.
    rho : (...) array_like
        Distance on the surface from the entry, greater than 0, unit.
    source : {"delta-eddington", "similarity"}
        How the beam scatters, see `beam.beam_source`.

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)`` for unit power that enters, W/unit², to about 1e-12 of its singular part.

    Raises
    ------
    InputError
        If a distance is not positive.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> pencil_exitance(medium, rho=[1.0, 5.0]).round(6).tolist()
    [0.024604, 0.001297]
    """
    distance = checks.numbers("rho", rho, low=np.finfo(float).tiny)
    beam = beam_source(medium, source)
    sink = 1.0 / medium.extrapolation_length
    reach = CUTOFF / min(beam.extinction, sink)
    nodes, weights = graded_rule()
    w = reach * nodes[:, None]
    density = beam.volume * convolve_decays(w, beam.extinction, sink) - beam.forward * np.exp(-sink * w)

    def integral(part: FloatArray) -> FloatArray:
        return np.asarray((reach * weights) @ (density * mirror_flux(medium.sigma_tr, part, w)))

    return (sink / (2.0 * math.pi) * compute_in_chunks(integral, distance.ravel())).reshape(distance.shape)


def pencil_total(medium: Medium, *, source: Source = "delta-eddington") -> float:
    """Power that leaves by the surface, of a pencil beam; also the diffuse reflectance of a wide beam.

    ``(q0 - k q1)/[(sigma + k)(1 + k zb)]`` with the densities of `beam.BeamSource`. For ``"similarity"`` it is
    ``alpha'/[(1 + q)(1 + 2 A q/3)]``, ``q = sqrt(3 (1 - alpha'))``.

    Parameters
    ----------
    medium : Medium
        What fills the half-space.
    source : {"delta-eddington", "similarity"}
        How the beam scatters, see `beam.beam_source`.

    Returns
    -------
    float
        Share of the power that enters, between 0 and 1.
    """
    beam = beam_source(medium, source)
    k = medium.sigma_tr
    escape = (beam.isotropic - k * beam.forward) / (beam.extinction + k)
    return escape / (1.0 + k * medium.extrapolation_length)
