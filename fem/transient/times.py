"""Times after a pulse, and whether light diffuses by then."""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.media.medium import Medium
from tetlux.fem.models.modulation import seconds_per_length
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError

# Light has gone so many mean free paths before diffusion describes it; earlier times are reported, and those before a
# single mean free path refused.
DIFFUSE_AFTER = 10.0


def check_times(times: Sequence[float], medium: Medium, unit: str, outside_index: float) -> FloatArray:
    """The times (t,), s, if they are some.

    Parameters
    ----------
    times : sequence of float
        s.
    medium : Medium
        Below the surface.
    unit : str
        Of length.
    outside_index : float
        Refractive index of what surrounds the body.

    Raises
    ------
    InputError
        If they are not above 0, do not rise, or begin before light has gone a mean free path.
    """
    try:
        at = np.array(times, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError("times are not a list of numbers; give times in s, such as [1e-10, 2e-10].") from error
    if at.ndim != 1 or len(at) == 0 or not (np.isfinite(at).all() and at.min() > 0):
        raise InputError(
            "times are in s after the pulse, each greater than 0; give a list with at least one.", field="times"
        )
    if (np.diff(at) <= 0).any():
        raise InputError("times do not rise; sort them, and give each once.", field="times")
    if not 1.0 <= outside_index <= 10.0:
        raise InputError(
            f"outside_index is {outside_index:g}; give the refractive index of what surrounds the body, 1 or more.",
            field="outside_index",
        )
    free_time = seconds_per_length(medium, unit, outside_index) * medium.mean_free_path
    if at[0] < free_time:
        raise InputError(
            f"the first time is {at[0]:g} s, when light has gone {at[0] / free_time:.2g} mean free paths and does not "
            f"diffuse yet; begin at {DIFFUSE_AFTER * free_time:.2g} s or later.",
            field="times",
        )
    return at
