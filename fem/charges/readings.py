"""What detectors read, as a goal of a fit: where charges and equations matter for it, and the error of each reading.

A residual r of the boundary condition acts like a source of that power on the surface. Along a flat surface its
exitance is ``zb/(2 pi) (1 + k d) e^{-k d}/d³`` of its power at a distance d far from it (Farrell, Patterson & Wilson
1992, Med. Phys. 19, 879-888), with zb = 2 A D. The light falls off alike. Their ratio is the relative effect of r on a
reading. It is the same all along the way from the light to the detector, and larger near the detector: there r must be
small beside the faint light. Beside the way it falls off as ``e^{-k s}`` with the detour s.

Errors take the exitance near r too, ``1/(2 pi zb d)``: ``zb/(2 pi) (1 + k d) e^{-k d}/(d (d + zb)²)`` joins both
within 15 %, and within 40 % where k zb is 1.6, more than that of an albedo of .8.

The error of a reading has three parts, and their squares are added. The first is the sum of r by its effect: on flat
bodies it is most of the error, with its sign, on balls and cylinders half of it, since the effect is that along a flat
surface; it counts 1.4 times. The second is what this sum misses: r of random sign in each square of the spacing, by its
effect. The third is that of the ripples of r around the detector, see `tetlux.fem.charges.check`. Each of the latter
counts half. How `python -m tests.benchmarks.readings --charges --even` holds these bars to series is in
docs/tolerances.md.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import cdist

from tetlux.fem.charges.check import exitance_error
from tetlux.fem.charges.kernel import Equation
from tetlux.fem.charges.placement import Weight, distance_from, spacing_by_fading, weight_by_distance
from tetlux.fem.charges.samples import Samples, Spacing
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.surface.surface import Surface

# Points over which the square of errors around a reading is averaged. Bar over error for 110 readings on balls, balls
# in balls and cylinders, with errors from 1e-6 to .9: 1.8 in the median, 1.0 and 27 for the lowest and highest 5 %.
AVERAGED = 12
# What the parts of the error of a reading count, chosen by 600 readings of scenes 0 to 89. By the second and third part
# alone, each counting once, 97 % of these are within twice the bar, which is 4.0 times the error in the median.
SUMMED, RANDOM, RIPPLING = 1.4, 0.5, 0.5
# Effects are smoothed over this share of the spacing of charges that the distance of the detector from the light gives.
SMOOTHED_SHARE = 0.25
# And over this share where their sum is an error.
LESS_SMOOTHED_SHARE = 0.1
# The spacing is divided by the root of the importance, of at least this. Estimate of the exitance, and largest error of
# ten fibres on a ball of radius 80, by 300 charges, for .03 / .1: .073, .0064 / .0062, .0004.
LEAST_IMPORTANCE = 0.05
# Equations of the rest of the body have at least this share of the weight of those near the light. Estimate of the
# exitance, and largest error of readings of a plate 13 mean free paths thick, by 350 charges, for .001 / .1 / .3: .01,
# 1e-4 / 3e-4, 5e-5 / 6e-5, 8e-5.
LEAST_WEIGHT = 0.1
# Weights end here, where light has faded to less than a number can say.
MOST_WEIGHT = 1e15


@dataclass(frozen=True, eq=False)
class ReadingGoal:
    """Detectors on a body's surface, and the light that reaches them.

    Attributes
    ----------
    equation : Equation
        Below the surface.
    distance : callable
        From the light, see `tetlux.fem.charges.placement.distance_from`.
    sources : (p, 3) ndarray
    injected : (p,) ndarray
        Powers that sources on the surface would need for the same light far away, W.
    diffuse : float
        Right-hand side of the boundary condition, W/unit².
    detectors : (d, 3) ndarray
        Points of the surface.
    tolerance : float
        Wanted relative error of each reading.
    """

    equation: Equation
    distance: Spacing
    sources: FloatArray
    injected: FloatArray
    diffuse: float
    detectors: FloatArray
    tolerance: float

    @property
    def fading(self) -> float:
        """Rate at which the light fades, 1/unit."""
        return float(np.real(self.equation.wave_number))

    def exitance_of_each(self, points: FloatArray) -> FloatArray:
        """Exitance at the detectors by a source on the surface far from them, at each point (n, 3), (d, n), 1/unit²."""
        fading, distance = self._fading_and_distance(points, SMOOTHED_SHARE)
        return np.asarray(self.equation.extrapolation_length / (2.0 * np.pi) * fading / distance**3)

    def _effects(self, points: FloatArray) -> FloatArray:
        """The same also near the detectors."""
        fading, distance = self._fading_and_distance(points, LESS_SMOOTHED_SHARE)
        zb = self.equation.extrapolation_length
        return np.asarray(zb / (2.0 * np.pi) * fading / (distance * (distance + zb) ** 2))

    def _fading_and_distance(self, points: FloatArray, smoothed: float) -> tuple[FloatArray, FloatArray]:
        """``(1 + k d) e^{-k d}``, and the distance d from each detector, both (d, n)."""
        length = smoothed * spacing_by_fading(self.distance, self.fading)(self.detectors)[:, None]
        distance = np.hypot(cdist(self.detectors, points), length)
        path = self.fading * distance
        return (1.0 + path) * np.exp(-path), distance

    def weight(self) -> Weight:
        """Weights of equations, up to a factor: the largest relative effect on a reading.

        Times a power of the distance from the light, as for the exitance, readings of a hare by 1,560 charges are off
        by 3.6 % in the median in place of 1.7.
        """
        if len(self.sources) == 0:
            return weight_by_distance(self.distance)
        light = self.exitance_of_each(self.sources) @ self.injected + self.diffuse

        def weight(points: FloatArray) -> FloatArray:
            with np.errstate(divide="ignore"):
                effects = (self.exitance_of_each(points) / light[:, None]).max(axis=0) * self.injected.sum()
            return np.asarray(np.clip(effects, LEAST_WEIGHT, MOST_WEIGHT))

        return weight

    def spacing(self) -> Spacing:
        """Spacing of charges of the first fit, up to a factor."""
        if len(self.sources) == 0:
            return self.distance
        coarsest = spacing_by_fading(self.distance, self.fading)

        def spacing(points: FloatArray) -> FloatArray:
            importance = np.maximum(self._importance(points), LEAST_IMPORTANCE)
            return np.asarray(coarsest(points) / np.sqrt(importance))

        return spacing

    def _importance(self, points: FloatArray) -> FloatArray:
        """``e^{-k s}`` for the least detour s by which points (n, 3) lie on a way to a detector, (n,)."""
        direct = cdist(self.detectors, self.sources).min(axis=1)
        detours = cdist(points, self.sources).min(axis=1) + cdist(self.detectors, points) - direct[:, None]
        return np.asarray(np.exp(-self.fading * np.maximum(detours, 0.0)).max(axis=0))

    def at(self, points: FloatArray) -> "ReadingGoal":
        """The same for other points of the surface, (d, 3)."""
        return replace(self, detectors=points)

    def relative_errors(
        self, samples: Samples, spacing: FloatArray, residual: NumberArray, exitance: NumberArray
    ) -> FloatArray:
        """Estimated relative errors of readings.

        Parameters
        ----------
        samples : Samples
            Points of the surface that were not fitted.
        spacing : (n,) ndarray
            Of charges there, unit.
        residual : (n,) ndarray
            Less the right-hand side of the boundary condition, W/unit².
        exitance : (d,) ndarray
            At the detectors, W/unit².

        Returns
        -------
        (d,) ndarray
        """
        ripples = ripple_errors(self.equation, samples, spacing, residual, self.detectors)
        with np.errstate(divide="ignore", invalid="ignore"):
            if len(self.sources) == 0:
                return np.asarray(ripples / np.abs(exitance))
            effects = self._effects(samples.points)
            squares = squared_errors(effects * residual, samples.areas, spacing) + (RIPPLING * ripples) ** 2
            return np.asarray(np.sqrt(squares) / np.abs(exitance))

    def excess(self, errors: FloatArray, estimate: float, tolerance: float | None) -> float:
        """The largest relative error over its tolerance, of readings (d,) and, with a tolerance, of the exitance."""
        worst = float(errors.max()) / self.tolerance
        # Not a number where nothing is read.
        worst = worst if np.isfinite(worst) else np.inf
        return worst if tolerance is None else max(worst, estimate / tolerance)


def squared_errors(parts: NumberArray, areas: FloatArray, spacing: FloatArray) -> FloatArray:
    """Squares of errors of readings by residuals: their sum, and what random signs leave, (d,), W²/unit⁴.

    Parameters
    ----------
    parts : (d, n) ndarray
        Residuals times what each changes of each reading, W/unit⁴.
    areas : (n,) ndarray
        Of the points of the surface.
    spacing : (n,) ndarray
        Of charges there, unit.
    """
    summed, random = np.abs(parts @ areas), np.abs(parts * spacing) ** 2 @ areas
    return np.asarray((SUMMED * summed) ** 2 + RANDOM**2 * random)


def ripple_errors(
    equation: Equation, samples: Samples, spacing: FloatArray, residual: NumberArray, points: FloatArray
) -> FloatArray:
    """Errors of the exitance at points (d, 3) by ripples of the residual around them, (d,), W/unit²."""
    squares = np.abs(exitance_error(equation, residual, spacing)) ** 2
    near = samples.tree.query(points, k=min(AVERAGED, len(samples)))[1]
    return np.asarray(np.sqrt(squares[near.reshape(len(points), -1)].mean(axis=1)))


def reading_goal(
    surface: Surface,
    equation: Equation,
    sources: FloatArray,
    powers: NumberArray,
    diffuse: float,
    detectors: FloatArray,
    tolerance: float,
) -> ReadingGoal:
    """The goal of readings at points of a body's surface.

    Parameters
    ----------
    surface : Surface
    equation : Equation
        Below it.
    sources : (p, 3) ndarray
    powers : (p,) ndarray
        Of all lights together, W.
    diffuse : float
        Right-hand side of the boundary condition, W/unit².
    detectors : (d, 3) ndarray
    tolerance : float
        Wanted relative error of each reading.
    """
    depths = surface.distances(sources) if len(sources) else np.zeros(0)
    injected = np.abs(powers) * (1.0 + depths / equation.extrapolation_length)
    return ReadingGoal(equation, distance_from(surface, sources), sources, injected, abs(diffuse), detectors, tolerance)
