"""`tetlux chart`: methods over resolutions, on the same benchmarks, by one measure of seconds and of error."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from tetlux.cases.batch import load_all
from tetlux.cases.chart.benchmark import benchmark_of
from tetlux.cases.chart.files import FILES, write_chart
from tetlux.cases.chart.finite_elements import FINITE_ELEMENTS
from tetlux.cases.chart.methods import Method
from tetlux.cases.chart.models import MODELS, MONTE_CARLO, monte_carlo_installed
from tetlux.cases.chart.peers import PEERS
from tetlux.cases.chart.runs import Charted, measure_methods
from tetlux.cases.write.publish import check_writable
from tetlux.fem import Medium, PointSource, solve
from tetlux.meshing.errors import InputError, TetluxError
from tetlux.meshing.shapes import sphere

DEFAULT_CASES = ("slab", "sphere", "torus", "hare")


def chart(
    requests: Sequence[str],
    out: Path,
    *,
    quick: bool = False,
    report: Callable[[str], None] = print,
) -> int:
    """Measure methods on cases; write ``chart.csv``, ``chart.json`` and ``chart.png``.

    The files are written anew after each case, whole.

    Parameters
    ----------
    requests : sequence of str
        Case files, or names of those that ship.
    out : Path
        Folder of the three files.
    quick : bool
        A few coarse runs of each method only.
    report : callable
        Called with a line of text for each run.

    Returns
    -------
    int
        0 if all cases were measured, 1 if some failed.

    Raises
    ------
    InputError
        If a case is wrong or is a sweep, or `out` cannot be written to.
    """
    cases = load_all(requests)
    for case in cases:
        if case.sweep_values:
            raise InputError(f"{case.source} holds a sweep, and a chart is of single scenes; leave sweep out of it.")
    check_writable(out)
    methods = _methods(report)
    _warm_up()
    charted: list[Charted] = []
    failed = 0
    for case in cases:
        try:
            benchmark = benchmark_of(case, quick=quick)
            count, reference = len(benchmark.samples.points), benchmark.reference.description
            report(f"{case.name}: {count:,} places; the reference is {reference}")
            charted.append(Charted(benchmark, measure_methods(benchmark, methods, quick=quick, report=report)))
            write_chart(charted, out)
        except TetluxError as error:
            failed += 1
            print(f"tetlux: {case.name} failed: {error}", file=sys.stderr, flush=True)
    if failed < len(cases):
        report(f"written to {out}: {', '.join(FILES)}")
    return 1 if failed else 0


def _methods(report: Callable[[str], None]) -> list[Method]:
    """All that can be run here, with a line for what cannot."""
    methods = [*MODELS, *FINITE_ELEMENTS]
    for peer in PEERS:
        if peer.installed:
            methods += peer.methods
        else:
            report(f'{peer.name} is not installed and left out; pip install "tetlux[peers]" brings it.')
    if monte_carlo_installed():
        methods.append(MONTE_CARLO)
    else:
        report('Monte Carlo is left out: it needs numba; pip install "tetlux[montecarlo]" brings it.')
    return methods


def _warm_up() -> None:
    """Import what a first run would import, in runs that do not count."""
    ball, medium = sphere(10.0, subdivisions=2), Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    for subtract in ("nothing", "half-space"):
        solve(ball, medium, [PointSource((0.0, 0.0, 9.0))], tolerance=0.5, subtract=subtract, cache=False)
