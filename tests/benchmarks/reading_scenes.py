"""Random scenes of a body, a source and ten detectors, with what these read: for ``tests.benchmarks.readings``.

Lengths are in mean free paths. Six kinds in turn: a block so large that it is a half-space to most of the light, a
plate, a ball, a cylinder, a ball in a ball, and a finger with a bone. The truth is the series of each; that of the
finger is a run of NGSolve with elements of third order on the exact shape, and without NGSolve a fine run of tetlux.
"""

import importlib.util
from dataclasses import dataclass, field

import numpy as np

from tetlux.cases.chart.peers import exact_shapes, run_peer
from tetlux.fem import Medium, PointDetector, PointSource, Region, solve
from tetlux.fem.exact import box as exact_box
from tetlux.fem.exact import cylinder as exact_cylinder
from tetlux.fem.exact import layered, layered_ball
from tetlux.fem.exact import sphere as exact_sphere
from tetlux.fem.media.region import only_medium
from tetlux.meshing import Surface, box, cylinder, slab, sphere
from tetlux.meshing.arrays import FloatArray

EACH = 10
BLOCK, PLATE, ROD = (120.0, 120.0, 60.0), 160.0, 200.0
# Two gradings of NGSolve's mesh for the finger; the truth is the finer, its error the difference.
GRADINGS = (0.3, 0.2)
# Without NGSolve, the detector tolerance of the fine run.
FINE = 0.002


@dataclass(frozen=True, eq=False)
class Scene:
    """A body, a source of unit power, places on the surface, and the exitance there, with its own relative error."""

    name: str
    surface: Surface
    medium: Medium
    regions: list[Region]
    source: tuple[float, float, float]
    places: FloatArray
    truth: FloatArray
    truth_error: FloatArray = field(default_factory=lambda: np.zeros(EACH))


def random_scene(number: int) -> Scene:
    """A scene by its number."""
    rng = np.random.default_rng(number)
    albedo, eta = 1.0 - 10.0 ** rng.uniform(-4.0, np.log10(0.2)), rng.uniform(1.0, 1.5)
    medium = Medium(sigma_a=1.0 - albedo, sigma_s_prime=albedo, eta=eta)
    depth, away = 10.0 ** rng.uniform(np.log10(0.3), 1.0), 10.0 ** rng.uniform(0.0, np.log10(40.0), EACH)
    make = (_block, _plate, _ball, _rod, _ball_in_ball, _finger)[number % 6]
    return make(rng, medium, depth, away)


