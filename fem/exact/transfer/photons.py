"""The random walk of a photon packet, compiled by numba: what `batches` runs.

Directions and positions are plain numbers, z of the slab is depth, the ball is centred at the origin. All in
one file, because numba's cache does not see a change in another one.
"""

import math
from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba
import numpy as np

from tetlux.meshing.arrays import FloatArray

# Position, or direction of unit length.
Vector = tuple[float, float, float]
# Kinds of light.
PENCIL, BEAM, POINT = 0, 1, 2
# The first entries of a tally; the bins of the front and of the back follow, each with one for what misses its bins.
SPECULAR, ABSORBED, BALLISTIC, LEDGER = 0, 1, 2, 3
# A packet below this weight survives with this chance.
FAINT, CHANCE = 0.01, 0.1

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile without the interpreter's lock, and remember the machine code where any folder can be written."""
    try:
        fast = numba.njit(nogil=True, cache=True)(function)
    except RuntimeError:  # neither __pycache__ nor the user's cache folder is writable
        fast = numba.njit(nogil=True)(function)
    return cast("Callable[P, R]", fast)


@compiled
def fresnel(mu: float, eta: float) -> float:
    """Unpolarised reflectance: `tetlux.fem.media.fresnel.reflectance` for one cosine."""
    if eta == 1.0:
        return 0.0
    sine_squared = eta**2 * (1.0 - mu**2)
    if sine_squared >= 1.0:
        return 1.0
    other = math.sqrt(1.0 - sine_squared)
    r_s = (eta * mu - other) / (eta * mu + other)
    r_p = (mu - eta * other) / (mu + eta * other)
    return 0.5 * (r_s**2 + r_p**2)


@compiled
def henyey_greenstein(rng: np.random.Generator, g: float) -> float:
    """Cosine of the scattering angle, by inversion (Henyey and Greenstein 1941; Witt 1977)."""
    u = rng.random()
    if abs(g) < 1e-6:
        return 2.0 * u - 1.0
    share = (1.0 - g**2) / (1.0 - g + 2.0 * g * u)
    return min(max((1.0 + g**2 - share**2) / (2.0 * g), -1.0), 1.0)


@compiled
def rotate(way: Vector, cosine: float, azimuth: float) -> Vector:
    """Turn a direction by an angle of the given cosine, to the given azimuth."""
    u, v, w = way
    sine = math.sqrt(1.0 - cosine**2)
    across, along = sine * math.cos(azimuth), sine * math.sin(azimuth)
    slant = math.sqrt(max(1.0 - w**2, 0.0))
    if slant < 1e-6:
        return across, along, math.copysign(cosine, w * cosine)
    x = u * cosine + (u * w * across - v * along) / slant
    y = v * cosine + (v * w * across + u * along) / slant
    z = w * cosine - slant * across
    # One step of Newton's method for the norm: rounding does not add up over thousands of turns.
    scale = 1.5 - 0.5 * (x**2 + y**2 + z**2)
    return x * scale, y * scale, z * scale


@compiled
def launch(
    rng: np.random.Generator, ball: bool, size: float, light: int, depth: float, eta: float
) -> tuple[Vector, Vector, float]:
    """Position and direction of a new packet inside, and the share that is reflected as it enters."""
    if light == POINT:
        way = rotate((0.0, 0.0, 1.0), 2.0 * rng.random() - 1.0, 2.0 * math.pi * rng.random())
        return (0.0, 0.0, size - depth if ball else depth), way, 0.0
    if not ball:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), fresnel(1.0, 1.0 / eta)
    # All that is counted is symmetric about the axis: a beam's packets may enter on one meridian.
    height = math.sqrt(rng.random()) if light == BEAM else 0.0
    mu = math.sqrt(1.0 - height**2)
    bend = mu / eta - math.sqrt(max(1.0 - (height / eta) ** 2, 0.0))
    return (size * height, 0.0, size * mu), (bend * height, 0.0, bend * mu - 1.0 / eta), fresnel(mu, 1.0 / eta)


