"""Several case files, one after the other: all are checked before the first is run."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tetlux.cases.case import Case, load_cases
from tetlux.cases.publish import check_writable
from tetlux.cases.run import run_case
from tetlux.cases.shipped import find_case_file
from tetlux.meshing.errors import InputError, TetluxError


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
    """Say of each case file whether it is right; 0 if all are, else 2."""
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
        print(f"{request}: right; {runs}{len(surface.faces):,} triangles, {size} {surface.unit}")
        for note in (*first.repairs, *surface.warnings, *first.region_warnings):
            print(f"  {note}")
    return 2 if wrong else 0


def run_all(cases: Sequence[Case], out: Path, *, cache: bool = True) -> int:
    """Run cases, with a line for each stage; 0 if all ran, 1 if some failed."""
    check_writable(out)
    failed = 0
    for number, case in enumerate(cases, 1):
        print(f"[{number}/{len(cases)}] {case.name}", flush=True)
        started = time.perf_counter()
        for note in case.repairs:
            print(f"  repaired: {note}")

        def report(line: str, started: float = started) -> None:
            print(f"  {time.perf_counter() - started:6.1f} s  {line}", flush=True)

        try:
            folder = run_case(case, out, report, cache=cache)
        except TetluxError as error:
            failed += 1
            print(f"tetlux: {case.name} failed: {error}", file=sys.stderr, flush=True)
            continue
        report(f"written to {folder}")
    if failed:
        print(f"tetlux: {failed} of {len(cases)} cases failed.", file=sys.stderr)
    return 1 if failed else 0
