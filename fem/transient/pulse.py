"""`read_pulse`: what detectors read at given times after a short pulse, by a contour in the Laplace domain.

A reading y(s) of light with ``sigma_a + s n/c`` in place of sigma_a is the Laplace transform of what is read in time,
``y(t) = (1/2 pi i) ∫ exp(s t) y(s) ds``. Its poles are on the negative real axis, and one hyperbola around them serves
a whole window of times (Weideman & Trefethen 2007, Math. Comp. 76, 1341-1356): with twenty-four points, of which the
conjugates are not solved for, the integral is off by less than 1e-8 of its largest terms for windows up to 1:40. Each
point is a solve with a complex shift, with all that is subtracted and by quadratic elements.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.sources.light import Light
from tetlux.fem.system import System
from tetlux.fem.transient.laplace import check_arguments, read_with_shift, seconds_per_length
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError

# Points of the contour, half the angle between its ends, and the longest window of times that it serves.
POINTS, ANGLE, LONGEST_WINDOW = 24, 1.1, 50.0
# Values below so many times their estimated error are not resolved.
RESOLVED = 2.0


@dataclass(frozen=True, eq=False)
class Transient:
    """Readings after a pulse of 1 J for each watt of the lights.

    Attributes
    ----------
    times : (t,) ndarray
        s.
    exitance : (t, l, d) ndarray
        Of each light at each detector, W/unit²; nan where it is too faint to be resolved, as before light arrives.
    error : (t, l, d) ndarray
        Estimated error of the mesh, W/unit².
    """

    times: FloatArray
    exitance: FloatArray
    error: FloatArray

    __repr__ = one_line


def read_pulse(
    system: System,
    lights: Sequence[Light],
    detectors: Sequence[Detector],
    times: Sequence[float],
    *,
    outside_index: float = 1.0,
) -> Transient:
    """What detectors read at times after a short pulse.

    Parameters
    ----------
    system : System
        Of steady light. Early times need a fine mesh: that of a `tetlux.fem.solve` with these detectors and a frequency
        of about 0.4 over the earliest time.
    lights : sequence of Light
        At least one; each has readings of its own.
    detectors : sequence of detectors
        At least one.
    times : sequence of float
        s; the latest at most 50 times the earliest.
    outside_index : float
        Refractive index of what surrounds the body, to which `eta` is relative.

    Returns
    -------
    Transient

    Raises
    ------
    InputError
        If an argument is out of range, or a light does not go with the body.
    RunError
        If the linear solver fails.

    Notes
    -----
    Beams reach all depths at once, as with the `frequency` of `tetlux.fem.solve`.
    """
    at = np.array(times, dtype=float).reshape(-1)
    if len(at) == 0 or not (np.isfinite(at).all() and at.min() > 0):
        raise InputError("times are in s after the pulse, each greater than 0; give at least one.", field="times")
    if at.max() > LONGEST_WINDOW * at.min() * (1.0 + 1e-9):
        raise InputError(
            f"times reach from {at.min():g} to {at.max():g} s; give windows whose end is at most {LONGEST_WINDOW:g} "
            "times their begin, one after the other.",
            field="times",
        )
    if len(detectors) == 0:
        raise InputError("a pulse is read by detectors, and there is none; give at least one.", field="detectors")
    check_arguments(system, outside_index)
    points, weights = _contour(float(at.min()), float(at.max()))
    shifts = points * seconds_per_length(system, outside_index)
    found = [read_with_shift(system, shift, lights, detectors) for shift in shifts.tolist()]
    values = np.array([[[reading.exitance for reading in row] for row in rows] for rows in found])
    relative = np.array([[[reading.relative_error for reading in row] for row in rows] for rows in found], dtype=float)
    errors = np.abs(values) * relative
    factors = weights * np.exp(np.outer(at, points))
    exitance = np.tensordot(factors, values, axes=1).imag / np.pi
    error = np.sqrt(np.tensordot(np.abs(factors) ** 2, errors**2, axes=1)) / np.pi
    return Transient(at, np.where(exitance > RESOLVED * error, exitance, np.nan), error)


def _contour(first: float, last: float) -> tuple[NumberArray, NumberArray]:
    """Points of the upper half of a hyperbola, 1/s, and their weights, for times from the first to the last, s."""
    ratio = max(last / first, 1.5)
    top = (np.pi - 2.0 * ANGLE) * ratio + 4.0 * ANGLE - np.pi
    extent = float(np.arccosh(top / ((4.0 * ANGLE - np.pi) * np.sin(ANGLE))))
    step, scale = extent / POINTS, (4.0 * np.pi * ANGLE - np.pi**2) / extent * POINTS / last
    along = (np.arange(POINTS) + 0.5) * step
    return scale * (1.0 + np.sin(1j * along - ANGLE)), 1j * scale * step * np.cos(1j * along - ANGLE)
