"""`Contour`: from values in the Laplace domain to values in time.

A reading y(s) of light with ``sigma_a + s n/c`` in place of sigma_a is the Laplace transform of what is read in time,
``y(t) = (1/2 pi i) ∫ exp(s t) y(s) ds``. Its poles are on the negative real axis, and one hyperbola around them serves
a whole window of times (Weideman & Trefethen 2007, Math. Comp. 76, 1341-1356). Conjugate values are not solved for.

**The guard.** The rule takes the conjugate points too, with steps h along the contour. Every second of all of them, in
turn above and below the axis, is a rule of steps 2h. Its real part is the same; its imaginary part would be 0 if it had
no error. Errors are of two kinds, by what limits the contour on its two sides: with ``a = ANGLE`` they are about
``exp(-2 pi (pi/2 - a)/h)`` of the terms, and a number that grows with time times ``exp(-2 pi a/h)``. So those of steps
2h tell those of h: at early times they are of the first kind, and those of h less by ``exp(-pi (pi/2 - a)/h)``; at late
times of the second, and less by ``exp(-pi a/h)``.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line

# Points of the contour, half the angle between its ends, and the longest window of times that one serves.
POINTS, ANGLE, LONGEST_WINDOW = 24, 1.1, 50.0
# Contours are for windows at least so long: those for shorter ones reach far to the right, where terms cancel.
SHORTEST_WINDOW = 10.0
# Relative error of each value in the Laplace domain, by rounding and the linear solver.
ROUNDING = 1e-8
# Errors of the rule are up to so many times the exponentials of the theory and the last term.
SAFETY = 60.0


@dataclass(frozen=True, eq=False)
class Contour:
    """The upper half of a hyperbola for a window of times.

    Attributes
    ----------
    times : (t,) ndarray
        s.
    points : (p,) ndarray
        1/s.
    factors : (t, p) ndarray
        Of the values at the points, whose products with them add up to those at the times, in their imaginary part.
    step, scale : float
        h, and the size of the hyperbola, 1/s.
    """

    times: FloatArray
    points: NumberArray
    factors: NumberArray
    step: float
    scale: float

    @property
    def weights(self) -> FloatArray:
        """How much each value counts at the time at which it counts most, (p,), at most 1."""
        sizes = np.abs(self.factors)
        return np.asarray((sizes / sizes.max(axis=1, keepdims=True)).max(axis=0))

    def invert(self, values: NumberArray) -> FloatArray:
        """Values in time (t, ...) from those at the points (p, ...)."""
        return np.asarray(np.tensordot(self.factors, values, axes=1).imag)

    def slopes(self, values: NumberArray) -> FloatArray:
        """Their derivatives by time (t, ...), 1/s."""
        return np.asarray(np.tensordot(self.factors * self.points, values, axes=1).imag)

    def norm(self, values: NumberArray) -> FloatArray:
        """The root of the squares of the terms that add up to values in time, (t, ...)."""
        return np.asarray(np.sqrt(np.tensordot(np.abs(self.factors) ** 2, np.abs(values) ** 2, axes=1)))

    def error(self, values: NumberArray) -> FloatArray:
        """Estimated error of the values in time (t, ...), by the rule of twice the step."""
        signs = (-1.0) ** np.arange(len(self.points))
        twice = np.abs(np.tensordot(self.factors * signs, values, axes=1).real)
        sums = np.tensordot(np.abs(self.factors), np.abs(values), axes=1)
        falls = np.exp(-np.pi * (0.5 * np.pi - ANGLE) / self.step), np.exp(-np.pi * ANGLE / self.step)
        early = np.exp(self.scale * self.times) * falls[1] < falls[0]
        of_step = falls[0] * np.where(_along(early, twice), twice, falls[0] * sums) + falls[1] * twice
        last = np.abs(np.multiply.outer(self.factors[:, -1], values[-1]))
        return np.asarray(SAFETY * (of_step + last) + ROUNDING * sums)

    __repr__ = one_line


def _along(of_times: NDArray[Any], values: FloatArray) -> NDArray[Any]:
    """Something of each time (t,), to go with values (t, ...)."""
    return of_times.reshape(-1, *[1] * (values.ndim - 1))


def contour_for(times: FloatArray, leftmost: float = 0.0) -> Contour:
    """The contour of a window of times, s, around poles that lie at or left of `leftmost`, 1/s, at most 0."""
    last = float(times.max())
    ratio = max(last / float(times.min()), SHORTEST_WINDOW)
    top = (np.pi - 2.0 * ANGLE) * ratio + 4.0 * ANGLE - np.pi
    extent = float(np.arccosh(top / ((4.0 * ANGLE - np.pi) * np.sin(ANGLE))))
    step, scale = extent / POINTS, (4.0 * np.pi * ANGLE - np.pi**2) / extent * POINTS / last
    along = (np.arange(POINTS) + 0.5) * step
    points = leftmost + scale * (1.0 + np.sin(1j * along - ANGLE))
    weights = 1j * scale * step * np.cos(1j * along - ANGLE) / np.pi
    return Contour(times, points, weights * np.exp(np.outer(times, points)), step, scale)


def windows_of(times: FloatArray) -> list[slice]:
    """Divide sorted times into windows that one contour serves each."""
    windows, start = [], 0
    while start < len(times):
        end = int(np.searchsorted(times, LONGEST_WINDOW * times[start] * (1.0 + 1e-9), side="right"))
        windows.append(slice(start, end))
        start = end
    return windows
