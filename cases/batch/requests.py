"""Reads the case files of a batch, all before the first run, and describes them."""

import glob
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from tetlux.cases.batch.describe import describe_plan, print_plan
from tetlux.cases.batch.grouping import make_plan
from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.cases.file.reader import FilesRead
from tetlux.cases.planning import AUTO, plan_groups, plan_models
from tetlux.cases.shipped import find_case_files
from tetlux.meshing.errors import InputError


def load_all(requests: Sequence[str], expect: Callable[[int], None] = lambda _: None) -> list[Case]:
    """Read all case files and check that their cases have different names.

    Parameters
    ----------
    requests : sequence of str
        Case files, patterns of them, or names of those that ship.
    expect : callable
        Called with numbers of runs of which there will be at least so many, before they have been checked.

    Returns
    -------
    list of Case

    Raises
    ------
    InputError
        If a case file is wrong, or two cases would write into one folder.
    """
    files = FilesRead()
    paths = [path for request in requests for path in find_case_files(request)]
    cases: list[Case] = []
    for done, path in enumerate(paths, 1):
        others = len(cases) + len(paths) - done
        cases += load_cases(path, files, partial(_expect, expect, others))
    sources: dict[str, Path] = {}
    for case in cases:
        if case.name in sources:
            if sources[case.name] == case.source:
                raise InputError(f"{case.source} is given twice; give it once.")
            raise InputError(
                f'{sources[case.name]} and {case.source} both make a case named "{case.name}"; rename one of them.'
            )
        sources[case.name] = case.source
    return cases


def _expect(expect: Callable[[int], None], others: int, runs: int) -> None:
    expect(others + runs)


def check_all(requests: Sequence[str], *, plan: bool = False) -> int:
    """Print for each case file whether it is valid and what it describes, and what all runs together amount to.

    Parameters
    ----------
    requests : sequence of str
        Case files, patterns of them, or names of those that ship.
    plan : bool
        Whether to print, as JSON and nothing else, how a batch of them would be run.

    Returns
    -------
    int
        0 if all are valid, else 2.
    """
    if plan:
        print_plan(make_plan(plan_models(load_all(requests))))
        return 0
    wrong = 0
    files = FilesRead()
    valid: list[Case] = []
    for request in requests:
        try:
            for path in find_case_files(request):
                cases = load_cases(path, files)
                valid += cases
                print(f"{path if glob.has_magic(request) else request}: ok: {_describe(cases)}")
                for note in _notes_of(cases[0]):
                    print(f"  {note}")
        except InputError as error:
            print(f"tetlux: {error}", file=sys.stderr)
            wrong += 1
    if len(valid) > 1:
        valid = plan_models(valid)
        print(describe_plan(make_plan(valid), valid))
    return 2 if wrong else 0


def print_models(requests: Sequence[str]) -> int:
    """Print how `model: auto` would solve the runs of case files, a plan for each group of like runs; return 0."""
    for case, plan in plan_groups(load_all(requests)):
        model, others = case.spec.model, f" and {plan.runs - 1:,} others" if plan.runs > 1 else ""
        print(f"{case.name}{others}: {plan}")
        if model not in (AUTO, plan.chosen):
            print(f"  the case names model {model}, which is taken")
    return 0


def _describe(cases: Sequence[Case]) -> str:
    """The runs of a case file, and the channels and size of the first."""
    first, surface = cases[0], cases[0].surface
    runs = "" if len(cases) == 1 else f"{len(cases)} runs, "
    if len(first.channels) > 1:
        runs += f"channels {', '.join(first.channel_names)}; "
    size = " x ".join(f"{length:.4g}" for length in np.ptp(surface.points, axis=0))
    return f"{runs}{_size(first)}, {size} {surface.unit}"


def _notes_of(case: Case) -> tuple[str, ...]:
    return (*_describe_mesh(case), *case.repairs, *case.surface.warnings, *case.region_warnings)


def _size(case: Case) -> str:
    """The size of the surface, or of the mesh if the case gives one."""
    if case.mesh is None:
        return f"{len(case.surface.faces):,} triangles"
    return f"{len(case.mesh.points):,} nodes, {len(case.mesh.tetrahedra):,} tetrahedra"


def _describe_mesh(case: Case) -> list[str]:
    """The labels of a mesh that the case gives, and the warnings about that mesh."""
    if case.mesh is None:
        return []
    mesh = case.mesh
    lines = []
    for label, volume in mesh.region_volumes.items():
        count = int((mesh.regions == label).sum())
        lines.append(f"label {mesh.label_text([label])}: {count:,} tetrahedra, {volume:.4g} {mesh.unit}³")
    return [*lines, *mesh.warnings]
