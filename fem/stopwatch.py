"""Seconds by stage of a run."""

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

STAGES = ("surface", "mesh", "assemble", "solve", "total")


def _processor_seconds() -> float:
    """Of this process and of those that it started and that have ended."""
    return sum(os.times()[:4])


@dataclass
class Stopwatch:
    """Seconds by stage, which add up to the total since it was made; a stage does not count those within it."""

    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))
    started: float = field(default_factory=time.perf_counter)
    processors_at: float = field(default_factory=_processor_seconds)
    _within: list[float] = field(default_factory=lambda: [0.0])

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time of the block to a stage."""
        start = time.perf_counter()
        self._within.append(0.0)
        try:
            yield
        finally:
            whole = time.perf_counter() - start
            self.seconds[name] += whole - self._within.pop()
            self._within[-1] += whole

    def read(self) -> dict[str, float]:
        """Seconds so far; what belongs to no stage is that of solving."""
        total = time.perf_counter() - self.started
        others = sum(seconds for name, seconds in self.seconds.items() if name not in ("solve", "total"))
        return {**self.seconds, "solve": total - others, "total": total}

    def read_undisturbed(self) -> float:
        """Seconds since it was made, of processors where these are fewer: without what was spent waiting for others.

        Processors' seconds are those of this process and of those that it started and that have ended.
        """
        seconds = time.perf_counter() - self.started
        # Windows does not count processes that have ended.
        return seconds if sys.platform == "win32" else min(seconds, _processor_seconds() - self.processors_at)
