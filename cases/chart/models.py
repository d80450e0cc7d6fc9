"""Methods of the chart without a mesh: the dipole, the half-space, and Monte Carlo."""

import importlib.util
import math
import time
from collections.abc import Callable

import numpy as np

from tetlux.cases.chart.methods import Method, Outcome, quickest
from tetlux.cases.chart.benchmark import Scene
from tetlux.fem.exact import dipole, half_space, monte_carlo
from tetlux.fem.medium import Medium
from tetlux.meshing.arrays import FloatArray

# Monte Carlo counts in this many rings round the light, the first one this share of the source's depth wide.
RINGS, FIRST_RING = 60, 0.1


def _of_half_space(exitance: Callable[[Medium, float, FloatArray], FloatArray]) -> Callable[[Scene, float], Outcome]:
    """Take the surface for the plane that touches it nearest to each source, and distances as distances on it."""

    def once(scene: Scene) -> Outcome:
        surface, medium, points = scene.case.surface, scene.case.medium, scene.samples.points
        started = time.perf_counter()
        total = np.zeros(len(points))
        for source, power in scene.sources:
            foot = surface.project(source[None])[0][0]
            total += power * exitance(
                medium, float(np.linalg.norm(foot - source)), np.linalg.norm(points - foot, axis=1)
            )
        return Outcome(total, time.perf_counter() - started)

    return lambda scene, _: quickest(scene, lambda: once(scene))


def _monte_carlo(scene: Scene, photons: float) -> Outcome:
    """Radiative transfer from the same sources: isotropic points."""
    started = time.perf_counter()
    on = _monte_carlo_on_sphere if scene.shape.sphere else _monte_carlo_on_slab
    total = np.zeros(len(scene.samples.points))
    for source, power in scene.sources:
        total += power * on(scene, source, int(photons))
    return Outcome(total, time.perf_counter() - started)


def _monte_carlo_on_sphere(scene: Scene, source: FloatArray, photons: int) -> FloatArray:
    sphere = scene.shape.sphere
    assert sphere is not None
    axis, outward = source - sphere.center, scene.samples.points - sphere.center
    depth = sphere.radius - float(np.linalg.norm(axis))
    angle = np.arctan2(np.linalg.norm(np.cross(outward, axis), axis=1), outward @ axis)
    edges = np.append(0.0, np.geomspace(FIRST_RING * depth / sphere.radius, math.pi, RINGS))
    result = monte_carlo.sphere(
        scene.case.medium, radius=sphere.radius, light="point", depth=depth, edges=edges, photons=photons
    )
    return np.asarray(np.interp(angle, 0.5 * (edges[1:] + edges[:-1]), result.exitance))


def _monte_carlo_on_slab(scene: Scene, source: FloatArray, photons: int) -> FloatArray:
    slab = scene.shape.slab
    assert slab is not None
    depth = -float(source[2])
    rho = np.hypot(*(scene.samples.points - source)[:, :2].T)
    edges = np.append(0.0, np.geomspace(FIRST_RING * depth, float(rho.max()), RINGS))
    result = monte_carlo.slab(
        scene.case.medium, thickness=slab.depth, light="point", depth=depth, edges=edges, photons=photons
    )
    middles = 0.5 * (edges[1:] + edges[:-1])
    front = scene.samples.normals[:, 2] > 0
    return np.where(front, np.interp(rho, middles, result.front), np.interp(rho, middles, result.back))


def _monte_carlo_fits(scene: Scene) -> bool:
    return scene.reference.kind == "closed form" and scene.shape.kind in ("sphere", "slab")


def monte_carlo_installed() -> bool:
    """Whether numba is."""
    return importlib.util.find_spec("numba") is not None


MODELS = (
    Method(
        "dipole alone",
        "",
        (0.0,),
        _of_half_space(lambda medium, depth, rho: dipole.flux(medium, depth=depth, rho=rho)),
        lambda scene: scene.in_points,
    ),
    Method(
        "half-space alone",
        "",
        (0.0,),
        _of_half_space(lambda medium, depth, rho: half_space.point_exitance(medium, depth=depth, rho=rho)),
        lambda scene: scene.in_points,
    ),
)
MONTE_CARLO = Method(
    "Monte Carlo (radiative transfer)",
    "photons",
    (10_000.0, 100_000.0, 1_000_000.0),
    _monte_carlo,
    _monte_carlo_fits,
    comparable=False,
)
