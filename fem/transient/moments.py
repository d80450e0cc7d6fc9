"""`moments`: mean times and variances of what detectors read after a short pulse.

A reading y(s) of light with ``sigma_a + s n/c`` in place of sigma_a is the Laplace transform of what is read at times t
after a pulse, so that its Taylor coefficients in s are the moments ``∫ t^m y(t) dt = (-1)^m d^m y/ds^m`` at 0. They are
Cauchy's integrals on a circle around 0 within the poles, by the trapezoidal rule, whose error falls exponentially with
the number of points. Each point is a solve with a complex shift, with all that is subtracted and by quadratic elements.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.models.modulation import seconds_per_length
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.sources.light import Light
from tetlux.fem.system import System
from tetlux.fem.transient.laplace import check_arguments, read_with_shift
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError

# Points on the circle, of which half are solved for, the others being their conjugates; and its radius over a lower
# bound of the distance of the nearest pole: coefficients are off by less than this to the power of POINTS, 1.5e-5.
POINTS, RADIUS = 16, 0.5
# Errors of moments grow with their order, by which readings are divided by powers of the radius.
MOST_ORDERS = 4


@dataclass(frozen=True, eq=False)
class Moments:
    """Moments of readings in time, for each of l lights and d detectors.

    Attributes
    ----------
    raw : (order + 1, l, d) ndarray
        ``∫ t^m y(t) dt / ∫ y(t) dt`` for m = 0, 1, ..., s^m.
    readings : (l, d) ndarray
        Exitance at each detector, W/unit² of steady light: the integral over time for a pulse of 1 J for each watt.
    """

    raw: FloatArray
    readings: FloatArray

    @property
    def mean(self) -> FloatArray:
        """Mean time of flight, (l, d), s."""
        return np.asarray(self.raw[1])

    @property
    def variance(self) -> FloatArray:
        """Variance of the time of flight, (l, d), s²."""
        if len(self.raw) < 3:
            raise InputError("the variance needs moments of order 2; give order=2.")
        return np.asarray(self.raw[2] - self.raw[1] ** 2)

    __repr__ = one_line


def moments(
    system: System,
    lights: Sequence[Light],
    detectors: Sequence[Detector],
    *,
    order: int = 2,
    outside_index: float = 1.0,
) -> Moments:
    """Moments of the times at which light arrives at detectors after a short pulse.

    Parameters
    ----------
    system : System
        Of steady light, on a mesh that is fine enough for what the detectors read.
    lights : sequence of Light
        At least one; each has moments of its own.
    detectors : sequence of detectors
        At least one.
    order : int
        The highest moment, from 1 to 4.
    outside_index : float
        Refractive index of what surrounds the body, to which `eta` is relative.

    Returns
    -------
    Moments

    Raises
    ------
    InputError
        If an argument is out of range, or a light does not go with the body.
    RunError
        If the linear solver fails.

    Notes
    -----
    The time that a beam takes to reach its depth is left out, as with the `frequency` of `tetlux.fem.solve`.

    Examples
    --------
    >>> from tetlux.fem import Medium, PointDetector, PointSource, System, solve
    >>> from tetlux.meshing import sphere
    >>> ball, tissue = sphere(10.0), Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> light, there = PointSource((0, 0, 9)), PointDetector((10, 0, 0))
    >>> mesh = solve(ball, tissue, [light], detectors=[there], detector_tolerance=0.02).mesh
    >>> found = moments(System(mesh, tissue, ball), [light], [there])
    >>> round(1e9 * float(found.mean[0, 0]), 2)  # ns
    0.31
    """
    if not (isinstance(order, int) and 1 <= order <= MOST_ORDERS):
        raise InputError(f"order is {order}; give a whole number from 1 to {MOST_ORDERS}.", field="order")
    if len(detectors) == 0:
        raise InputError("moments are of what detectors read, and there is none; give at least one.", field="detectors")
    check_arguments(system, outside_index)
    radius = RADIUS * _nearest_pole(system.coefficients, system.true_surface.diagonal)
    angles = 2.0 * np.pi * (np.arange(POINTS // 2) + 0.5) / POINTS
    circle = radius * np.exp(1j * angles)
    found = [read_with_shift(system, shift, lights, detectors) for shift in circle.tolist()]
    values = np.array([[[reading.exitance for reading in row] for row in rows] for rows in found])
    powers = np.exp(-1j * np.outer(np.arange(order + 1), angles)) / radius ** np.arange(order + 1)[:, None]
    coefficients = np.real(np.tensordot(powers, values, axes=1)) * 2.0 / POINTS
    delay = seconds_per_length(system.coefficients.outer, system.mesh.unit, outside_index)
    factors = [(-1) ** m * math.factorial(m) * delay**m for m in range(order + 1)]
    raw = coefficients * np.array(factors)[:, None, None] / coefficients[0]
    return Moments(raw, coefficients[0])


def _nearest_pole(coefficients: Coefficients, diagonal: float) -> float:
    """A lower bound of the distance of the nearest pole from 0, in 1/unit.

    The poles are at ``-(sigma_a + D mu²)``. Of all bodies of this diagonal a ball holds light longest, some
    ``A d/3 + d²/(4 pi² D)``.
    """
    robin = boundary_condition_of(coefficients.outer).robin
    diffusion = float(np.min(coefficients.diffusion))
    length = diagonal / (6.0 * robin) + diagonal**2 / (4.0 * np.pi**2 * diffusion)
    return float(np.min(coefficients.sigma_a)) + 1.0 / length
