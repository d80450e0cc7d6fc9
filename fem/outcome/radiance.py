"""The light that leaves the surface in one direction.

Outside, diffuse light of exitance M has the radiance ``L = F_t(eta, theta) M/pi``, with Fresnel's transmittance on the
way out (Jensen 2001, eq. 5). Over all directions that adds up to ``collected_share(eta, 1) M``: to the M that leaves
where indices match, but to 0.934 of it at an index of 1.33 and 0.908 at 1.5, because M has passed the boundary already.
Rendering has it so; divide by that share for a radiance that adds up to M, as fibres do.
"""

import numpy as np
import numpy.typing as npt

from tetlux.fem.media.fresnel import reflectance
from tetlux.fem.outcome.exitance_field import ExitanceField
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface


def radiance(solution: ExitanceField, points: npt.ArrayLike, viewer: npt.ArrayLike) -> FloatArray:
    """Radiance that leaves the surface towards a viewer.

    Shadowing by other parts of the body and light that the surface reflects are not included.

    Parameters
    ----------
    solution : Solution or another ExitanceField
    points : (n, 3) array_like
        Taken to the nearest points of the surface.
    viewer : (3,) or (n, 3) array_like
        Where it is seen from: one place, or one for each point.

    Returns
    -------
    (n,) ndarray
        W/(unit² sr), 0 where the surface faces away.

    Raises
    ------
    InputError
        If coordinates are not finite or do not go together.

    Examples
    --------
    >>> from tetlux.fem import Medium, PointSource, solve
    >>> from tetlux.meshing import sphere
    >>> medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve(sphere(radius=10.0), medium, [PointSource((0, 0, 0))], model="closed-form")
    >>> seen = radiance(solution, [[0, 0, 10], [0, 0, -10]], viewer=(0, 0, 100))
    >>> seen.shape, bool(seen[0] > 0), float(seen[1])  # the other side faces away
    ((2,), True, 0.0)
    """
    wanted, eye = np.asarray(points, dtype=float), np.asarray(viewer, dtype=float)
    if wanted.ndim != 2 or wanted.shape[1] != 3 or not np.isfinite(wanted).all():
        raise InputError("points must be finite coordinates (n, 3).")
    if eye.shape not in ((3,), wanted.shape) or not np.isfinite(eye).all():
        raise InputError("viewer must be three finite coordinates, or three for each point.")
    places, cosine = view_cosine(solution.surface, wanted, eye)
    return radiance_of(solution.exitance_on(places), cosine, solution.medium.eta)


def view_cosine(surface: Surface, points: FloatArray, viewer: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cosine between the surface's normal and the direction to a viewer.

    Parameters
    ----------
    surface : Surface
    points : (n, 3) ndarray
    viewer : (3,) or (n, 3) ndarray

    Returns
    -------
    places : (n, 3) ndarray
        The points of the surface nearest to `points`.
    cosine : (n,) ndarray
        There; 0 at the viewer itself.
    """
    places, normals = surface.project(points)
    towards = viewer - places
    distance = np.linalg.norm(towards, axis=1)
    return places, np.einsum("ij,ij->i", towards, normals) / np.where(distance > 0, distance, 1.0)


def radiance_of(exitance: FloatArray, cosine: FloatArray, eta: float) -> FloatArray:
    """Radiance (n,), W/(unit² sr), of an exitance (n,) in directions of the given cosines (n,); 0 where negative."""
    seen = (1.0 - reflectance(cosine, 1.0 / eta)) * (cosine > 0)
    return np.asarray(seen * exitance / np.pi)


def collected_share(eta: float, numerical_aperture: float) -> float:
    """Share of the exitance that leaves within a cone round the normal: ``2 ∫ F_t(eta, theta) cos sin dtheta``.

    Parameters
    ----------
    eta : float
        Refractive index of the medium relative to the outside.
    numerical_aperture : float
        Sine of the cone's half angle outside, from 0 to 1.

    Returns
    -------
    float
    """
    # For eta < 1 no light leaves beyond the critical angle, before which F_t falls like a square root:
    # mu = low + (1 - low) t² takes that away.
    nodes, weights = np.polynomial.legendre.leggauss(64)
    low = np.sqrt(max(1.0 - min(numerical_aperture, eta) ** 2, 0.0))
    t, w = 0.5 * (nodes + 1.0), 0.5 * weights
    mu = low + (1.0 - low) * t**2
    return float(2.0 * (w * 2.0 * (1.0 - low) * t * mu) @ (1.0 - reflectance(mu, 1.0 / eta)))
