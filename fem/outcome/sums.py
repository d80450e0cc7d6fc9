"""The sum of the solutions of several lights."""

from collections.abc import Sequence
from dataclasses import astuple, replace

import numpy as np

from tetlux.fem.outcome.power import Power
from tetlux.fem.outcome.solution import Solution


def sum_solutions(parts: Sequence[Solution]) -> Solution:
    """The sum of solutions on one mesh, one for each light."""
    if len(parts) == 1:
        return parts[0]
    powers = [astuple(part.power) for part in parts]
    return replace(
        parts[0],
        fluence=np.sum([part.fluence for part in parts], axis=0),
        power=Power(*(sum(column) for column in zip(*powers, strict=True))),
        patches=tuple(patch for part in parts for patch in part.patches),
        transmitted_irradiance=sum((part.transmitted_irradiance for part in parts), 0.0),
        limited_power=sum(part.limited_power for part in parts),
        known_absorption=tuple(absorbed for part in parts for absorbed in part.known_absorption),
        fitting=None,
        of_lights=tuple(parts),
    )
