"""Put malformed inputs through the command line, and print a table of how they end, and every violation.

Run ``python -m tests.fuzz`` in the root of the repository, with ``--seconds`` for how long case files are made, with
``--seed`` for other random inputs, and with ``--solve`` to solve, each in a process of its own, what a check lets pass
of the surfaces.
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from tests.fuzz.outcome import Outcome
from tests.fuzz.runs import check_case_files, check_made, check_surfaces, check_volumes, in_a_folder, run_surfaces

# Seconds that a run of any surface may take, as `tetrahedralize` has it.
LIMIT = 600.0
KINDS = ("cases", "surfaces", "volumes")


def main() -> int:
    """Print the table; 1 if anything was violated."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="for case files; two thousand are the least")
    parser.add_argument("--seed", type=int, default=0, help="other random inputs of each kind")
    parser.add_argument("--only", choices=KINDS, help="one kind; default: all")
    parser.add_argument("--solve", action="store_true", help="also solve surfaces that pass: half an hour")
    options = parser.parse_args()
    wanted = (options.only,) if options.only else KINDS
    violated = 0
    if "cases" in wanted:
        violated += _table("case files", in_a_folder(partial(_case_files, seconds=options.seconds, seed=options.seed)))
    if "surfaces" in wanted:
        violated += _table("surfaces", in_a_folder(partial(check_surfaces, number=options.seed)))
    if "volumes" in wanted:
        violated += _table("volumes and images", in_a_folder(partial(check_volumes, number=options.seed)))
    if options.solve:
        violated += _table("surfaces, solved", in_a_folder(partial(run_surfaces, limit=LIMIT)))
    return 1 if violated else 0


def _case_files(folder: Path, seconds: float, seed: int) -> Iterator[Outcome]:
    end = time.monotonic() + seconds
    yield from check_case_files(folder, 1400)
    number = 1000 * seed + 1
    while time.monotonic() < end:
        yield from check_made(folder, 500, number)
        number += 1


def _table(what: str, outcomes: list[Outcome]) -> int:
    print(f"\n{len(outcomes):,} {what}, the slowest in {max(each.seconds for each in outcomes):.1f} s")
    for ending, count in Counter(each.ending for each in outcomes).most_common():
        print(f"  {count:6,}  {ending}")
    violations = [each for each in outcomes if each.violation]
    for each in violations:
        print(f"  {each.name}\n    {each.violation}")
    sys.stdout.flush()
    return len(violations)


if __name__ == "__main__":
    sys.exit(main())
