"""Monte Carlo solutions of the radiative transfer equation, which diffusion approximates, in a ball and in a slab.

Photon packets scatter by the Henyey-Greenstein phase function, and reflect and refract at the surface by Fresnel's and
Snell's laws, from outside and from inside (Wang, Jacques and Zheng 1995, MCML). A share of a packet is absorbed at each
collision; packets of low weight are ended by Russian roulette. It needs numba: ``pip install "tetlux[montecarlo]"``.

If only sigma_s' is given, a medium scatters isotropically. A run consists of `BATCHES` independent batches, each with
its own random numbers, so that a seed gives the same result on any number of cores. Standard errors are those of the
mean over the batches.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tetlux.fem.exact import checks
from tetlux.fem.exact.transfer.batches import BATCHES, Batches, LightKind, SampleMean, estimate, mean_and_error
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError

__all__ = ["BATCHES", "Ledger", "LightKind", "SampleMean", "SlabResult", "SphereResult", "slab", "sphere"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Ledger:
    """The power balance: four shares of the incident power, which sum to 1 up to rounding.

    Attributes
    ----------
    photons : int
        Number of packets.
    specular : SampleMean
        Share reflected at the first incidence on the surface.
    absorbed : SampleMean
        Share absorbed.
    exited : SampleMean
        Share that leaves after at least one scattering event; for a point source, all that leaves.
    ballistic : SampleMean
        Share that leaves unscattered, through any face and after any internal reflections.
    """

    photons: int
    specular: SampleMean
    absorbed: SampleMean
    exited: SampleMean
    ballistic: SampleMean


@dataclass(frozen=True, eq=False, kw_only=True)
class SphereResult(Ledger):
    """The power balance and the exitance of a ball, in bins of the polar angle.

    Attributes
    ----------
    edges : (b + 1,) ndarray
        Polar angles that bound the bins, radians.
    exitance : (b,) ndarray
        Mean over each bin, W/unit² for 1 W, or for 1 W/unit² of a wide beam, without ballistic light.
    standard_error : (b,) ndarray
        Standard error of `exitance`, W/unit².
    """

    edges: FloatArray
    exitance: FloatArray
    standard_error: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class SlabResult(Ledger):
    """The power balance and the exitance of both faces of a slab, in rings around the axis of the light.

    Attributes
    ----------
    reflectance, transmittance : SampleMean
        The parts of `exited` through the front z = 0 and the back z = L, without specular and ballistic light.
    edges : (b + 1,) ndarray
        Radii that bound the rings, unit; for a wide beam one ring, the whole face.
    front, back : (b,) ndarray
        Mean exitance over each ring, W/unit² for 1 W, or for 1 W/unit² of a wide beam.
    front_error, back_error : (b,) ndarray
        Standard errors of `front` and `back`, W/unit².
    """

    reflectance: SampleMean
    transmittance: SampleMean
    edges: FloatArray
    front: FloatArray
    back: FloatArray
    front_error: FloatArray
    back_error: FloatArray


def sphere(
    medium: Medium,
    *,
    radius: float,
    light: LightKind,
    depth: float | None = None,
    edges: npt.ArrayLike | None = None,
    photons: int = 200_000,
    seed: int = 0,
) -> SphereResult:
    """Exitance of a ball by radiative transfer.

    Parameters
    ----------
    medium : Medium
        What the ball is made of.
    radius : float
        Radius of the ball, unit.
    light : {"pencil", "beam", "point"}
        A beam of no width that enters at the pole along the normal; a uniform beam along -z that covers the ball and
        is refracted at its surface; an isotropic point source of 1 W below the pole.
    depth : float, optional
        Depth of the point source below the pole, unit; required for ``light="point"``, not allowed otherwise.
    edges : (b + 1,) array_like, optional
        Ascending polar angles from 0 to pi that bound the bins, radians; every 10 degrees if not given.
    photons : int
        Number of packets, rounded up to a multiple of `BATCHES`.
    seed : int
        Seed of the random numbers, 0 or more.

    Returns
    -------
    SphereResult

    Raises
    ------
    InputError
        If the radius is not positive, the point source is not inside, an argument is out of range, or numba is not
        installed.
    """
    a = checks.positive_number("radius", radius)
    bounds = _check_edges(np.linspace(0.0, math.pi, 19) if edges is None else edges, high=math.pi)
    depth_of_point = _check_depth(light, depth, 2.0 * a, "ball")
    shares = Batches(medium, True, a, light, depth_of_point, bounds, photons, seed).run()
    # The incident power of a wide beam of unit irradiance is pi a².
    incident = math.pi * a**2 if light == "beam" else 1.0
    area = 2.0 * math.pi * a**2 * -np.diff(np.cos(bounds))
    mean, error = mean_and_error(incident * shares.front[:, :-1] / area)
    return SphereResult(**shares.ledger(), edges=bounds, exitance=mean, standard_error=error)


def slab(
    medium: Medium,
    *,
    thickness: float,
    light: LightKind,
    depth: float | None = None,
    edges: npt.ArrayLike | None = None,
    photons: int = 200_000,
    seed: int = 0,
) -> SlabResult:
    """Reflectance, transmittance and exitance of an infinite slab 0 <= z <= L by radiative transfer.

    A slab so thick that no light crosses it is a half-space.

    Parameters
    ----------
    medium : Medium
        What the slab is made of.
    thickness : float
        L, unit.
    light : {"pencil", "beam", "point"}
        A beam of no width that enters at the origin along z; a uniform beam along z on the whole front; an isotropic
        point source of 1 W on the z axis.
    depth : float, optional
        Depth of the point source, unit; required for ``light="point"``, not allowed otherwise.
    edges : (b + 1,) array_like, optional
        Ascending radii that bound the rings, unit; ten rings of one mean free path ``1/sigma_t'`` if not given. Not
        allowed for a wide beam.
    photons : int
        Number of packets, rounded up to a multiple of `BATCHES`.
    seed : int
        Seed of the random numbers, 0 or more.

    Returns
    -------
    SlabResult

    Raises
    ------
    InputError
        If the thickness is not positive, the point source is not inside, an argument is out of range, or numba is not
        installed.
    """
    length = checks.positive_number("thickness", thickness)
    if light == "beam":
        if edges is not None:
            raise InputError("edges are given with a wide beam, whose exitance is uniform; leave them out.")
        bounds, area = np.array([0.0, math.inf]), np.ones(1)
    else:
        bounds = _check_edges(np.arange(11) * medium.mean_free_path if edges is None else edges, high=math.inf)
        area = math.pi * np.diff(bounds**2)
    depth_of_point = _check_depth(light, depth, length, "slab")
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


def _check_depth(light: LightKind, depth: float | None, high: float, body: str) -> float:
    if light not in ("pencil", "beam", "point"):
        raise InputError(f'light is "{light}"; it is "pencil", "beam" or "point".')
    if (light == "point") != (depth is not None):
        raise InputError(f'light is "{light}" and depth is {depth}; a point needs its depth, a beam has none.')
    return 0.0 if depth is None else checks.number_within("depth", depth, 0.0, high, body)


def _check_edges(values: npt.ArrayLike, high: float) -> FloatArray:
    array = checks.numbers("edges", values, low=0.0, high=high)
    if array.ndim != 1 or array.size < 2 or np.any(np.diff(array) <= 0):
        raise InputError("edges do not ascend; give at least two numbers, each greater than the one before.")
    return np.ascontiguousarray(array)
