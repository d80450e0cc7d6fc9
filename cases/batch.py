"""Several case files, one after the other: all are checked before the first is run."""

import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.cases.run import Report, run_case
from tetlux.cases.shipped import find_case_file
from tetlux.cases.write.publish import check_writable
from tetlux.meshing.errors import InputError, TetluxError

# Runs that are named beside a warning that some of a sweep have; those of more are in their summaries.
FEW = 3


def load_all(requests: Sequence[str]) -> list[Case]:
    """The cases of all case files.

    Raises
    ------
    InputError
        If any of them is wrong, or two would write into one folder.
    """
    cases = [case for request in requests for case in load_cases(find_case_file(request))]
    seen: dict[str, Path] = {}
    for case in cases:
        if case.name in seen:
            if seen[case.name] == case.source:
                raise InputError(f"{case.source} is given twice; give it once.")
            raise InputError(
                f'{seen[case.name]} and {case.source} both make a case named "{case.name}"; give one another name.'
            )
        seen[case.name] = case.source
    return cases


def check_all(requests: Sequence[str]) -> int:
    """Print for each case file whether it can run; 0 if all are, else 2."""
    wrong = 0
    for request in requests:
        try:
            cases = load_cases(find_case_file(request))
        except InputError as error:
            print(f"tetlux: {error}", file=sys.stderr)
            wrong += 1
            continue
        first, surface = cases[0], cases[0].surface
        runs = "" if len(cases) == 1 else f"{len(cases)} runs, "
        if len(first.channels) > 1:
            runs += f"channels {', '.join(first.channel_names)}; "
        size = " x ".join(f"{length:.4g}" for length in np.ptp(surface.points, axis=0))
        print(f"{request}: ok: {runs}{_size(first)}, {size} {surface.unit}")
        for note in (*_labels(first), *first.repairs, *surface.warnings, *first.region_warnings):
            print(f"  {note}")
    return 2 if wrong else 0


def _size(case: Case) -> str:
    if case.mesh is None:
        return f"{len(case.surface.faces):,} triangles"
    return f"{len(case.mesh.points):,} nodes, {len(case.mesh.tetrahedra):,} tetrahedra"


def _labels(case: Case) -> list[str]:
    """What a mesh that is given consists of, and what is to be known of it."""
    if case.mesh is None:
        return []
    mesh = case.mesh
    lines = []
    for label, volume in mesh.region_volumes.items():
        count = int((mesh.regions == label).sum())
        lines.append(f"label {mesh.named([label])}: {count:,} tetrahedra, {volume:.4g} {mesh.unit}³")
    return [*lines, *mesh.warnings]


def run_all(cases: Sequence[Case], out: Path, *, cache: bool = True) -> int:
    """Run cases, with a line for each stage; 0 if all ran, 1 if some failed."""
    check_writable(out)
    failed = 0
    notes = _SweepNotes(cases)
    for number, case in enumerate(cases, 1):
        print(f"[{number}/{len(cases)}] {case.name}", flush=True)
        started = time.perf_counter()
        for note in case.repairs:
            print(f"  repaired: {note}")

        def report(line: str, started: float = started) -> None:
            print(f"  {time.perf_counter() - started:6.1f} s  {line}", flush=True)

        try:
            folder = run_case(case, out, report, cache=cache, note=notes.of(case, report))
        except TetluxError as error:
            failed += 1
            print(f"tetlux: {case.name} failed: {error}", file=sys.stderr, flush=True)
        else:
            report(f"written to {folder}")
        notes.tell_after(case)
    if failed:
        print(f"tetlux: {failed} of {len(cases)} cases failed.", file=sys.stderr)
    return 1 if failed else 0


class _SweepNotes:
    """Warnings of the runs of a sweep, each said once, when the last of its runs has ended.

    Those of a case that is no sweep are reported as they come.
    """

    def __init__(self, cases: Sequence[Case]) -> None:
        self._left = Counter(case.source for case in cases)
        self._runs = dict(self._left)
        self._found: dict[str, list[str]] = {}

    def of(self, case: Case, report: Report) -> Report:
        """What is to be called with each warning of a run."""
        if self._runs[case.source] == 1:
            return lambda warning: report(f"note: {warning}")
        return lambda warning: self._found.setdefault(warning, []).append(case.name)

    def tell_after(self, case: Case) -> None:
        """Say what was found, if this was the last run of its sweep."""
        self._left[case.source] -= 1
        if self._left[case.source] > 0:
            return
        runs = self._runs[case.source]
        for warning, names in self._found.items():
            where = f"all {runs} runs" if len(names) == runs else f"{len(names)} of {runs} runs"
            few = f" ({', '.join(names)})" if len(names) <= FEW and len(names) < runs else ""
            print(f"note, in {where}{few}: {warning}", flush=True)
        self._found = {}
