"""The slab 0 <= z <= L in the diffusion approximation, with a point source.

The boundary is either exact (Robin) or extrapolated: fluence vanishes on the planes ``z = -zb`` and ``z = L + zb``.
These models differ as `half_space` and `dipole` do. All functions return values for unit power of a source at
(0, 0, depth). For a wide beam see `slab_plane`. Symbols are those of `half_space`, and L is the thickness.
"""

import math

import numpy as np
import numpy.typing as npt

from tetlux.fem.exact import checks
from tetlux.fem.exact.checks import Face
from tetlux.fem.exact.numerics.layer import Layer
from tetlux.fem.exact.slab_plane import escape_front
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray


def point_fluence(medium: Medium, *, thickness: float, depth: float, points: npt.ArrayLike) -> FloatArray:
    """Fluence of an isotropic point source of unit power, both faces Robin.

    Parameters
    ----------
    medium : Medium
        What the slab is made of; ``sigma_a = 0`` is allowed.
    thickness : float
        L, unit.
    depth : float
        Depth of the source, between 0 and L, unit.
    points : (n, 3) array_like
        Where to evaluate, z from 0 to L, unit.

    Returns
    -------
    (n,) ndarray
        Fluence, W/unit², to about 1e-10 of itself; infinite at the source.

    Raises
    ------
    InputError
        If the thickness is not positive, or the source or a point outside.
    """
    length, z0 = checks.source_in_slab(thickness, depth)
    rho, z = checks.points_in_slab(points, low=0.0, high=length)
    field = Layer(medium.sigma_tr, medium.extrapolation_length, length).field(z, z0, rho)
    return field / (4.0 * math.pi * medium.diffusion)


def point_exitance(
    medium: Medium, *, thickness: float, depth: float, rho: npt.ArrayLike, face: Face = "front"
) -> FloatArray:
    """Exitance at a face for an isotropic point source of unit power, both faces Robin.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness : float
        L, unit.
    depth : float
        Depth of the source, between 0 and L, unit.
    rho : (...) array_like
        Distance on the face from the axis through the source, unit.
    face : {"front", "back"}
        The face z = 0, or z = L.

    Returns
    -------
    (...) ndarray
        ``M = phi/(2A)``, W/unit², to about 1e-10 of itself.

    Raises
    ------
    InputError
        If the thickness is not positive, the source outside, a distance negative, or the face unknown.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> point_exitance(medium, thickness=10.0, depth=1.0, rho=[0.0, 5.0]).round(6).tolist()
    [0.041833, 0.001413]
    """
    length, z0 = checks.source_in_slab(thickness, depth)
    distance = checks.numbers("rho", rho, low=0.0)
    z = np.full(distance.size, length if checks.is_back(face) else 0.0)
    zb = medium.extrapolation_length
    field = Layer(medium.sigma_tr, zb, length).field(z, z0, distance.ravel())
    return (field / (4.0 * math.pi * zb)).reshape(distance.shape)


def point_total(medium: Medium, *, thickness: float, depth: float, face: Face = "front") -> float:
    """Power that leaves through a face, both faces Robin: `slab_plane.escape_front`.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness : float
        L, unit.
    depth : float
        Depth of the source, between 0 and L, unit.
    face : {"front", "back"}
        The face z = 0, or z = L.

    Returns
    -------
    float
        W, between 0 and 1; what leaves through neither face is absorbed.

    Raises
    ------
    InputError
        If the thickness is not positive, the source outside, or the face unknown.

    Examples
    --------
    >>> from tetlux.fem import Medium
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> round(point_total(medium, thickness=10.0, depth=1.0, face="back"), 6)
    0.102323
    """
    length, z0 = checks.source_in_slab(thickness, depth)
    return float(escape_front(medium, length, np.array(length - z0 if checks.is_back(face) else z0)))


def extrapolated_fluence(medium: Medium, *, thickness: float, depth: float, points: npt.ArrayLike) -> FloatArray:
    """Fluence of an isotropic point source of unit power, zero on z = -zb and z = L + zb.

    It is the sum over all images, sources at ``2m(L + 2zb) + z0`` and sinks at ``2m(L + 2zb) - 2zb - z0`` (Contini
    1997): the nearest three one by one, the others in closed form.

    Parameters
    ----------
    medium : Medium
        What the slab is made of; ``sigma_a = 0`` is allowed.
    thickness : float
        L, unit.
    depth : float
        Depth of the source, between 0 and L, unit.
    points : (n, 3) array_like
        Where to evaluate, z from -zb to L + zb, unit.

    Returns
    -------
    (n,) ndarray
        Fluence, W/unit², to about 1e-10 of itself; infinite at the source.

    Raises
    ------
    InputError
        If the thickness is not positive, or the source or a point outside.
    """
    length, z0 = checks.source_in_slab(thickness, depth)
    zb = medium.extrapolation_length
    rho, z = checks.points_in_slab(points, low=-zb, high=length + zb)
    field = Layer(medium.sigma_tr, 0.0, length + 2.0 * zb).field(z + zb, z0 + zb, rho)
    return field / (4.0 * math.pi * medium.diffusion)


def extrapolated_flux(
    medium: Medium, *, thickness: float, depth: float, rho: npt.ArrayLike, face: Face = "front"
) -> FloatArray:
    """Outward flux ``-D dphi/dn`` through a real face, z = 0 or z = L, of `extrapolated_fluence`.

    It is R(rho) and T(rho) of Contini 1997, and `dipole.flux` for a thick slab. With this boundary it differs from
    phi/(2A).

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness : float
        L, unit.
    depth : float
        Depth of the source, between 0 and L, unit.
    rho : (...) array_like
        Distance on the face from the axis through the source, unit.
    face : {"front", "back"}
        The face z = 0, or z = L.

    Returns
    -------
    (...) ndarray
        W/unit², to about 1e-10 of itself.

    Raises
    ------
    InputError
        If the thickness is not positive, the source outside, a distance negative, or the face unknown.
    """
    length, z0 = checks.source_in_slab(thickness, depth)
    distance = checks.numbers("rho", rho, low=0.0)
    zb = medium.extrapolation_length
    back = checks.is_back(face)
    z = np.full(distance.size, length + zb if back else zb)
    slope = Layer(medium.sigma_tr, 0.0, length + 2.0 * zb).slope(z, z0 + zb, distance.ravel())
    return np.asarray((-slope if back else slope) / (4.0 * math.pi)).reshape(distance.shape)
