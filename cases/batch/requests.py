"""Runs of several case files, one after the other: all files are checked before the first is run."""

import glob
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.cases.file.reader import FilesRead
from tetlux.cases.run import Report, run_case
from tetlux.cases.shipped import find_case_files
from tetlux.cases.write.publish import check_writable
from tetlux.meshing.errors import InputError, TetluxError

# A warning names its runs of a sweep if they are no more than this; summaries always hold it.
MOST_NAMED = 3


def load_all(requests: Sequence[str]) -> list[Case]:
    """Read all case files and check that their cases have different names.

    Parameters
    ----------
    requests : sequence of str
        Case files, patterns of them, or names of those that ship.

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
    cases = [case for path in paths for case in load_cases(path, files)]
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


def check_all(requests: Sequence[str]) -> int:
    """Print for each case file whether it is valid, and what it describes.

    Parameters
    ----------
    requests : sequence of str
        Case files, patterns of them, or names of those that ship.

    Returns
    -------
    int
        0 if all are valid, else 2.
    """
    wrong = 0
    files = FilesRead()
    for request in requests:
        try:
            for path in find_case_files(request):
                cases = load_cases(path, files)
                print(f"{path if glob.has_magic(request) else request}: ok: {_describe(cases)}")
                for note in _notes_of(cases[0]):
                    print(f"  {note}")
        except InputError as error:
            print(f"tetlux: {error}", file=sys.stderr)
            wrong += 1
    return 2 if wrong else 0


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
        lines.append(f"label {mesh.named([label])}: {count:,} tetrahedra, {volume:.4g} {mesh.unit}³")
    return [*lines, *mesh.warnings]


def run_all(cases: Sequence[Case], out: Path, *, cache: bool = True) -> int:
    """Run cases, and print a line for each stage.

    Parameters
    ----------
    cases : sequence of Case
    out : Path
        Folder of all results.
    cache : bool
        Whether meshes are looked up and kept in the user's cache directory.

    Returns
    -------
    int
        0 if all ran, 1 if some failed.

    Raises
    ------
    InputError
        If `out` cannot be written to.
    """
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
            folder = run_case(case, out, report, cache=cache, note=notes.collector_for(case, report))
        except TetluxError as error:
            failed += 1
            print(f"tetlux: {case.name} failed: {error}", file=sys.stderr, flush=True)
        else:
            report(f"written to {folder}")
        notes.report_after(case)
    if failed:
        print(f"tetlux: {failed} of {len(cases)} cases failed.", file=sys.stderr)
    return 1 if failed else 0


class _SweepNotes:
    """Collects the warnings of the runs of a sweep, and prints each once when the last run has ended.

    Warnings of a case without a sweep are printed at once.
    """

    def __init__(self, cases: Sequence[Case]) -> None:
        self._runs_left = Counter(case.source for case in cases)
        self._runs = dict(self._runs_left)
        self._cases_by_warning: dict[str, list[str]] = {}

    def collector_for(self, case: Case, report: Report) -> Report:
        """The function to call with each warning of a run."""
        if self._runs[case.source] == 1:
            return lambda warning: report(f"note: {warning}")
        return lambda warning: self._cases_by_warning.setdefault(warning, []).append(case.name)

    def report_after(self, case: Case) -> None:
        """Print the warnings of a sweep, if this was its last run."""
        self._runs_left[case.source] -= 1
        if self._runs_left[case.source] > 0:
            return
        runs = self._runs[case.source]
        for warning, names in self._cases_by_warning.items():
            where = f"all {runs} runs" if len(names) == runs else f"{len(names)} of {runs} runs"
            named = f" ({', '.join(names)})" if len(names) <= MOST_NAMED and len(names) < runs else ""
            print(f"note, in {where}{named}: {warning}", flush=True)
        self._cases_by_warning = {}
