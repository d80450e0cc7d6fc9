"""`Costs`: what past runs on this machine took and were off by, relative to built-in predictions.

``costs.jsonl`` in the cache directory has a line for each run: the kind of its candidate, and its measured seconds and
error as multiples of the predicted ones. Lines are appended in one write each, so that processes can write at the same
time. Lines that cannot be read do not count; without the file the built-in predictions hold.
"""

import json
import math
import os
import statistics
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from tetlux.meshing.describe import one_line
from tetlux.meshing.mesher.cache import cache_directory

FILE = "costs.jsonl"
# Where this environment variable is 0, plans depend on the scene alone: neither on past runs nor on cached meshes.
SWITCH = "TETLUX_LEARN"
# The file is cut to its last half at this size, bytes: some 1,600 runs. It is read in a millisecond or two.
LARGEST_FILE = 100_000
# Runs of a kind that count, the last ones, and how many runs a built-in prediction is worth.
MOST_RUNS, WORTH_OF_BUILT_IN = 30, 2
# A run counts as at most this many times slower or faster, or farther off or nearer, than predicted.
LARGEST_FACTOR = 8.0


@dataclass(frozen=True, eq=False)
class Costs:
    """What past runs took and were off by.

    Attributes
    ----------
    runs : mapping of str to sequence of (float, float)
        By the kind of candidate the logarithms of seconds and of errors over the predicted ones.
    directory : Path, optional
        Where what is learned is written; None to write nothing.
    """

    runs: Mapping[str, Sequence[tuple[float, float]]] = field(default_factory=dict)
    directory: Path | None = None

    def factors(self, kind: str) -> tuple[float, float]:
        """Factors on the built-in seconds and error of a kind of candidate.

        Few runs of a kind are completed, for the seconds by the median of all runs, which tells how fast the machine
        is also where some kinds are predicted badly.
        """
        of_all = [seconds for runs in self.runs.values() for seconds, _ in runs]
        speed = statistics.median(of_all + [0.0] * WORTH_OF_BUILT_IN)
        runs = self.runs.get(kind, ())
        weight = len(runs) + WORTH_OF_BUILT_IN
        seconds = (sum(each for each, _ in runs) + WORTH_OF_BUILT_IN * speed) / weight
        return math.exp(seconds), math.exp(sum(each for _, each in runs) / weight)

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
    runs: dict[str, list[tuple[float, float]]] = {}
    for line in text.splitlines():
        with suppress(ValueError, TypeError):
            kind, seconds, error = json.loads(line)
            run = _logarithm(seconds), _logarithm(error)
            runs.setdefault(str(kind), []).append(run)
    return Costs({kind: some[-MOST_RUNS:] for kind, some in runs.items()}, directory)


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
