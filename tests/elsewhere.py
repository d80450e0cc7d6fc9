"""The command line in processes of their own, forked from one that has everything imported.

To start Python and import tetlux takes longer than most runs of the tests do.
"""

import os
import sys
from collections.abc import Mapping, Sequence
from multiprocessing import get_context
from multiprocessing.context import ForkServerProcess
from pathlib import Path

# What is imported here only saves that to every process.
import tetlux.cases.picture.draw
import tetlux.cases.run  # noqa: F401
from tetlux.cases.cli import main

_forks = get_context("forkserver")
_forks.set_forkserver_preload([__name__])


def start_elsewhere(
    arguments: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None
) -> ForkServerProcess:
    """Start the command line in a process of its own, which prints to `stdout` and `stderr` in a folder."""
    process = _forks.Process(target=_run, args=(list(arguments), folder, dict(environment or {})))
    process.start()
    return process


def _run(arguments: list[str], folder: Path, environment: dict[str, str]) -> None:
    os.environ.update(environment)
    for number, name in ((1, "stdout"), (2, "stderr")):
        os.dup2(os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    sys.exit(main(arguments))