@compiled
def distance_to_surface(ball: bool, size: float, place: Vector, way: Vector) -> float:
    """Distance along `way` from inside a ball of radius `size`, or a slab of that thickness, to its surface."""
    x, y, z = place
    u, v, w = way
    if ball:
        b = x * u + y * v + z * w
        return max(-b + math.sqrt(max(b**2 + size**2 - x**2 - y**2 - z**2, 0.0)), 0.0)
    if w > 0.0:
        return (size - z) / w
    return -z / w if w < 0.0 else math.inf


@compiled
def normal_at(ball: bool, size: float, place: Vector, way: Vector) -> Vector:
    """Outward normal where a packet meets the surface."""
    if not ball:
        return 0.0, 0.0, math.copysign(1.0, way[2])
    x, y, z = place
    length = math.sqrt(x**2 + y**2 + z**2)
    return x / length, y / length, z / length


@compiled
def roulette(rng: np.random.Generator, weight: float) -> float:
    """Russian roulette: the weight with which a packet goes on, the same in the mean."""
    if weight >= FAINT:
        return weight
    return weight / CHANCE if rng.random() < CHANCE else 0.0


@compiled
def bin_index(edges: FloatArray, value: float) -> int:
    """Index of the bin that holds `value`, the number of bins if none does."""
    index = int(np.searchsorted(edges, value, side="right")) - 1
    return index if 0 <= index < edges.size - 1 else edges.size - 1


@compiled
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
    """Follow packets of weight 1 from the light until they have left or are absorbed.

    At every collision the share ``1 - albedo`` of a packet is absorbed. What Russian roulette takes from a
    packet counts as absorbed, what it gives as negative absorption, so that the ledger closes packet by packet.
    At its entry a packet is split; from inside it is reflected as a whole or leaves as a whole.

    Parameters
    ----------
    rng : Generator
        This batch's own.
    photons : int
        How many packets.
    ball : bool
        A ball of radius `size`, otherwise a slab ``0 <= z <= size``.
    size : float
        Unit.
    light : int
        `PENCIL`, `BEAM` (on a slab, as good as the pencil) or `POINT`.
    depth : float
        Of the point below the pole of the ball, or the front of the slab, unit.
    extinction, albedo, g, eta : float
        ``sigma_a + sigma_s`` in 1/unit, ``sigma_s`` over it, mean cosine, refractive index.
    edges : (b + 1,) ndarray
        Polar angles, or distances from the axis, that bound the bins.

    Returns
    -------
    (LEDGER + 2 (b + 1),) ndarray
        Summed weights.
    """
    tally = np.zeros(LEDGER + 2 * edges.size)
    for _ in range(photons):
        place, way, specular = launch(rng, ball, size, light, depth, eta)
        tally[SPECULAR] += specular
        weight = 1.0 - specular
        scattered = light == POINT
        while weight > 0.0:
            step = rng.standard_exponential() / extinction
            reach = distance_to_surface(ball, size, place, way)
            length = min(step, reach)
            place = (place[0] + length * way[0], place[1] + length * way[1], place[2] + length * way[2])
            if step < reach:
                left = roulette(rng, weight * albedo)
                tally[ABSORBED] += weight - left
                weight = left
                way = rotate(way, henyey_greenstein(rng, g), 2.0 * math.pi * rng.random())
                scattered = True
                continue
            normal = normal_at(ball, size, place, way)
            mu = min(normal[0] * way[0] + normal[1] * way[1] + normal[2] * way[2], 1.0)
            back = not ball and normal[2] > 0.0
            # Rounding must not let a packet drift off the surface.
            if ball:
                place = (size * normal[0], size * normal[1], size * normal[2])
            else:
                place = (place[0], place[1], size if back else 0.0)
            if rng.random() < fresnel(max(mu, 0.0), eta):
                way = (way[0] - 2.0 * mu * normal[0], way[1] - 2.0 * mu * normal[1], way[2] - 2.0 * mu * normal[2])
                continue
            if scattered:
                where = math.acos(min(max(normal[2], -1.0), 1.0)) if ball else math.hypot(place[0], place[1])
                tally[LEDGER + (edges.size if back else 0) + bin_index(edges, where)] += weight
            else:
                tally[BALLISTIC] += weight
            weight = 0.0
    return tally
