"""`measure`: solve a scenario with a variant of the solver, and compute what it is judged by."""

import time
from dataclasses import dataclass

import numpy as np

from tetlux.cases.chart.samples import relative_error
from tetlux.cases.stress.scenarios import TOLERANCE, Scenario, Truth
from tetlux.cases.stress.variants import Variant
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.solve import solve
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.mesher.api import tetrahedralize

# Limit of the adaptive runs, low since the map shows failures and not how fine a mesh can get.
MOST_TETRAHEDRA = 30_000


@dataclass(frozen=True)
class Diagnostics:
    """What a solution is judged by.

    Attributes
    ----------
    lowest : float
        Smallest fluence at a node, as a share of the largest.
    overshoot : float or None
        Largest fluence at a node divided by the bound of the maximum principle, minus 1.
    ledger : float
        Missing power, as a share of the incident power.
    residual : float
        Largest relative residual of the linear systems on the last mesh, recomputed from their solutions.
    iterations : int
        Most iterations of one of these systems.
    estimate : float
        Estimated relative L2 error of the exitance.
    error : float or None
        The true relative L2 error, if there is a closed form.
    scaling : float or None
        Largest difference from the exitance of the same scenario at unit scale, as a share of the largest exitance.
    finite : bool
        Whether fluence and exitance are finite everywhere.
    may_be_negative : bool
        Whether the exact solution itself may be negative.
    nodes : int
    seconds : float
    warnings : tuple of str
    """

    lowest: float
    overshoot: float | None
    ledger: float
    residual: float
    iterations: int
    estimate: float
    error: float | None
    scaling: float | None
    finite: bool
    may_be_negative: bool
    nodes: int
    seconds: float
    warnings: tuple[str, ...]


def measure(scenario: Scenario, variant: Variant) -> Diagnostics:
    """Solve a scenario and measure the solution."""
    started = time.perf_counter()
    solution = _solve(scenario, variant)
    seconds = time.perf_counter() - started
    highest = float(solution.fluence.max())
    return Diagnostics(
        lowest=float(solution.fluence.min()) / highest,
        overshoot=None if scenario.bound is None else highest / scenario.bound - 1.0,
        ledger=solution.power.balance_error,
        residual=solution.residual,
        iterations=solution.iterations,
        estimate=solution.error_estimate,
        error=None if scenario.truth is None else _true_error(solution, scenario.truth),
        scaling=None if scenario.unit_scale is None else _scaling_error(solution, _solve(scenario.unit_scale, variant)),
        finite=bool(np.isfinite(solution.fluence).all() and np.isfinite(solution.exitance).all()),
        may_be_negative=scenario.may_be_negative,
        nodes=len(solution.mesh.points),
        seconds=seconds,
        warnings=tuple(solution.warnings),
    )


def _solve(scenario: Scenario, variant: Variant) -> Solution:
    mesh = scenario.mesh
    if mesh is None and not variant.adaptive:
        mesh = tetrahedralize(scenario.surface, [region.surface for region in scenario.regions])
    return solve(
        scenario.surface,
        scenario.medium,
        [scenario.light],
        regions=scenario.regions,
        mesh=mesh,
        tolerance=TOLERANCE,
        most_tetrahedra=MOST_TETRAHEDRA,
        **variant.options,
    )


def _true_error(solution: Solution, truth: Truth) -> float:
    samples, exitance = truth
    # Scaled by the largest value: in an opaque body the square of the exitance would underflow.
    largest = float(exitance.max())
    values = solution.exitance_at(samples.points)
    with np.errstate(over="ignore"):
        return relative_error(values / largest, exitance / largest, samples.weights)


def _scaling_error(solution: Solution, unit_scale: Solution) -> float:
    here, there = _dimensionless_exitance(solution), _dimensionless_exitance(unit_scale)
    return float(np.abs(here - there).max() / np.abs(there).max())


def _dimensionless_exitance(solution: Solution) -> FloatArray:
    """Exitance at the nodes divided by the mean exitance if all power left."""
    return np.asarray(solution.exitance * (solution.mesh.area / solution.power.incident))
