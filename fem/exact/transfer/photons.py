"""The random walk of photon packets, compiled by numba.

In a slab z is depth; the ball is centred at the origin. All is in one file, since numba's cache does not notice changes
in others.
"""

import math
from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba
import numpy as np

from tetlux.meshing.arrays import FloatArray, Vector

# Kinds of light.
PENCIL, BEAM, POINT = 0, 1, 2
# The first entries of a tally; the bins of the front and of the back follow, each with one for values outside its bins.
SPECULAR, ABSORBED, BALLISTIC, FIRST_BIN = 0, 1, 2, 3
# A packet below the first weight survives with the second probability.
ROULETTE_WEIGHT, SURVIVAL = 0.01, 0.1

P = ParamSpec("P")
R = TypeVar("R")


def compile_function(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function to run without the interpreter's lock, and cache the machine code if a folder is writable."""
    try:
        fast = numba.njit(nogil=True, cache=True)(function)
    except RuntimeError:  # neither __pycache__ nor the user's cache folder is writable
        fast = numba.njit(nogil=True)(function)
    return cast("Callable[P, R]", fast)


@compile_function
def fresnel(mu: float, eta: float) -> float:
    """Unpolarised reflectance at one cosine, as `tetlux.fem.media.fresnel.reflectance`."""
    if eta == 1.0:
        return 0.0
    sine_squared = eta**2 * (1.0 - mu**2)
    if sine_squared >= 1.0:
        return 1.0
    other = math.sqrt(1.0 - sine_squared)
    r_s = (eta * mu - other) / (eta * mu + other)
    r_p = (mu - eta * other) / (mu + eta * other)
    return 0.5 * (r_s**2 + r_p**2)


@compile_function
def sample_henyey_greenstein(rng: np.random.Generator, g: float) -> float:
    """Sample the cosine of the scattering angle by inversion (Henyey and Greenstein 1941; Witt 1977)."""
    u = rng.random()
    if abs(g) < 1e-6:
        return 2.0 * u - 1.0
    share = (1.0 - g**2) / (1.0 - g + 2.0 * g * u)
    return min(max((1.0 + g**2 - share**2) / (2.0 * g), -1.0), 1.0)


@compile_function
def rotate(direction: Vector, cosine: float, azimuth: float) -> Vector:
    """Turn a direction by an angle of given cosine and azimuth."""
    u, v, w = direction
    sine = math.sqrt(1.0 - cosine**2)
    across, along = sine * math.cos(azimuth), sine * math.sin(azimuth)
    slant = math.sqrt(max(1.0 - w**2, 0.0))
    if slant < 1e-6:
        return across, along, math.copysign(cosine, w * cosine)
    x = u * cosine + (u * w * across - v * along) / slant
    y = v * cosine + (v * w * across + u * along) / slant
    z = w * cosine - slant * across
    # One Newton step for the norm, so that rounding errors do not accumulate over thousands of turns.
    scale = 1.5 - 0.5 * (x**2 + y**2 + z**2)
    return x * scale, y * scale, z * scale


@compile_function
def launch(
    rng: np.random.Generator, ball: bool, size: float, light: int, depth: float, eta: float
) -> tuple[Vector, Vector, float]:
    """Position and direction of a new packet inside the body, and the share reflected at its entry."""
    if light == POINT:
        direction = rotate((0.0, 0.0, 1.0), 2.0 * rng.random() - 1.0, 2.0 * math.pi * rng.random())
        return (0.0, 0.0, size - depth if ball else depth), direction, 0.0
    if not ball:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), fresnel(1.0, 1.0 / eta)
    # All tallies are symmetric about the axis, so the packets of a beam may enter on one meridian.
    height = math.sqrt(rng.random()) if light == BEAM else 0.0
    mu = math.sqrt(1.0 - height**2)
    bend = mu / eta - math.sqrt(max(1.0 - (height / eta) ** 2, 0.0))
    return (size * height, 0.0, size * mu), (bend * height, 0.0, bend * mu - 1.0 / eta), fresnel(mu, 1.0 / eta)


@compile_function
def distance_to_surface(ball: bool, size: float, position: Vector, direction: Vector) -> float:
    """Distance from inside a ball of radius `size`, or a slab of that thickness, to its surface along a direction."""
    x, y, z = position
    u, v, w = direction
    if ball:
        b = x * u + y * v + z * w
        return max(-b + math.sqrt(max(b**2 + size**2 - x**2 - y**2 - z**2, 0.0)), 0.0)
    if w > 0.0:
        return (size - z) / w
    return -z / w if w < 0.0 else math.inf


