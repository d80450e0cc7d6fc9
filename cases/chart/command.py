"""`tetlux chart`: methods over resolutions, on the same scenes, by one measure of seconds and of error."""

import csv
import json
import os
import platform
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tetlux.cases.batch import load_all
from tetlux.cases.chart.methods import FINITE_ELEMENTS, Method
from tetlux.cases.chart.models import MODELS, MONTE_CARLO, monte_carlo_installed
from tetlux.cases.chart.peers import PEERS
from tetlux.cases.chart.picture import draw_chart
from tetlux.cases.chart.runs import Charted, Run, exponents, runs_on
from tetlux.cases.chart.benchmark import scene_of, spec_of
from tetlux.cases.publish import cannot_write, check_writable, claimed, publish
from tetlux.cases.summary import LIBRARIES
from tetlux.fem import Medium, PointSource, solve
from tetlux.meshing.errors import InputError, TetluxError
from tetlux.meshing.shapes import sphere

DEFAULT_CASES = ("slab", "sphere", "torus", "hare")
FILES = ("chart.csv", "chart.png", "chart.json")


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
        if spec_of(case).sweep:
            raise InputError(f"{case.source} holds a sweep, and a chart is of single scenes; leave sweep out of it.")
    check_writable(out)
    methods = _methods(report)
    _warm_up()
    charted: list[Charted] = []
    failed = 0
    for case in cases:
        try:
            scene = scene_of(case, quick=quick)
            report(f"{case.name}: {len(scene.samples.points):,} places; the reference is {scene.reference.told}")
            charted.append(Charted(scene, runs_on(scene, methods, quick=quick, report=report)))
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


def write_chart(charted: Sequence[Charted], out: Path) -> None:
    """Write the three files, whole: into a folder beside them first.

    Raises
    ------
    RunError
        If they cannot be written.
    """
    with claimed(out, ".") as folder:
        try:
            _write_table([run for one in charted for run in one.runs], folder / "chart.csv")
            draw_chart(charted, folder / "chart.png")
            text = json.dumps(as_data(charted), indent=2, allow_nan=False)
            (folder / "chart.json").write_text(text + "\n", encoding="utf-8")
            publish(folder, out, FILES)
        except OSError as error:
            raise cannot_write(out, error) from error


def _write_table(runs: Sequence[Run], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Run)])
        writer.writeheader()
        writer.writerows(asdict(run) for run in runs)


def as_data(charted: Sequence[Charted]) -> dict[str, Any]:
    """The chart as plain data."""
    return {
        "cases": {
            one.scene.case.name: {
                "unit": one.scene.case.surface.unit,
                "triangles": len(one.scene.case.surface.faces),
                "samples": len(one.scene.samples.points),
                "reference": {
                    "kind": one.scene.reference.kind,
                    "is": one.scene.reference.told,
                    "error": one.scene.reference.error,
                },
                "exponents": exponents(one.runs),
            }
            for one in charted
        },
        "runs": [asdict(run) for one in charted for run in one.runs],
        "seconds": "from the surface in memory to the exitance at the surface; imports and the mesh cache do not count",
        "error": "relative L2 error of the exitance over the samples of the surface; for Monte Carlo, which solves "
        "radiative transfer, the difference of the two models",
        "machine": {"cores": os.cpu_count(), "processor": platform.machine()},
        "versions": {"python": platform.python_version()}
        | {name: version(name) for name in LIBRARIES}
        | {peer.package: version(peer.package) for peer in PEERS if peer.installed},
    }
