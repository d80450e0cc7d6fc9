"""Readings in the Laplace domain, from which those in time are made."""

from collections.abc import Sequence
from dataclasses import replace

from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.detectors import read_all
from tetlux.fem.outcome.reading import Reading
from tetlux.fem.sources.light import Light
from tetlux.fem.system import System
from tetlux.meshing.errors import InputError


def check_arguments(system: System, outside_index: float) -> None:
    """Refuse a system of modulated light, and an index that is not sensible.

    Raises
    ------
    InputError
    """
    if system.shift != 0:
        raise InputError("the system is that of modulated light; give one with shift=0.", field="system")
    if not 1.0 <= outside_index <= 10.0:
        raise InputError(f"outside_index is {outside_index:g}; give 1 or more.", field="outside_index")


def read_with_shift(
    system: System, shift: complex, lights: Sequence[Light], detectors: Sequence[Detector]
) -> list[tuple[Reading, ...]]:
    """What each detector reads of each light, a tuple for each light, with a shift, 1/unit."""
    solution = replace(system, shift=shift).solve(lights)
    return [read_all(detectors, part) for part in solution.of_lights or (solution,)]
