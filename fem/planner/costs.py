"""`Costs`: what past runs on this machine took and were off by, relative to built-in predictions.

``costs.jsonl`` in the cache directory has a line for each run: the kind of its candidate, and its measured seconds and
error as multiples of the predicted ones. Seconds are those of processors where these are fewer than those of a clock: a
run that had to wait for other programs tells nothing of the next one. Lines are appended in one write each, so that
processes can write at the same time. Lines that cannot be read do not count; without the file the built-in predictions
hold.
"""

import json
import math
import os
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from tetlux.meshing.describe import one_line
from tetlux.meshing.mesher.cache import cache_directory

FILE = "costs.jsonl"
# Where this environment variable is 0, plans depend on the scene alone: neither on past runs nor on cached meshes.
SWITCH = "TETLUX_LEARN"
# The file is cut to its last half at this size, bytes: some 1,600 runs. It is read in a millisecond or two.
LARGEST_FILE = 100_000
# Runs that count, the last ones, of all kinds and of one, and how many runs a built-in prediction is worth.
MOST_RUNS, MOST_OF_KIND, WORTH_OF_BUILT_IN = 400, 30, 2
# Runs of any kind whose median tells how fast the machine is at their time, such as the last ones.
RUNS_OF_SPEED = 15
# Times that speeds and what kinds take are found from each other.
ROUNDS = 4
# A run counts as at most this many times slower or faster, or farther off or nearer, than predicted.
LARGEST_FACTOR = 8.0


@dataclass(frozen=True)
class PastRun:
    """A run: the kind of its candidate, and the logarithms of its seconds and error over the predicted ones."""

    kind: str
    seconds: float
    error: float


@dataclass(frozen=True, eq=False)
class Costs:
    """What past runs took and were off by.

    Attributes
    ----------
    runs : sequence of PastRun
        From old to new.
    directory : Path, optional
        Where what is learned is written; None to write nothing.
    """

    runs: Sequence[PastRun] = ()
    directory: Path | None = None

    def factors(self, kind: str) -> tuple[float, float]:
        """Factors on the built-in seconds and error of a kind of candidate.

        The seconds are those of the machine as it is now, times what runs of this kind took more than others of their
        time: a machine that becomes slower does so for all kinds, and what is known of each stays true.
        """
        here = [run for run in self.runs if run.kind == kind][-MOST_OF_KIND:]
        error = sum(run.error for run in here) / (len(here) + WORTH_OF_BUILT_IN)
        speed, of_kinds = self._learned
        return math.exp(speed + of_kinds.get(kind, 0.0)), math.exp(error)

    @cached_property
    def _learned(self) -> tuple[float, dict[str, float]]:
        """Logarithms of how slow the machine is now, and of how many times as long runs of each kind take."""
        if not self.runs:
            return 0.0, {}
        kinds, own = np.unique([run.kind for run in self.runs], return_inverse=True)
        seconds, counts = np.array([run.seconds for run in self.runs]), np.bincount(own)
        length = min(RUNS_OF_SPEED, len(seconds))
        before, behind = length // 2, length - 1 - length // 2
        of_kinds = np.zeros(len(kinds))
        for _ in range(ROUNDS):
            without = seconds - of_kinds[own]
            windows = np.median(np.lib.stride_tricks.sliding_window_view(without, length), axis=1)
            speeds = np.concatenate([np.repeat(windows[:1], before), windows, np.repeat(windows[-1:], behind)])
            of_kinds = np.bincount(own, seconds - speeds) / (counts + WORTH_OF_BUILT_IN)
        last = (seconds - of_kinds[own])[-RUNS_OF_SPEED:]
        speed = float(np.median(np.concatenate([last, np.zeros(WORTH_OF_BUILT_IN)])))
        return speed, dict(zip(kinds.tolist(), of_kinds.tolist(), strict=True))

    def learn(self, kind: str, seconds: float, error: float) -> None:
        """Append a run: its seconds and error as multiples of the built-in predictions.

        Nothing is written where a figure is not positive, or files cannot be written.
        """
        if self.directory is None or not all(0.0 < each < math.inf for each in (seconds, error)):
            return
        line = json.dumps([kind, round(seconds, 4), round(error, 6)]) + "\n"
        with suppress(OSError):
            self.directory.mkdir(parents=True, exist_ok=True)
            path = self.directory / FILE
            with path.open("ab", buffering=0) as file:
                file.write(line.encode())
                is_large = file.tell() > LARGEST_FILE
            if is_large:
                _halve(path)

    __repr__ = one_line


def read_costs() -> Costs:
    """What past runs of this machine's user took and were off by."""
    directory = cache_directory() if os.environ.get(SWITCH) != "0" else None
    if directory is None:
        return Costs()
    text = b""
    with suppress(OSError):
        text = (directory / FILE).read_bytes()[-2 * LARGEST_FILE :]
    runs = []
    for line in text.splitlines():
        with suppress(ValueError, TypeError):
            kind, seconds, error = json.loads(line)
            runs.append(PastRun(str(kind), _logarithm(seconds), _logarithm(error)))
    return Costs(runs[-MOST_RUNS:], directory)


def _logarithm(ratio: float) -> float:
    """The logarithm of a positive ratio, within `LARGEST_FACTOR`.

    Raises
    ------
    ValueError, TypeError
        If it is not positive, or no number.
    """
    if not 0.0 < ratio < math.inf:
        raise ValueError(ratio)
    largest = math.log(LARGEST_FACTOR)
    return min(max(math.log(ratio), -largest), largest)


def _halve(path: Path) -> None:
    """Keep the last half of the lines; a line that another process appends meanwhile may be lost."""
    kept = path.read_bytes()[-LARGEST_FILE // 2 :].partition(b"\n")[2]
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    with os.fdopen(handle, "wb") as file:
        file.write(kept)
    Path(name).replace(path)
