"""The method of the chart that leaves the choice to the plan: ``solve(..., model="auto")``."""

import time
from dataclasses import replace

from tetlux.cases.chart.benchmark import Benchmark
from tetlux.cases.chart.methods import Method, Outcome, fastest_run
from tetlux.fem import solve


def _by_plan(benchmark: Benchmark, tolerance: float) -> Outcome:
    """Plan, and solve by the model that is chosen."""
    case = benchmark.case

    def run() -> Outcome:
        # A copy, which has no cached results of earlier runs.
        surface = replace(case.surface)
        started = time.perf_counter()
        solution = solve(
            surface,
            case.medium,
            case.lights,
            regions=benchmark.regions,
            tolerance=tolerance,
            model="auto",
            cache=False,
        )
        exitance = solution.exitance_at(benchmark.samples.points)
        seconds, mesh = time.perf_counter() - started, solution.mesh
        if mesh is None:
            return Outcome(exitance, seconds, None, None, solution.error_estimate)
        return Outcome(exitance, seconds, len(mesh.points), len(mesh.tetrahedra), solution.error_estimate)

    return fastest_run(benchmark, run)


# Not comparable: where the plan takes the series that is the reference, there is no error to compare.
PLANNED = Method("chosen by the plan", "tolerance", (0.05, 0.02, 0.005, 0.001), _by_plan, comparable=False, quick=2)
