"""Derivatives of readings to the places of lights: loads and charges with the duals fixed, as in `subtracted`."""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.lights.places import free_direction, move_to, place_of
from tetlux.fem.sensitivity.nearby import STEP, WEIGHTS, Nearby, change_of
from tetlux.fem.sensitivity.subtracted import Readout
from tetlux.fem.sources.light import Light
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.errors import InputError


def derivatives_to_places(readout: Readout, numbers: Sequence[int]) -> NumberArray:
    """Derivatives of the readings of some lights to their coordinates, (k, d, 3), W/unit³.

    Parameters
    ----------
    readout : Readout
    numbers : sequence of int
        Of k lights, from 0, each a point or a pencil beam.
    """
    found = np.zeros((len(numbers), len(readout.measurements), 3), readout.scene.fluence.dtype)
    deposits = readout.deposits()
    for row, light in enumerate(numbers):
        place = place_of(readout.lights[light])
        assert place is not None
        step = STEP * deposits[light].hints.resolution
        found[row] = _along_axes(readout, light, place, step)
        free = free_direction(readout.lights[light])
        if free is not None:
            # What rounding makes of 0 would lead a fit astray.
            found[row] -= np.outer(found[row] @ free, free)
    return found


def check_places(lights: Sequence[Light], numbers: Sequence[int]) -> None:
    """Refuse numbers of lights that there are not, or that have no place.

    Raises
    ------
    InputError
    """
    for number in numbers:
        if not 0 <= number < len(lights):
            raise InputError(
                f"positions has light {number}, and there are {len(lights)}; give numbers from 0.", field="positions"
            )
        if place_of(lights[number]) is None:
            raise InputError(
                f"light {number + 1} has no position that can be varied; only points and pencil beams have one.",
                field="positions",
            )


def _along_axes(readout: Readout, light: int, place: FloatArray, step: float) -> NumberArray:
    """Derivatives of the readings of a light along each axis, by steps of some length, (d, 3)."""
    nearby = []
    for way in np.eye(3):
        moved = [move_to(readout.lights[light], place + steps * step * way) for steps in WEIGHTS]
        nearby.append(
            [
                Nearby(weight / step, readout.system, readout.split([each], readout.system))
                for weight, each in zip(WEIGHTS.values(), moved, strict=True)
            ]
        )
    found = np.array([readout.of_load(each, 0) for each in nearby])
    for number, known in enumerate(readout.scene.patches[light]):
        found = found + readout.of_charges(known, [change_of(each, 0, number) for each in nearby])
    return np.asarray(found.T)
