"""Methods of the chart: tetlux's finite elements, plain and with grading, adaptivity and subtraction."""

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tetlux.cases.chart.benchmark import Benchmark
from tetlux.cases.chart.methods import Method, Outcome, fastest_run
from tetlux.fem.grading import grade_mesh
from tetlux.fem.known.split import Subtract
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.solve import solve
from tetlux.meshing.mesher.api import tetrahedralize
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.refine import refine

MOST_TETRAHEDRA = 2_000_000


def _time_solution(benchmark: Benchmark, solution_for: Callable[[Surface], Solution]) -> Outcome:
    """Time a function that solves on a surface."""

    def run() -> Outcome:
        # A copy, which has no cached results of earlier runs.
        surface = replace(benchmark.case.surface)
        started = time.perf_counter()
        solution = solution_for(surface)
        solution.exitance  # noqa: B018 - computed at first access
        seconds = time.perf_counter() - started
        return Outcome(
            solution.exitance_at(benchmark.samples.points),
            seconds,
            len(solution.mesh.points),
            len(solution.mesh.tetrahedra),
            solution.error_estimate,
        )

    return fastest_run(benchmark, run)


def _on_mesh(
    mesh_for: Callable[[Benchmark, Surface, float], TetMesh], subtract: Subtract
) -> Callable[[Benchmark, float], Outcome]:
    """Make a method that solves once, on a given kind of mesh."""

    def run(benchmark: Benchmark, value: float) -> Outcome:
        case = benchmark.case

        def solution_for(surface: Surface) -> Solution:
            mesh = mesh_for(benchmark, surface, value)
            return solve(surface, case.medium, case.lights, regions=benchmark.regions, mesh=mesh, subtract=subtract)

        return _time_solution(benchmark, solution_for)

    return run


def _uniform_mesh(benchmark: Benchmark, surface: Surface, refinements: float) -> TetMesh:
    inner = [region.surface for region in benchmark.regions]
    mesh = tetrahedralize(surface, inner, cache=False)
    for _ in range(int(refinements)):
        mesh = refine(mesh, np.ones(len(mesh.tetrahedra), dtype=bool), surface, inner)
    return mesh


def graded_mesh(benchmark: Benchmark, surface: Surface, longest: float) -> TetMesh:
    """Make a mesh whose edges are at most `longest` times their distance from the light."""
    inner = [region.surface for region in benchmark.regions]
    mesh = tetrahedralize(surface, inner, cache=False)
    return grade_mesh(mesh, surface, *benchmark.lit, MOST_TETRAHEDRA, longest=longest, inner=inner)


def _adaptive(subtract: Subtract) -> Callable[[Benchmark, float], Outcome]:
    """Make a method that refines until the estimated error meets a tolerance."""

    def run(benchmark: Benchmark, tolerance: float) -> Outcome:
        case = benchmark.case

        def solution_for(surface: Surface) -> Solution:
            return solve(
                surface,
                case.medium,
                case.lights,
                regions=benchmark.regions,
                tolerance=tolerance,
                subtract=subtract,
                most_tetrahedra=MOST_TETRAHEDRA,
                cache=False,
            )

        return _time_solution(benchmark, solution_for)

    return run


def _readings(benchmark: Benchmark, tolerance: float) -> Outcome:
    """Refine until the error bar of each reading meets a tolerance."""
    case = benchmark.case

    def run() -> Outcome:
        surface = replace(case.surface)
        started = time.perf_counter()
        solution = solve(
            surface,
            case.medium,
            case.lights,
            regions=benchmark.regions,
            tolerance=None,
            detectors=benchmark.detectors,
            detector_tolerance=tolerance,
            most_tetrahedra=MOST_TETRAHEDRA,
            cache=False,
        )
        seconds = time.perf_counter() - started
        bars = [math.nan if each.relative_error is None else each.relative_error for each in solution.readings]
        return Outcome(
            np.array([reading.exitance for reading in solution.readings]),
            seconds,
            len(solution.mesh.points),
            len(solution.mesh.tetrahedra),
            float(np.median(bars)),
        )

    return fastest_run(benchmark, run)


def _has_point_sources(benchmark: Benchmark) -> bool:
    return benchmark.has_point_sources


def _has_light_to_grade_to(benchmark: Benchmark) -> bool:
    return len(benchmark.lit[0]) > 0


REFINEMENTS = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
GRADINGS = (2.0, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18)
TOLERANCES = (0.2, 0.1, 0.05, 0.02, 0.01)
OURS = "tetlux"
FINITE_ELEMENTS = (
    Method("P1, uniform", "refinements", REFINEMENTS, _on_mesh(_uniform_mesh, "nothing")),
    Method(
        "P1, graded",
        "longest edge over distance",
        GRADINGS,
        _on_mesh(graded_mesh, "nothing"),
        _has_light_to_grade_to,
    ),
    Method("P1, adaptive", "tolerance", TOLERANCES, _adaptive("nothing"), quick=2),
    Method(
        "free-space subtracted, adaptive",
        "tolerance",
        (*TOLERANCES, 0.005),
        _adaptive("free-space"),
        _has_point_sources,
    ),
    Method(
        "half-space subtracted, uniform",
        "refinements",
        REFINEMENTS,
        _on_mesh(_uniform_mesh, "half-space"),
        _has_point_sources,
    ),
    Method(
        "half-space subtracted, adaptive",
        "tolerance",
        (0.05, 0.02, 0.01, 0.005, 0.002, 0.001),
        _adaptive("half-space"),
        _has_point_sources,
    ),
    Method(OURS, "tolerance", (0.05, 0.02, 0.01, 0.005, 0.002, 0.001), _adaptive("fitted"), quick=2),
)
# Methods of a chart of readings, where light has faded by decades and uniform meshes are of no use.
READING_METHODS = (
    *(method for method in FINITE_ELEMENTS if method.name in ("P1, graded", "P1, adaptive")),
    Method(
        "half-space subtracted, adaptive",
        "tolerance",
        (0.05, 0.02, 0.01, 0.005, 0.002),
        _adaptive("half-space"),
        _has_point_sources,
    ),
    Method(OURS, "detector tolerance", (0.1, 0.05, 0.02, 0.01, 0.005, 0.002), _readings, quick=2),
)