@compile_function
def normal_at(ball: bool, size: float, position: Vector, direction: Vector) -> Vector:
    """Outward normal at the point where a packet meets the surface."""
    if not ball:
        return 0.0, 0.0, math.copysign(1.0, direction[2])
    x, y, z = position
    length = math.sqrt(x**2 + y**2 + z**2)
    return x / length, y / length, z / length


@compile_function
def roulette(rng: np.random.Generator, weight: float) -> float:
    """Russian roulette: the new weight of a packet, whose expected value is the old one."""
    if weight >= ROULETTE_WEIGHT:
        return weight
    return weight / SURVIVAL if rng.random() < SURVIVAL else 0.0


@compile_function
def bin_index(edges: FloatArray, value: float) -> int:
    """Index of the bin that contains a value; the number of bins if none does."""
    index = int(np.searchsorted(edges, value, side="right")) - 1
    return index if 0 <= index < edges.size - 1 else edges.size - 1


@compile_function
def trace(
    rng: np.random.Generator,
    photons: int,
    ball: bool,
    size: float,
    light: int,
    depth: float,
    extinction: float,
    albedo: float,
    g: float,
    eta: float,
    edges: FloatArray,
) -> FloatArray:
    """Trace packets of weight 1 from the light until they leave or are absorbed.

    At each collision the share ``1 - albedo`` of a packet is absorbed. The weight that Russian roulette removes counts
    as absorbed, and the weight that it adds as negative absorption, so that the power of each packet is conserved. At
    its entry a packet is split; from inside it is reflected or leaves as a whole.

    Parameters
    ----------
    rng : Generator
        Random numbers of this batch.
    photons : int
        Number of packets.
    ball : bool
        Whether the body is a ball of radius `size`; otherwise it is the slab ``0 <= z <= size``.
    size : float
        Radius or thickness, unit.
    light : int
        `PENCIL`, `BEAM` (for a slab, the same as the pencil) or `POINT`.
    depth : float
        Depth of the point source below the pole of the ball or the front of the slab, unit.
    extinction, albedo, g, eta : float
        ``sigma_a + sigma_s``, 1/unit; ``sigma_s/(sigma_a + sigma_s)``; mean cosine; refractive index.
    edges : (b + 1,) ndarray
        Polar angles, or distances from the axis, that bound the bins.

    Returns
    -------
    (FIRST_BIN + 2 (b + 1),) ndarray
        Sums of weights, see `FIRST_BIN`.
    """
    tally = np.zeros(FIRST_BIN + 2 * edges.size)
    for _ in range(photons):
        position, direction, specular = launch(rng, ball, size, light, depth, eta)
        tally[SPECULAR] += specular
        weight = 1.0 - specular
        scattered = light == POINT
        while weight > 0.0:
            step = rng.standard_exponential() / extinction
            reach = distance_to_surface(ball, size, position, direction)
            length = min(step, reach)
            position = (
                position[0] + length * direction[0],
                position[1] + length * direction[1],
                position[2] + length * direction[2],
            )
            if step < reach:
                remaining = roulette(rng, weight * albedo)
                tally[ABSORBED] += weight - remaining
                weight = remaining
                direction = rotate(direction, sample_henyey_greenstein(rng, g), 2.0 * math.pi * rng.random())
                scattered = True
                continue
            normal = normal_at(ball, size, position, direction)
            mu = min(normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2], 1.0)
            back = not ball and normal[2] > 0.0
            # Move the packet exactly onto the surface.
            if ball:
                position = (size * normal[0], size * normal[1], size * normal[2])
            else:
                position = (position[0], position[1], size if back else 0.0)
            if rng.random() < fresnel(max(mu, 0.0), eta):
                direction = (
                    direction[0] - 2.0 * mu * normal[0],
                    direction[1] - 2.0 * mu * normal[1],
                    direction[2] - 2.0 * mu * normal[2],
                )
                continue
            if scattered:
                where = math.acos(min(max(normal[2], -1.0), 1.0)) if ball else math.hypot(position[0], position[1])
                tally[FIRST_BIN + (edges.size if back else 0) + bin_index(edges, where)] += weight
            else:
                tally[BALLISTIC] += weight
            weight = 0.0
    return tally
