"""Methods of the chart: the finite elements of this project, plain and with what it adds to them."""

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
    """Time what makes a solution of a surface."""

    def run() -> Outcome:
        # A copy that has nothing cached from earlier runs.
        surface = replace(benchmark.case.surface)
        started = time.perf_counter()
        solution = solution_for(surface)
        solution.exitance  # noqa: B018 - computed when first asked for
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
    """Runs on a mesh that is made first, whatever the error."""

    def run(benchmark: Benchmark, value: float) -> Outcome:
        case = benchmark.case

        def solution_for(surface: Surface) -> Solution:
            mesh = mesh_for(benchmark, surface, value)
            return solve(surface, case.medium, case.lights, mesh=mesh, subtract=subtract)

        return _time_solution(benchmark, solution_for)

    return run


def _uniform_mesh(_benchmark: Benchmark, surface: Surface, refinements: float) -> TetMesh:
    mesh = tetrahedralize(surface, cache=False)
    for _ in range(int(refinements)):
        mesh = refine(mesh, np.ones(len(mesh.tetrahedra), dtype=bool), surface)
    return mesh


def graded_mesh(benchmark: Benchmark, surface: Surface, longest: float) -> TetMesh:
    """A mesh whose edges are no longer than `longest` times their distance from the light."""
    mesh = tetrahedralize(surface, cache=False)
    return grade_mesh(mesh, surface, *benchmark.lit, MOST_TETRAHEDRA, longest=longest)


def _adaptive(subtract: Subtract) -> Callable[[Benchmark, float], Outcome]:
    """Runs that refine until their own estimate meets a tolerance."""

    def run(benchmark: Benchmark, tolerance: float) -> Outcome:
        case = benchmark.case

        def solution_for(surface: Surface) -> Solution:
            return solve(
                surface,
                case.medium,
                case.lights,
                tolerance=tolerance,
                subtract=subtract,
                most_tetrahedra=MOST_TETRAHEDRA,
                cache=False,
            )

        return _time_solution(benchmark, solution_for)

    return run


def _in_points(benchmark: Benchmark) -> bool:
    return benchmark.in_points


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
    Method("free-space subtracted, adaptive", "tolerance", (*TOLERANCES, 0.005), _adaptive("free-space"), _in_points),
    Method(
        "half-space subtracted, uniform", "refinements", REFINEMENTS, _on_mesh(_uniform_mesh, "half-space"), _in_points
    ),
    Method(OURS, "tolerance", (0.05, 0.02, 0.01, 0.005, 0.002, 0.001), _adaptive("half-space"), quick=2),
)
