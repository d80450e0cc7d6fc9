"""Runs of methods on a benchmark, with their Pareto front and exponents."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from tetlux.cases.chart.benchmark import Benchmark
from tetlux.cases.chart.methods import Method, Outcome
from tetlux.cases.chart.statistics import fit_exponent, pareto_front
from tetlux.meshing.errors import TetluxError

# A method is not run at finer resolutions after a run that took longer than this, and than what its coarsest run took
# in addition (a mesher's time hardly depends on the resolution), unless that was slow itself; seconds.
LONGEST_RUN, SLOW_START = 8.0, 30.0


@dataclass(frozen=True)
class Measurement:
    """One run of a method: a row of ``chart.csv``.

    Attributes
    ----------
    case, method, parameter : str
    seconds : float
        From the surface in memory to the exitance at the surface, meshing included, the mesh cache off.
    unknowns, tetrahedra : int or None
    error : float
        Relative L2 error of the exitance over the surface, against the reference.
    estimate : float or None
        The method's own estimate of its error.
    on_front : bool or None
        Whether no other run was both faster and more accurate; None for methods that do not compete.
    reference : str
        "closed form" or "finer run".
    """

    case: str
    method: str
    parameter: str
    seconds: float
    unknowns: int | None
    tetrahedra: int | None
    error: float
    estimate: float | None
    on_front: bool | None
    reference: str


@dataclass(frozen=True, eq=False)
class MeasuredBenchmark:
    """A benchmark and the runs on it."""

    benchmark: Benchmark
    runs: list[Measurement]


def measure_methods(
    benchmark: Benchmark, methods: Sequence[Method], *, quick: bool, report: Callable[[str], None]
) -> list[Measurement]:
    """Run all methods that apply to a benchmark, each from coarse to fine."""
    runs: list[Measurement] = []
    competing: list[int] = []
    for method in methods:
        if not method.fits(benchmark):
            continue
        for run in _measure(benchmark, method, quick=quick, report=report):
            if method.comparable:
                competing.append(len(runs))
            runs.append(run)
    front = pareto_front([runs[i].seconds for i in competing], [runs[i].error for i in competing])
    for index, on_front in zip(competing, front.tolist(), strict=True):
        runs[index] = replace(runs[index], on_front=on_front)
    return runs


def _measure(
    benchmark: Benchmark, method: Method, *, quick: bool, report: Callable[[str], None]
) -> Iterator[Measurement]:
    """Run one method, from coarse to fine, until a run takes too long."""
    method.warm_up(benchmark)
    longest: float | None = None
    for value in method.values_for(benchmark, quick=quick):
        name = f"{method.name} {method.label(value)}".strip()
        try:
            outcome = method.run(benchmark, value)
        except TetluxError as failure:
            report(f"  {name}: failed: {failure}")
            continue
        error = benchmark.error_of(outcome.exitance)
        if not math.isfinite(error):
            report(f"  {name}: failed: its exitance is not finite")
            continue
        size = "" if outcome.unknowns is None else f", {outcome.unknowns:,} unknowns"
        report(f"  {name}: {outcome.seconds:.3g} s, error {error:.2%}{size}")
        yield _row(benchmark, method, value, outcome, error)
        if longest is None:
            longest = LONGEST_RUN + (outcome.seconds if outcome.seconds < SLOW_START else 0.0)
        if outcome.seconds > longest:
            break


def _row(benchmark: Benchmark, method: Method, value: float, outcome: Outcome, error: float) -> Measurement:
    return Measurement(
        benchmark.case.name,
        method.name,
        method.label(value),
        outcome.seconds,
        outcome.unknowns,
        outcome.tetrahedra,
        error,
        outcome.estimate,
        None,
        benchmark.reference.kind,
    )


def exponents(runs: Sequence[Measurement]) -> dict[str, dict[str, float | None]]:
    """Fit for each method the exponents p of ``error ~ unknowns^p`` and ``seconds ~ unknowns^p``; None if it cannot."""
    found = {}
    for name in dict.fromkeys(run.method for run in runs):
        sized = [run for run in runs if run.method == name and run.unknowns is not None]
        unknowns = [float(run.unknowns or 0) for run in sized]
        found[name] = {
            "error": fit_exponent(unknowns, [run.error for run in sized]),
            "seconds": fit_exponent(unknowns, [run.seconds for run in sized]),
        }
    return found
