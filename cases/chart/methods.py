"""`Method` of the chart, and the `Outcome` of one run."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from tetlux.cases.chart.benchmark import Benchmark
from tetlux.meshing.arrays import FloatArray

# A run is not repeated once its repetitions have taken this long together, seconds.
REPEAT_SECONDS = 2.0
# A tolerance is at least this many times the error of the reference, if that is a finer run.
COARSER = 3.0


@dataclass(frozen=True, eq=False)
class Outcome:
    """The result of one run of a method.

    Attributes
    ----------
    exitance : (n,) ndarray
        Exitance at the samples of the benchmark, W/unit².
    seconds : float
        From the surface in memory to the exitance at the surface.
    unknowns, tetrahedra : int or None
        None without a mesh.
    estimate : float or None
        The method's own estimate of its error.
    """

    exitance: FloatArray
    seconds: float
    unknowns: int | None = None
    tetrahedra: int | None = None
    estimate: float | None = None


@dataclass(frozen=True)
class Method:
    """A way to compute the exitance, with one number that sets its resolution.

    Attributes
    ----------
    name : str
    parameter : str
        Name of that number.
    values : tuple of float
        Its values, the coarsest first.
    run : callable
        Makes one run on a benchmark.
    fits : callable
        Whether the method applies to a benchmark.
    comparable : bool
        False if its error is a difference between models, which keeps it out of the Pareto front.
    quick : int
        How many of the values a quick chart takes.
    warm_up : callable
        Called once, untimed, before the first run on a benchmark.
    """

    name: str
    parameter: str
    values: tuple[float, ...]
    run: Callable[[Benchmark, float], Outcome]
    fits: Callable[[Benchmark], bool] = lambda _: True
    comparable: bool = True
    quick: int = 1
    warm_up: Callable[[Benchmark], object] = lambda _: None

    def label(self, value: float) -> str:
        """Format the parameter and a value, as in ``tolerance=0.02``."""
        return f"{self.parameter}={value:.10g}" if self.parameter else ""

    def values_for(self, benchmark: Benchmark, *, quick: bool = False) -> tuple[float, ...]:
        """The values for which the reference of a benchmark is accurate enough; if `quick`, the first few."""
        compared = "detector tolerance" if benchmark.detectors else "tolerance"
        least = COARSER * benchmark.reference.error if self.parameter == compared else 0.0
        values = tuple(value for value in self.values if value >= least)
        return values[: self.quick] if quick else values


def fastest_run(benchmark: Benchmark, run: Callable[[], Outcome]) -> Outcome:
    """Repeat a short run as often as the benchmark says, within `REPEAT_SECONDS`, and return the fastest."""
    started, outcomes = time.perf_counter(), [run()]
    while len(outcomes) < benchmark.repeats and time.perf_counter() - started < REPEAT_SECONDS:
        outcomes.append(run())
    return min(outcomes, key=lambda outcome: outcome.seconds)
