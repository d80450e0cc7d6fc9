"""What a method of the chart is, and what one run of it gives."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from tetlux.cases.chart.benchmark import Benchmark
from tetlux.meshing.arrays import FloatArray

# Runs that take longer than this together, seconds, are not repeated.
REPEAT_SECONDS = 2.0
# A tolerance that is measured against a finer run is no less than so many times that run's own error.
COARSER = 3.0


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one run of a method gave.

    Attributes
    ----------
    exitance : (n,) ndarray
        At the samples of the benchmark, W/unit².
    seconds : float
        From the surface in memory to the exitance at the surface.
    unknowns, tetrahedra : int or None
        None for what has no mesh.
    estimate : float or None
        What the method itself believes its error to be.
    """

    exitance: FloatArray
    seconds: float
    unknowns: int | None = None
    tetrahedra: int | None = None
    estimate: float | None = None


@dataclass(frozen=True)
class Method:
    """A way to the exitance, with one number that sets its resolution.

    Attributes
    ----------
    name : str
    parameter : str
        What the number is called.
    ladder : tuple of float
        Its values, the coarsest first.
    run : callable
        One run on a benchmark.
    fits : callable
        Whether it can do a benchmark.
    comparable : bool
        False if what is called its error is a difference of models: it does not compete for the front then.
    quick : int
        How many of the values a quick chart takes.
    warm_up : callable
        What is done once, untimed, before the first run on a benchmark.
    """

    name: str
    parameter: str
    ladder: tuple[float, ...]
    run: Callable[[Benchmark, float], Outcome]
    fits: Callable[[Benchmark], bool] = lambda _: True
    comparable: bool = True
    quick: int = 1
    warm_up: Callable[[Benchmark], object] = lambda _: None

    def label(self, value: float) -> str:
        """The parameter and a value of it, as in ``tolerance=0.02``."""
        return f"{self.parameter}={value:.10g}" if self.parameter else ""

    def ladder_for(self, benchmark: Benchmark, *, quick: bool = False) -> tuple[float, ...]:
        """The values that the reference of a benchmark is good enough for; a few of them if `quick`."""
        least = COARSER * benchmark.reference.error if self.parameter == "tolerance" else 0.0
        values = tuple(value for value in self.ladder if value >= least)
        return values[: self.quick] if quick else values


def fastest_run(benchmark: Benchmark, run: Callable[[], Outcome]) -> Outcome:
    """Repeat a short run as often as the benchmark says, within `REPEAT_SECONDS`, and return the fastest."""
    started, outcomes = time.perf_counter(), [run()]
    while len(outcomes) < benchmark.repeats and time.perf_counter() - started < REPEAT_SECONDS:
        outcomes.append(run())
    return min(outcomes, key=lambda outcome: outcome.seconds)
