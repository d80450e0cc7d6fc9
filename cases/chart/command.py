"""`tetlux chart`: run methods at several resolutions on the same benchmarks, and compare error and seconds."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from tetlux.cases.batch.requests import load_all
from tetlux.cases.chart.benchmark import prepare_benchmark, prepare_readings_benchmark
from tetlux.cases.chart.files import chart_files, write_chart
from tetlux.cases.chart.finite_elements import FINITE_ELEMENTS, READING_METHODS
from tetlux.cases.chart.meshless import CHARGES_FOR_READINGS, MESHLESS, MONTE_CARLO, has_monte_carlo
from tetlux.cases.chart.methods import Method
from tetlux.cases.chart.peers import PEERS
from tetlux.cases.chart.planned import PLANNED
from tetlux.cases.chart.runs import MeasuredBenchmark, measure_methods
from tetlux.cases.write.publish import check_writable
from tetlux.fem import Medium, PointSource, solve
from tetlux.meshing.errors import InputError, TetluxError
from tetlux.meshing.shapes import sphere

DEFAULT_CASES = ("slab", "sphere", "torus", "hare", "daylight")
DEFAULT_CASES_OF_READINGS = ("fibres", "finger", "head")
# Names of the files.
CHART, CHART_OF_READINGS = "chart", "chart-readings"


def chart(
    requests: Sequence[str],
    out: Path,
    *,
    readings: bool = False,
    quick: bool = False,
    report: Callable[[str], None] = print,
) -> int:
    """Compare methods on cases; write ``chart.csv``, ``chart.json`` and ``chart.png``.

    All three files are written again after each case.

    Parameters
    ----------
    requests : sequence of str
        Case files, or names of those that ship; if there are none, those of the chart in README.
    out : Path
        Folder of the three files.
    readings : bool
        Whether to compare what detectors read, and not the exitance over the surface; the files are then named
        ``chart-readings``.
    quick : bool
        Whether to run a few coarse resolutions of each method only.
    report : callable
        Called with a line of text for each run.

    Returns
    -------
    int
        0 if all cases were measured, 1 if some failed.

    Raises
    ------
    InputError
        If a case is wrong or has a sweep, or `out` cannot be written to.
    """
    cases = load_all(requests or (DEFAULT_CASES_OF_READINGS if readings else DEFAULT_CASES))
    name, prepare = (CHART_OF_READINGS, prepare_readings_benchmark) if readings else (CHART, prepare_benchmark)
    for case in cases:
        if case.sweep_values:
            raise InputError(f"{case.source} has a sweep, but a chart takes single scenes; leave sweep out.")
    check_writable(out)
    methods = _methods(report, readings=readings)
    _warm_up()
    measured: list[MeasuredBenchmark] = []
    failed = 0
    for case in cases:
        try:
            benchmark = prepare(case, quick=quick)
            count, reference = len(benchmark.samples.points), benchmark.reference.description
            points = "detectors" if readings else "sample points"
            report(f"{case.name}: {count:,} {points}; the reference is {reference}")
            measured.append(
                MeasuredBenchmark(benchmark, measure_methods(benchmark, methods, quick=quick, report=report))
            )
            write_chart(measured, out, name)
        except TetluxError as error:
            failed += 1
            print(f"tetlux: {case.name} failed: {error}", file=sys.stderr, flush=True)
    if failed < len(cases):
        report(f"written to {out}: {', '.join(chart_files(name))}")
    return 1 if failed else 0


def _methods(report: Callable[[str], None], *, readings: bool) -> list[Method]:
    """The methods that can run here; report those that cannot."""
    methods = [CHARGES_FOR_READINGS, *READING_METHODS] if readings else [*MESHLESS, *FINITE_ELEMENTS, PLANNED]
    for peer in PEERS:
        if peer.is_installed:
            methods += peer.methods
        else:
            report(f'{peer.name} is left out, since it is not installed; pip install "tetlux[peers]" installs it.')
    if readings:
        return methods
    if has_monte_carlo():
        methods.append(MONTE_CARLO)
    else:
        report('Monte Carlo is left out, since numba is not installed; pip install "tetlux[montecarlo]" installs it.')
    return methods


def _warm_up() -> None:
    """Make short runs first, so that imports do not count in the runs that are timed."""
    ball, medium = sphere(10.0, subdivisions=2), Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    for subtract in ("nothing", "half-space", "fitted"):
        solve(ball, medium, [PointSource((0.0, 0.0, 9.0))], tolerance=0.5, subtract=subtract, cache=False)
