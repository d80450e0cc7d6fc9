"""Methods of the chart without a mesh: charges fitted to the surface, the dipole, the half-space, and Monte Carlo."""

import importlib.util
import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tetlux.cases.chart.benchmark import Benchmark
from tetlux.cases.chart.methods import Method, Outcome, fastest_run
from tetlux.fem.exact import dipole, half_space, monte_carlo
from tetlux.fem.exact.registry import polar_angle
from tetlux.fem.media.medium import Medium
from tetlux.fem.solve import solve
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.solids import Slab, Sphere

# Monte Carlo scores in this many rings around the light; the first is this share of the source's depth wide.
RINGS, FIRST_RING = 60, 0.1


def _half_space_method(
    exitance: Callable[[Medium, float, FloatArray], FloatArray],
) -> Callable[[Benchmark, float], Outcome]:
    """Make a run of a closed form of the half-space, by distances from the surface point nearest to each source."""

    def run(benchmark: Benchmark) -> Outcome:
        surface, medium, points = benchmark.case.surface, benchmark.case.medium, benchmark.samples.points
        started = time.perf_counter()
        total = np.zeros(len(points))
        for source, power in benchmark.sources:
            foot = surface.project(source[None])[0][0]
            depth, rho = float(np.linalg.norm(foot - source)), np.linalg.norm(points - foot, axis=1)
            total += power * exitance(medium, depth, rho)
        return Outcome(total, time.perf_counter() - started)

    return lambda benchmark, _: fastest_run(benchmark, lambda: run(benchmark))


def _charges(benchmark: Benchmark, tolerance: float) -> Outcome:
    """Fit charges until their own estimate meets a tolerance."""

    def run() -> Outcome:
        # A copy, which has no cached results of earlier runs.
        surface = replace(benchmark.case.surface)
        started = time.perf_counter()
        solution = solve(
            surface,
            benchmark.case.medium,
            benchmark.case.lights,
            regions=benchmark.regions,
            model="charges",
            tolerance=tolerance,
            detectors=benchmark.detectors,
        )
        if not benchmark.detectors:
            solution.exitance  # noqa: B018 - computed at first access
        seconds = time.perf_counter() - started
        exitance = solution.exitance_at(benchmark.samples.points)
        return Outcome(exitance, seconds, solution.charges, None, solution.error_estimate)

    return fastest_run(benchmark, run)


def _monte_carlo(benchmark: Benchmark, photons: float) -> Outcome:
    """Solve radiative transfer from the same sources, isotropic points."""
    started, shape = time.perf_counter(), benchmark.shape
    total = np.zeros(len(benchmark.samples.points))
    for source, power in benchmark.sources:
        if isinstance(shape, Sphere):
            total += power * _monte_carlo_in_sphere(benchmark, shape, source, int(photons))
        else:
            assert isinstance(shape, Slab)
            total += power * _monte_carlo_in_slab(benchmark, shape, source, int(photons))
    return Outcome(total, time.perf_counter() - started)


def _monte_carlo_in_sphere(benchmark: Benchmark, shape: Sphere, source: FloatArray, photons: int) -> FloatArray:
    center = np.asarray(shape.center)
    depth = shape.radius - float(np.linalg.norm(source - center))
    angle = polar_angle(benchmark.samples.points, source, center)
    edges = np.append(0.0, np.geomspace(FIRST_RING * depth / shape.radius, math.pi, RINGS))
    result = monte_carlo.sphere(
        benchmark.case.medium, radius=shape.radius, light="point", depth=depth, edges=edges, photons=photons
    )
    return np.asarray(np.interp(angle, 0.5 * (edges[1:] + edges[:-1]), result.exitance))


def _monte_carlo_in_slab(benchmark: Benchmark, shape: Slab, source: FloatArray, photons: int) -> FloatArray:
    depth = -float(source[2])
    rho = np.hypot(*(benchmark.samples.points - source)[:, :2].T)
    edges = np.append(0.0, np.geomspace(FIRST_RING * depth, float(rho.max()), RINGS))
    result = monte_carlo.slab(
        benchmark.case.medium, thickness=shape.depth, light="point", depth=depth, edges=edges, photons=photons
    )
    middles = 0.5 * (edges[1:] + edges[:-1])
    front = benchmark.samples.normals[:, 2] > 0
    return np.where(front, np.interp(rho, middles, result.front), np.interp(rho, middles, result.back))


def _monte_carlo_fits(benchmark: Benchmark) -> bool:
    known = benchmark.reference.kind == "closed form" and isinstance(benchmark.shape, Sphere | Slab)
    return known and benchmark.has_point_sources


def _compile_monte_carlo(benchmark: Benchmark) -> Outcome:
    """Trace one photon, so that numba compiles."""
    return _monte_carlo(benchmark, 1.0)


def has_monte_carlo() -> bool:
    """Whether numba, which Monte Carlo needs, is installed."""
    return importlib.util.find_spec("numba") is not None


CHARGES = Method(
    "charges",
    "tolerance",
    (0.02, 0.005, 0.002, 0.001, 0.0005),
    _charges,
    lambda benchmark: benchmark.has_point_sources,
    quick=2,
)
# Readings far from the light need more charges than the exitance over the surface does.
CHARGES_FOR_READINGS = replace(CHARGES, values=(0.02, 0.001, 0.0005, 0.0002, 0.0001))
MESHLESS = (
    CHARGES,
    Method(
        "dipole alone",
        "",
        (0.0,),
        _half_space_method(lambda medium, depth, rho: dipole.flux(medium, depth=depth, rho=rho)),
        lambda benchmark: benchmark.has_point_sources,
    ),
    Method(
        "half-space alone",
        "",
        (0.0,),
        _half_space_method(lambda medium, depth, rho: half_space.point_exitance(medium, depth=depth, rho=rho)),
        lambda benchmark: benchmark.has_point_sources,
    ),
)
MONTE_CARLO = Method(
    "Monte Carlo (radiative transfer)",
    "photons",
    (10_000.0, 100_000.0, 1_000_000.0),
    _monte_carlo,
    _monte_carlo_fits,
    comparable=False,
    warm_up=_compile_monte_carlo,
)