def places_on_ball(radius: float, away: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Angles from the pole, and places on a sphere."""
    gamma = np.minimum(away / radius, 0.99 * np.pi)
    return gamma, radius * np.column_stack([np.sin(gamma), 0.0 * gamma, np.cos(gamma)])


def _block(rng: np.random.Generator, medium: Medium, depth: float, away: FloatArray) -> Scene:
    angle, middle = rng.uniform(0.0, 2.0 * np.pi, EACH), 0.5 * BLOCK[2]
    places = np.column_stack([away * np.cos(angle), away * np.sin(angle), np.full(EACH, middle)])
    source = (0.0, 0.0, middle - depth)
    truth = exact_box.point_exitance(medium, size=BLOCK, source=source, points=places)
    return Scene("half-space", box(BLOCK), medium, [], source, places, truth)


def _plate(rng: np.random.Generator, medium: Medium, depth: float, away: FloatArray) -> Scene:
    thickness, rho = rng.uniform(1.2 * depth + 1.0, 20.0), np.minimum(away, 25.0)
    back, angle = rng.random(EACH) < 0.3, rng.uniform(0.0, 2.0 * np.pi, EACH)
    places = np.column_stack([rho * np.cos(angle), rho * np.sin(angle), np.where(back, -thickness, 0.0)])
    front, rear = (
        layered.point_exitance([medium], [thickness], depth=depth, rho=rho, face=face) for face in ("front", "back")
    )
    truth = np.where(back, rear, front)
    return Scene("plate", slab(PLATE, thickness), medium, [], (0.0, 0.0, -depth), places, truth)


def _ball(rng: np.random.Generator, medium: Medium, depth: float, away: FloatArray) -> Scene:
    radius = rng.uniform(max(5.0, 1.2 * depth), 40.0)
    gamma, places = places_on_ball(radius, away)
    truth = exact_sphere.point_exitance(medium, radius=radius, source_radius=radius - depth, gamma=gamma)
    return Scene("ball", sphere(radius), medium, [], (0.0, 0.0, radius - depth), places, truth)


def _rod(rng: np.random.Generator, medium: Medium, depth: float, away: FloatArray) -> Scene:
    radius = rng.uniform(max(5.0, 1.3 * depth), 15.0)
    z, theta = away * rng.uniform(0.0, 1.0, EACH), np.minimum(away / radius, 3.1) * rng.uniform(0.0, 1.0, EACH)
    places = np.column_stack([radius * np.cos(theta), radius * np.sin(theta), z])
    truth = exact_cylinder.point_exitance(medium, radius=radius, source_radius=radius - depth, theta=theta, z=z)
    return Scene("cylinder", cylinder(radius, ROD), medium, [], (radius - depth, 0.0, 0.0), places, truth)


def _ball_in_ball(rng: np.random.Generator, medium: Medium, depth: float, away: FloatArray) -> Scene:
    radius = rng.uniform(max(8.0, 2.0 * depth), 30.0)
    inner = rng.uniform(0.3, 0.95) * (radius - 1.3 * depth)
    core = _other(rng, medium)
    gamma, places = places_on_ball(radius, away)
    truth = layered_ball.point_exitance([core, medium], [inner, radius], source_radius=radius - depth, gamma=gamma)
    regions = [Region(sphere(inner), core)]
    return Scene("ball in a ball", sphere(radius), medium, regions, (0.0, 0.0, radius - depth), places, truth)


def _other(rng: np.random.Generator, medium: Medium) -> Medium:
    """A medium with up to ten times more or less absorption and three times more or less scattering."""
    assert medium.sigma_s_prime is not None
    return Medium(
        sigma_a=medium.sigma_a * 10.0 ** rng.uniform(-1.0, 1.0),
        sigma_s_prime=medium.sigma_s_prime * 10.0 ** rng.uniform(-0.5, 0.5),
        eta=medium.eta,
    )


def _finger(rng: np.random.Generator, medium: Medium, depth: float, away: FloatArray) -> Scene:
    depth = min(depth, 4.0)
    radius = rng.uniform(max(6.0, 2.2 * depth), 10.0)
    bone = rng.uniform(0.3, 0.9) * (radius - 1.3 * depth)
    height = 90.0
    z = -25.0 + away * rng.uniform(0.0, 1.0, EACH)
    theta = np.minimum(away / radius, 3.1) * rng.uniform(0.0, 1.0, EACH)
    places = np.column_stack([radius * np.cos(theta), radius * np.sin(theta), z])
    regions = [Region(cylinder(bone, 0.8 * height), _other(rng, medium))]
    surface, source = cylinder(radius, height), (radius - depth, 0.0, -25.0)
    truth, error = _truth_of_finger(surface, medium, regions, source, depth, places)
    return Scene("finger", surface, medium, regions, source, places, truth, error)


def _truth_of_finger(
    surface: Surface,
    medium: Medium,
    regions: list[Region],
    source: tuple[float, float, float],
    depth: float,
    places: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Exitance at places, and its relative error."""
    if importlib.util.find_spec("ngsolve") is None:
        found = solve(
            surface,
            medium,
            [PointSource(source)],
            regions=regions,
            tolerance=None,
            detectors=[PointDetector(tuple(place)) for place in places.tolist()],
            detector_tolerance=FINE,
            cache=False,
        ).readings
        return np.array([each.exitance for each in found]), np.array([each.relative_error for each in found])
    media = [medium, *(each for region in regions if isinstance(each := only_medium(region), Medium))]
    job = exact_shapes(surface, [region.surface for region in regions]) | {
        "order": 3,
        "diffusion": np.array([each.diffusion for each in media]),
        "sigma_a": np.array([each.sigma_a for each in media]),
        "robin": 1.0 / (2.0 * medium.boundary_factor),
        "points": np.array([source]),
        "powers": np.ones(1),
        "lengths_to_resolve": np.array([min(depth, 1.0)]),
        "samples": places,
        "repeats": 1,
        "repeat_seconds": 0.0,
    }
    coarse, fine = (run_peer("_peer_ngsolve.py", job | {"resolution": each})["exitance"] for each in GRADINGS)
    return fine, np.abs(coarse / fine - 1.0)
