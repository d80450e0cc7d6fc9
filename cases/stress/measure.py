"""`measure`: solve a scenario with a variant of the solver, and compute what it is judged by."""

import time
from dataclasses import dataclass, replace

import numpy as np

from tetlux.cases.chart.samples import relative_error
from tetlux.cases.stress.panels import Variant
from tetlux.cases.stress.scenes.readout import MOST_TETRAHEDRA, Readout, bars_of
from tetlux.cases.stress.scenes.scenarios import TOLERANCE, Scenario, Truth
from tetlux.fem import ChargeSolution, ClosedFormSolution
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.solve import solve
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.mesher.api import tetrahedralize

AnySolution = Solution | ChargeSolution | ClosedFormSolution


@dataclass(frozen=True, kw_only=True)
class Diagnostics:
    """What a solution is judged by.

    Attributes
    ----------
    lowest : float or None
        Smallest fluence at a node, as a share of the largest; None without nodes.
    overshoot : float or None
        Largest fluence at a node divided by the bound of the maximum principle, minus 1.
    ledger : float or None
        Missing power, as a share of the incident power; None without a mesh: of charges it is a measure of their
        error.
    residual : float or None
        Largest relative residual of the linear systems on the last mesh, recomputed from their solutions; None for
        charges.
    iterations : int
        Most iterations of one of these systems.
    estimate : float
        Estimated relative L2 error of the exitance; of readings, the error bar of the worst, infinite if it has none.
    error : float or None
        The true relative L2 error, if there is a closed form; of readings, that of the worst, which exceeds its
        allowance, the larger of the tolerance and twice its bar, by the largest factor.
    bound : float or None
        What the relative L2 error may not exceed, if the method promises that.
    scaling : float or None
        Largest difference from the exitance of the same scenario at unit scale, as a share of the largest exitance.
    finite : bool
        Whether fluence and exitance are finite everywhere.
    may_be_negative : bool
        Whether the exact solution itself may be negative.
    nodes : int
        Or charges.
    seconds : float
    warnings : tuple of str
    of_readings : bool
        Whether error and estimate are those of a reading.
    """

    lowest: float | None = None
    overshoot: float | None = None
    ledger: float | None = None
    residual: float | None = None
    iterations: int = 0
    estimate: float
    error: float | None = None
    scaling: float | None = None
    finite: bool
    may_be_negative: bool = False
    nodes: int
    seconds: float = 0.0
    warnings: tuple[str, ...] = ()
    bound: float | None = None
    of_readings: bool = False


def measure(scenario: Scenario, variant: Variant) -> Diagnostics:
    """Solve a scenario and measure the solution."""
    started = time.perf_counter()
    if scenario.read is not None and scenario.readings is not None:
        found = _of_readout(scenario.read(scenario), scenario.readings[1])
        return replace(found, seconds=time.perf_counter() - started)
    solution = _solve(scenario, variant)
    seconds = time.perf_counter() - started
    found = _of_mesh(solution, scenario) if isinstance(solution, Solution) else _without_mesh(solution)
    found = replace(found, seconds=seconds, warnings=tuple(solution.warnings), may_be_negative=scenario.may_be_negative)
    if scenario.readings is not None:
        error, bar = _worst_reading(*_readings_of(solution), scenario.readings[1])
        return replace(found, error=error, estimate=bar, bound=None, of_readings=True)
    if scenario.truth is not None:
        found = replace(found, error=_true_error(solution, scenario.truth))
    if scenario.unit_scale is not None:
        found = replace(found, scaling=_scaling_error(solution, _solve(scenario.unit_scale, variant)))
    return found


def _of_mesh(solution: Solution, scenario: Scenario) -> Diagnostics:
    highest = float(solution.fluence.max())
    return Diagnostics(
        lowest=float(solution.fluence.min()) / highest,
        overshoot=None if scenario.bound is None else highest / scenario.bound - 1.0,
        ledger=solution.power.balance_error,
        residual=solution.residual,
        iterations=solution.iterations,
        estimate=solution.error_estimate,
        finite=bool(np.isfinite(solution.fluence).all() and np.isfinite(solution.exitance).all()),
        nodes=len(solution.mesh.points),
    )


def _without_mesh(solution: ChargeSolution | ClosedFormSolution) -> Diagnostics:
    return Diagnostics(
        estimate=solution.error_estimate,
        finite=bool(np.isfinite(solution.exitance).all()),
        nodes=solution.charges if isinstance(solution, ChargeSolution) else 0,
        bound=solution.error_bound if np.isfinite(solution.error_bound) else None,
    )


def _of_readout(readout: Readout, truth: NumberArray) -> Diagnostics:
    error, bar = _worst_reading(readout.values, readout.bars, truth)
    return Diagnostics(
        estimate=bar,
        error=error,
        finite=bool(np.isfinite(readout.values).all()),
        may_be_negative=True,
        nodes=readout.nodes,
        warnings=readout.warnings,
        of_readings=True,
    )


def _readings_of(solution: AnySolution) -> tuple[FloatArray, FloatArray]:
    """What the detectors read, and its bars."""
    return np.array([reading.exitance for reading in solution.readings]), bars_of(solution.readings)


def _worst_reading(values: NumberArray, bars: FloatArray, truth: NumberArray) -> tuple[float, float]:
    """Error and bar of the reading that exceeds its allowance by most."""
    errors = np.abs(values / truth - 1.0)
    worst = int(np.lexsort((errors, errors / np.maximum(TOLERANCE, 2.0 * bars)))[-1])
    return float(errors[worst]), float(bars[worst])


def _solve(scenario: Scenario, variant: Variant) -> AnySolution:
    detectors = scenario.detectors
    options = {"model": "full", **variant.options}
    mesh = scenario.mesh
    if mesh is None and not variant.adaptive:
        mesh = tetrahedralize(scenario.surface, [region.surface for region in scenario.regions])
    if options["model"] in ("full", "auto"):
        options["most_tetrahedra"] = MOST_TETRAHEDRA
    solution: AnySolution = solve(
        scenario.surface,
        scenario.medium,
        [scenario.light],
        regions=scenario.regions,
        mesh=mesh,
        tolerance=None if detectors and options["model"] in ("full", "charges") else TOLERANCE,
        detectors=detectors,
        detector_tolerance=TOLERANCE if detectors else None,
        **options,
    )
    return solution


def _true_error(solution: AnySolution, truth: Truth) -> float:
    samples, exitance = truth
    # Scaled by the largest value: in an opaque body the square of the exitance would underflow.
    largest = float(exitance.max())
    values = solution.exitance_at(samples.points)
    with np.errstate(over="ignore"):
        return relative_error(values / largest, exitance / largest, samples.weights)


def _scaling_error(solution: AnySolution, unit_scale: AnySolution) -> float:
    here, there = _dimensionless_exitance(solution), _dimensionless_exitance(unit_scale)
    return float(np.abs(here - there).max() / np.abs(there).max())


def _dimensionless_exitance(solution: AnySolution) -> FloatArray:
    """Exitance at the nodes divided by the mean exitance if all power left."""
    area = solution.mesh.area if isinstance(solution, Solution) else solution.area
    return np.asarray(solution.exitance * (area / solution.power.incident))
