"""Radiative transfer by Monte Carlo in a ball and in a slab: what diffusion approximates.

Packets of light scatter by Henyey and Greenstein's phase function and obey Fresnel's and Snell's laws at every
crossing of the surface, from outside and from inside (Wang, Jacques and Zheng 1995, MCML). A share of a packet is
absorbed at each collision; faint packets play Russian roulette. Needs numba:
``pip install "tetlux[montecarlo]"``.

A medium given by sigma_s' alone scatters isotropically. Every run is made of `BATCHES` independent ones with
random numbers of their own, so that a seed gives the same result on any number of cores; standard errors are
those of the mean of the batches.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tetlux.fem.exact import checks
from tetlux.fem.exact.transfer.batches import BATCHES, Batches, Estimate, Light, estimate, mean_and_error
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError

__all__ = ["BATCHES", "Estimate", "Ledger", "Light", "SlabResult", "SphereResult", "slab", "sphere"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Ledger:
    """Where the light went, in shares of what came in: the four add up to 1 but for rounding.

    Attributes
    ----------
    photons : int
        Packets that were followed.
    specular : Estimate
        Reflected where it first met the surface.
    absorbed : Estimate
    exited : Estimate
        Left after at least one scattering; of a point source, all that left.
    ballistic : Estimate
        Left without having been scattered, through whichever face, after any reflections inside.
    """

    photons: int
    specular: Estimate
    absorbed: Estimate
    exited: Estimate
    ballistic: Estimate


@dataclass(frozen=True, eq=False, kw_only=True)
class SphereResult(Ledger):
    """What left a ball, by the polar angle from the pole.

    Attributes
    ----------
    edges : (b + 1,) ndarray
        Angles between the bins, radians.
    exitance : (b,) ndarray
        Mean over each bin, W/unit² for 1 W, or for 1 W/unit² of a wide beam; without the ballistic light.
    standard_error : (b,) ndarray
        Of `exitance`, the same unit.
    """

    edges: FloatArray
    exitance: FloatArray
    standard_error: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class SlabResult(Ledger):
    """What left a slab through either face, by distance from the axis of the light.

    Attributes
    ----------
    reflectance, transmittance : Estimate
        Parts of `exited` through the front z = 0 and the back z = L, without specular and ballistic light.
    edges : (b + 1,) ndarray
        Radii between the rings, unit; for a wide beam the one ring is the whole face.
    front, back : (b,) ndarray
        Exitance, mean over each ring, W/unit² for 1 W, or for 1 W/unit² of a wide beam.
    front_error, back_error : (b,) ndarray
        Their standard errors.
    """

    reflectance: Estimate
    transmittance: Estimate
    edges: FloatArray
    front: FloatArray
    back: FloatArray
    front_error: FloatArray
    back_error: FloatArray


def sphere(
    medium: Medium,
    *,
    radius: float,
    light: Light,
    depth: float | None = None,
    edges: npt.ArrayLike | None = None,
    photons: int = 200_000,
    seed: int = 0,
) -> SphereResult:
    """Give the exitance of a ball by radiative transfer.

    Parameters
    ----------
    medium : Medium
        What the ball is made of.
    radius : float
        Radius of the ball, unit.
    light : {"pencil", "beam", "point"}
        A beam without width that enters at the pole at right angles; a beam along -z, of even irradiance, that
        covers the ball and refracts on it; an isotropic point of 1 W below the pole.
    depth : float, optional
        Of the point below the pole, unit; for ``light="point"`` alone, which needs it.
    edges : (b + 1,) array_like, optional
        Ascending polar angles from 0 to pi that bound the bins, radians; every 10 degrees if left out.
    photons : int
        Packets to follow, rounded up to a multiple of `BATCHES`.
    seed : int
        Of the random numbers, 0 or more.

    Returns
    -------
    SphereResult

    Raises
    ------
    InputError
        If the radius is not positive, the point not inside, the bins or `photons` make no sense, or numba is
        not installed.
    """
    a = checks.positive_number("radius", radius)
    bounds = _edges(np.linspace(0.0, math.pi, 19) if edges is None else edges, high=math.pi)
    depth_of_point = _depth(light, depth, 2.0 * a, "ball")
    shares = Batches(medium, True, a, light, depth_of_point, bounds, photons, seed).run()
    # A wide beam of unit irradiance brings pi a².
    incident = math.pi * a**2 if light == "beam" else 1.0
    area = 2.0 * math.pi * a**2 * -np.diff(np.cos(bounds))
    mean, error = mean_and_error(incident * shares.front[:, :-1] / area)
    return SphereResult(**shares.ledger(), edges=bounds, exitance=mean, standard_error=error)


def slab(
    medium: Medium,
    *,
    thickness: float,
    light: Light,
    depth: float | None = None,
    edges: npt.ArrayLike | None = None,
    photons: int = 200_000,
    seed: int = 0,
) -> SlabResult:
    """Give the reflectance and transmittance of an infinite slab 0 <= z <= L by radiative transfer.

    A half-space is a slab so thick that nothing comes through.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness : float
        L, unit.
    light : {"pencil", "beam", "point"}
        A beam without width that enters at the origin along z; a beam along z that covers the front evenly; an
        isotropic point of 1 W on the z axis.
    depth : float, optional
        Of the point, unit; for ``light="point"`` alone, which needs it.
    edges : (b + 1,) array_like, optional
        Ascending radii that bound the rings, unit; ten rings of one mean free path ``1/sigma_t'`` if left
        out. A wide beam has none.
    photons, seed
        As in `sphere`.

    Returns
    -------
    SlabResult

    Raises
    ------
    InputError
        If the thickness is not positive, the point not inside, the rings or `photons` make no sense, or numba
        is not installed.
    """
    length = checks.positive_number("thickness", thickness)
    if light == "beam":
        if edges is not None:
            raise InputError("edges are given with a wide beam, which lights a slab evenly; leave them out.")
        bounds, area = np.array([0.0, math.inf]), np.ones(1)
    else:
        bounds = _edges(np.arange(11) * medium.mean_free_path if edges is None else edges, high=math.inf)
        area = math.pi * np.diff(bounds**2)
    depth_of_point = _depth(light, depth, length, "slab")
    shares = Batches(medium, False, length, light, depth_of_point, bounds, photons, seed).run()
    front, front_error = mean_and_error(shares.front[:, :-1] / area)
    back, back_error = mean_and_error(shares.back[:, :-1] / area)
    return SlabResult(
        **shares.ledger(),
        reflectance=estimate(shares.front.sum(axis=1)),
        transmittance=estimate(shares.back.sum(axis=1)),
        edges=bounds,
        front=front,
        back=back,
        front_error=front_error,
        back_error=back_error,
    )


def _depth(light: Light, depth: float | None, high: float, body: str) -> float:
    if light not in ("pencil", "beam", "point"):
        raise InputError(f'light is "{light}"; it is "pencil", "beam" or "point".')
    if (light == "point") != (depth is not None):
        raise InputError(f'light is "{light}" and depth is {depth}; a point needs its depth, a beam has none.')
    return 0.0 if depth is None else checks.number_within("depth", depth, 0.0, high, body)


def _edges(values: npt.ArrayLike, high: float) -> FloatArray:
    array = checks.numbers("edges", values, low=0.0, high=high)
    if array.ndim != 1 or array.size < 2 or np.any(np.diff(array) <= 0):
        raise InputError("edges do not ascend; give at least two numbers, each greater than the one before.")
    return np.ascontiguousarray(array)
