"""`Transient`: light in time after a short pulse."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from tetlux.fem.outcome.detectors import PlacedDetector
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.quadratic.measurement import DiscreteMeasurement, Measurement
from tetlux.fem.quadratic.scene import QuadraticScene
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.fem.transient.contour import Contour
from tetlux.meshing.arrays import BoolArray, FloatArray, NumberArray
from tetlux.meshing.describe import count
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# Values below so many times their estimated error are not resolved. At twice it first light on a ball was off by up to
# 3.4 %, at a tolerance of .01 where the bar was 42 %.
RESOLVED = 3.0
# The power of the rate with which errors grow, of elements whose error is ``k r (k h)^4`` and more where k h is large;
# and the share of errors that changes from point to point of a contour: see `MeshError`.
GROWTH, DISORDER = 3.0, 0.2
# Points of the surface of which fluence in the Laplace domain is computed at once.
BLOCK = 20_000


@dataclass(frozen=True, eq=False)
class MeshError:
    """The error that the mesh makes in time.

    By the method of steepest descent a value y(t) is that of one point of the Laplace domain, ``s = y'/y``, and has the
    relative error there: that which was estimated, and beyond the rate for which it was, more by a power of s. What
    changes with s without order, as what charges leave, does not cancel where terms of the contour do.

    Attributes
    ----------
    error : (d,) ndarray or float
        Estimated relative error, the larger of steady light and of the light modulated fastest.
    rate : float
        Angular frequency of the latter, 1/s.
    """

    error: FloatArray | float
    rate: float

    def of(self, values: FloatArray, slopes: FloatArray, terms: FloatArray) -> FloatArray:
        """Errors (t, d) of values (t, d), by their slopes, 1/s, and the norm of the terms of the contour, (t, d)."""
        rises = np.divide(slopes, values, out=np.zeros_like(values), where=values > 0)
        grown = np.abs(values) * np.maximum(rises / self.rate, 1.0) ** GROWTH
        return np.asarray(self.error * (grown + DISORDER * terms))


@dataclass(frozen=True, eq=False)
class Transient:
    """Light in time after a short pulse of all lights, of 1 J for each watt of them.

    Attributes
    ----------
    times : (t,) ndarray
        Times after the pulse, s.
    steady : Solution
        The same lights shining steadily: the integral over time. Light in time has the same `mesh` and `surface`.
    detectors : tuple of PlacedDetector
        Where the detectors are.
    contours : tuple of Contour
        Contours in the Laplace domain, one for each window of the times.
    scenes : tuple of tuple of QuadraticScene
        The light at each point of each contour.
    mesh_error : MeshError
        The error that the mesh makes in the exitance of the surface.
    reading_error : MeshError
        The error that the mesh makes in the reading of each detector.
    lights : tuple of int
        Numbers of the lights that shine, from 0.
    of_lights : tuple of Transient
        What each light adds, in their order, if there are several.
    seconds : dict
        Seconds spent on surface, mesh, assemble, solve, and total.
    warnings : list of str
        Plain sentences, each a `tetlux.meshing.notes.Note` with a code.
    """

    times: FloatArray
    steady: Solution
    detectors: tuple[PlacedDetector, ...]
    contours: tuple[Contour, ...]
    scenes: tuple[tuple[QuadraticScene, ...], ...]
    mesh_error: MeshError
    reading_error: MeshError
    lights: tuple[int, ...]
    of_lights: "tuple[Transient, ...]" = ()
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    model = "full"

    @property
    def mesh(self) -> TetMesh:
        """The mesh, which is that of `steady`."""
        return self.steady.mesh

    @property
    def surface(self) -> Surface:
        """The surface that the mesh approximates."""
        return self.steady.surface

    @property
    def as_steady(self) -> Solution:
        """`steady` with the seconds and warnings of this."""
        return replace(self.steady, seconds=self.seconds, warnings=self.warnings)

    @cached_property
    def exitance(self) -> FloatArray:
        """Exitance at the boundary nodes of `mesh`, (t, b), W/unit² per J; nan where it is not resolved."""
        return self._in_time(lambda light: light.exitance_at_nodes, self.mesh_error)[0]

    def exitance_at(self, points: npt.ArrayLike) -> FloatArray:
        """Exitance at the points of the surface nearest to given points.

        Parameters
        ----------
        points : (q, 3) array_like

        Returns
        -------
        (t, q) ndarray
            W/unit² per J; nan where it is not resolved, as before light arrives, and at points that are not finite.
        """
        places = np.asarray(points, dtype=float).reshape(-1, 3)
        found = np.full((len(self.times), len(places)), np.nan)
        finite = np.flatnonzero(np.isfinite(places).all(axis=1))
        for start in range(0, len(finite), BLOCK):
            some = finite[start : start + BLOCK]
            discrete = self._discretise(self.surface.project(places[some])[0], np.ones(len(some)))
            found[:, some] = self._in_time(lambda light: light.values_at(discrete), self.mesh_error)[0]  # noqa: B023
        return found

    @cached_property
    def _read(self) -> tuple[FloatArray, FloatArray]:
        """Exitance at each detector, (t, d), and its error."""
        discrete = [self._discretise(each.measurement.points, each.measurement.weights) for each in self.detectors]

        def read(light: QuadraticSolution) -> NumberArray:
            values = [each.measurement.weights @ light.values_at(each) for each in discrete]
            return np.array(values, dtype=np.complex128)

        return self._in_time(read, self.reading_error)

    @property
    def readings(self) -> FloatArray:
        """Exitance at each detector, (t, d), W/unit² per J; nan where it is not resolved, as before light arrives."""
        return self._read[0]

    @property
    def errors(self) -> FloatArray:
        """Estimated error of each reading by mesh and contour, (t, d), W/unit² per J.

        Readings below three times this are not resolved.
        """
        return self._read[1]

    @property
    def powers(self) -> FloatArray:
        """Power that each detector collects, (t, d), W per J; nan of points, and where it is not resolved."""
        collects = [np.nan if each.area is None else each.share * each.area for each in self.detectors]
        return np.asarray(self.readings * np.array(collects, dtype=float))

    @property
    def resolved(self) -> BoolArray:
        """Whether each reading is resolved, (t, d)."""
        return np.isfinite(self.readings)

    @property
    def digits(self) -> FloatArray:
        """How many decimal digits of each reading hold, (t, d), by its error; nan where it is not resolved."""
        return np.asarray(-np.log10(self.errors / self.readings))

    def _discretise(self, places: FloatArray, weights: FloatArray) -> DiscreteMeasurement:
        quadratic = self.steady.quadratic
        assert quadratic is not None
        return quadratic.operator.discretise(Measurement(places, weights))

    def _in_time(
        self, read: Callable[[QuadraticSolution], NumberArray], of_mesh: MeshError
    ) -> tuple[FloatArray, FloatArray]:
        """Values in time (t, ...) of what is read in the Laplace domain (...), and their errors.

        Those that are not above their errors are nan.
        """
        parts = []
        for contour, scenes in zip(self.contours, self.scenes, strict=True):
            each = np.array([read(QuadraticSolution(scene, self.lights)) for scene in scenes])
            values = contour.invert(each)
            of_contour = contour.error(each) + of_mesh.of(values, contour.slopes(each), contour.norm(each))
            parts.append((values, of_contour))
        values, errors = (np.concatenate(some) for some in zip(*parts, strict=True))
        return np.where(values > RESOLVED * errors, values, np.nan), errors

    def __repr__(self) -> str:
        facts = [
            count(len(self.times), "time"),
            f"{self.times.min():g} to {self.times.max():g} s",
            count(len(self.detectors), "detector"),
            count(len(self.mesh.points), "node"),
        ]
        if self.warnings:
            facts.append(count(len(self.warnings), "warning"))
        return f"Transient({', '.join(facts)})"
