"""The slab 0 <= z <= L in the diffusion approximation, with a point source.

Two boundaries: the exact (Robin) one, and the extrapolated one, where fluence vanishes on the planes
``z = -zb`` and ``z = L + zb``. They are different models, as `half_space` and `dipole` are. All functions return
values for unit power; the source is at (0, 0, depth). A wide beam is in `slab_plane`.
"""

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from tetlux.fem.exact import checks
from tetlux.fem.exact.numerics.layer import Layer
from tetlux.fem.exact.slab_plane import escape_front
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError

Face = Literal["front", "back"]


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
    length, z0 = _source(thickness, depth)
    x = checks.points(points)
    z = checks.numbers("the z of points", x[:, 2], low=0.0, high=length)
    rho = np.hypot(x[:, 0], x[:, 1])
    field = Layer(medium.sigma_tr, medium.extrapolation_length, length).field(z, z0, rho)
    return field / (4.0 * math.pi * medium.diffusion)


def point_exitance(
    medium: Medium, *, thickness: float, depth: float, rho: npt.ArrayLike, face: Face = "front"
) -> FloatArray:
    """Give the exitance at a face, of an isotropic point source of unit power, both faces Robin.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness, depth : float
        L, and the depth of the source, unit.
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
    length, z0 = _source(thickness, depth)
    distance = checks.numbers("rho", rho, low=0.0)
    z = np.full(distance.size, length if _is_back(face) else 0.0)
    zb = medium.extrapolation_length
    field = Layer(medium.sigma_tr, zb, length).field(z, z0, distance.ravel())
    return (field / (4.0 * math.pi * zb)).reshape(distance.shape)


def point_total(medium: Medium, *, thickness: float, depth: float, face: Face = "front") -> float:
    """Power that leaves through a face, both faces Robin: `slab_plane.escape_front`.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness, depth : float
        L, and the depth of the source, unit.
    face : {"front", "back"}
        The face z = 0, or z = L.

    Returns
    -------
    float
        W for unit power, between 0 and 1; what leaves through neither face is absorbed.

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
    length, z0 = _source(thickness, depth)
    return float(escape_front(medium, length, np.array(length - z0 if _is_back(face) else z0)))


def extrapolated_fluence(medium: Medium, *, thickness: float, depth: float, points: npt.ArrayLike) -> FloatArray:
    """Fluence of an isotropic point source of unit power, zero on z = -zb and z = L + zb.

    The sum over all images of the source, sources at ``2m(L + 2zb) + z0`` and sinks at
    ``2m(L + 2zb) - 2zb - z0`` (Contini 1997): the nearest three one by one, the others in closed form.

    Parameters
    ----------
    medium : Medium
        What the slab is made of; ``sigma_a = 0`` is allowed.
    thickness, depth : float
        L, and the depth of the source, between 0 and L, unit.
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
    length, z0 = _source(thickness, depth)
    x = checks.points(points)
    zb = medium.extrapolation_length
    z = checks.numbers("the z of points", x[:, 2], low=-zb, high=length + zb)
    rho = np.hypot(x[:, 0], x[:, 1])
    field = Layer(medium.sigma_tr, 0.0, length + 2.0 * zb).field(z + zb, z0 + zb, rho)
    return field / (4.0 * math.pi * medium.diffusion)


def extrapolated_flux(
    medium: Medium, *, thickness: float, depth: float, rho: npt.ArrayLike, face: Face = "front"
) -> FloatArray:
    """Outward flux ``-D dphi/dn`` through a real face, z = 0 or z = L, of `extrapolated_fluence`.

    This is what Contini 1997 calls R(rho) and T(rho), and for a thick slab it is `dipole.flux`. It is not
    phi/(2A), which is another number with this boundary.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness, depth : float
        L, and the depth of the source, unit.
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
    length, z0 = _source(thickness, depth)
    distance = checks.numbers("rho", rho, low=0.0)
    zb = medium.extrapolation_length
    back = _is_back(face)
    z = np.full(distance.size, length + zb if back else zb)
    slope = Layer(medium.sigma_tr, 0.0, length + 2.0 * zb).slope(z, z0 + zb, distance.ravel())
    return np.asarray((-slope if back else slope) / (4.0 * math.pi)).reshape(distance.shape)


def _source(thickness: float, depth: float) -> tuple[float, float]:
    length = checks.positive("thickness", thickness)
    return length, checks.within("depth", depth, 0.0, length, "slab")


def _is_back(face: Face) -> bool:
    if face not in ("front", "back"):
        raise InputError(f'face is "{face}"; it is "front" or "back".')
    return face == "back"
