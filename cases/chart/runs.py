"""Runs of methods on a scene, and what they add up to: the front of the best, and exponents."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from tetlux.cases.chart.measure import fitted_exponent, pareto_front
from tetlux.cases.chart.methods import Method
from tetlux.cases.chart.models import MONTE_CARLO
from tetlux.cases.chart.benchmark import Scene
from tetlux.meshing.errors import TetluxError

# After a run that took longer than this, seconds, nothing finer of its method is run.
LONGEST_RUN = 8.0


@dataclass(frozen=True)
class Run:
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
        What the method believes its error to be.
    on_front : bool or None
        Whether no other run was both quicker and more accurate; None for what does not compete.
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
class Charted:
    """A scene and the runs on it."""

    scene: Scene
    runs: list[Run]


def runs_on(scene: Scene, methods: Sequence[Method], *, quick: bool, report: Callable[[str], None]) -> list[Run]:
    """Run the methods that fit a scene, each from coarse to fine."""
    runs: list[Run] = []
    competing: list[int] = []
    for method in methods:
        if not method.fits(scene):
            continue
        ladder = method.ladder_for(scene)
        if method is MONTE_CARLO:
            method.run(scene, 1.0)  # compiles it
        for value in ladder[: method.quick] if quick else ladder:
            name = f"{method.name} {method.labelled(value)}".strip()
            try:
                outcome = method.run(scene, value)
            except TetluxError as failure:
                report(f"  {name}: failed: {failure}")
                continue
            error = scene.error_of(outcome.exitance)
            if not math.isfinite(error):
                report(f"  {name}: failed: its exitance is not finite")
                continue
            if method.comparable:
                competing.append(len(runs))
            runs.append(
                Run(
                    scene.case.name,
                    method.name,
                    method.labelled(value),
                    outcome.seconds,
                    outcome.unknowns,
                    outcome.tetrahedra,
                    error,
                    outcome.estimate,
                    None,
                    scene.reference.kind,
                )
            )
            size = "" if outcome.unknowns is None else f", {outcome.unknowns:,} unknowns"
            report(f"  {name}: {outcome.seconds:.3g} s, error {error:.2%}{size}")
            if outcome.seconds > LONGEST_RUN:
                break
    front = pareto_front([runs[i].seconds for i in competing], [runs[i].error for i in competing])
    for index, on_front in zip(competing, front.tolist(), strict=True):
        runs[index] = replace(runs[index], on_front=on_front)
    return runs


def exponents(runs: Sequence[Run]) -> dict[str, dict[str, float | None]]:
    """By method: the exponents p of ``error ~ unknowns^p`` and ``seconds ~ unknowns^p``, where they can be fitted."""
    found = {}
    for name in dict.fromkeys(run.method for run in runs):
        sized = [run for run in runs if run.method == name and run.unknowns is not None]
        unknowns = [float(run.unknowns or 0) for run in sized]
        found[name] = {
            "error": fitted_exponent(unknowns, [run.error for run in sized]),
            "seconds": fitted_exponent(unknowns, [run.seconds for run in sized]),
        }
    return found
