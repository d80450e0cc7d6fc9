"""`FitProblem`: residuals of readings and their derivatives, on a fixed mesh."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tetlux.fem.inverse.unknowns import GAIN, Unknowns, slopes_of_media
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region
from tetlux.fem.models.modulation import shift_of_frequency
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.sensitivity.sensitivity import sensitivity
from tetlux.fem.sources.light import Light
from tetlux.fem.system import System
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Least squares of logarithms of readings by logarithms of unknowns, on a fixed mesh.

    Attributes
    ----------
    surface : Surface
    mesh : TetMesh
    lights : sequence of Light
        Each has readings of its own.
    detectors : sequence of detectors
        Where the readings were measured.
    regions : sequence of Region
        Only their surfaces are used; `unknowns` holds the media.
    unknowns : Unknowns
    readings : (c, l, d) ndarray
        Measured exitance of each channel, light and detector, W/unit²; nan where there is none.
    noise : (c, l, d) ndarray
        Relative standard deviations.
    frequency : float
        Hz; 0 for steady light.
    outside_index : float
        Refractive index of what surrounds the body.

    Examples
    --------
    With another optimizer, that of SciPy for functions of several variables:

    >>> def minimize_by_bfgs(problem):
    ...     from scipy.optimize import minimize
    ...
    ...     return minimize(problem.value_and_gradient, np.log(problem.unknowns.start), jac=True, method="BFGS")
    """

    surface: Surface
    mesh: TetMesh
    lights: Sequence[Light]
    detectors: Sequence[Detector]
    regions: Sequence[Region]
    unknowns: Unknowns
    readings: NumberArray
    noise: FloatArray
    frequency: float = 0.0
    outside_index: float = 1.0
    _found: dict[bytes, tuple[FloatArray, FloatArray, NumberArray]] = field(default_factory=dict)
    _counter: Counter[str] = field(default_factory=Counter)

    @property
    def evaluations(self) -> int:
        """How often readings and derivatives were computed."""
        return self._counter["evaluations"]

    def residuals(self, logarithms: FloatArray) -> FloatArray:
        """ln(fitted reading/measured reading) over the noise, (n,); real and imaginary parts of complex readings."""
        return self._at(logarithms)[0]

    def jacobian(self, logarithms: FloatArray) -> FloatArray:
        """Derivatives of the residuals with respect to the logarithms of the unknowns, (n, u)."""
        return self._at(logarithms)[1]

    def value_and_gradient(self, logarithms: FloatArray) -> tuple[float, FloatArray]:
        """Half the sum of the squares of the residuals, and its gradient (u,)."""
        residuals, jacobian, _ = self._at(logarithms)
        return 0.5 * float(residuals @ residuals), residuals @ jacobian

    def fitted(self, logarithms: FloatArray) -> NumberArray:
        """Readings of the model, times the gain, (c, l, d), W/unit²."""
        return self._at(logarithms)[2]

    def _at(self, logarithms: FloatArray) -> tuple[FloatArray, FloatArray, NumberArray]:
        key = np.asarray(logarithms, dtype=float).tobytes()
        if key not in self._found:
            self._found.clear()
            self._counter["evaluations"] += 1
            self._found[key] = self._evaluate(np.exp(logarithms))
        return self._found[key]

    def _evaluate(self, values: FloatArray) -> tuple[FloatArray, FloatArray, NumberArray]:
        """Residuals (n,), their derivatives to logarithms (n, u), and readings (c, l, d), at values (u,)."""
        slopes = slopes_of_media(self.unknowns, values)
        gain = values[self.unknowns.names.index(GAIN)] if GAIN in self.unknowns.names else 1.0
        residuals, jacobians, fitted = [], [], []
        for channel, media in enumerate(self.unknowns.media(values)):
            found = sensitivity(self._system(media), self.lights, self.detectors, per="region", log=True)
            fitted.append(found.readings * gain)
            difference = np.log(fitted[-1]) - np.log(self.readings[channel])
            by_medium = np.stack([found.derivatives["sigma_a"], found.derivatives["sigma_s_prime"]], axis=-1)
            jacobian = np.tensordot(by_medium, slopes[channel], axes=2) * values
            if GAIN in self.unknowns.names:
                jacobian[..., self.unknowns.names.index(GAIN)] = 1.0
            measured = np.isfinite(self.readings[channel])
            noise = self.noise[channel][measured]
            residuals += _parts(_least_turn(difference[measured]) / noise)
            jacobians += _parts(jacobian[measured] / noise[:, None])
        return np.concatenate(residuals), np.concatenate(jacobians), np.array(fitted)

    def _system(self, media: Sequence[Medium]) -> System:
        regions = tuple(replace(region, medium=medium) for region, medium in zip(self.regions, media[1:], strict=True))
        shift: complex = 0.0
        if self.frequency:
            shift = shift_of_frequency(self.frequency, media[0], self.surface.unit, self.outside_index)
        return System(self.mesh, media[0], self.surface, regions=regions, shift=shift)

    __repr__ = one_line


def _least_turn(logarithms: NumberArray) -> NumberArray:
    """The same with imaginary parts between -pi and pi."""
    if not np.iscomplexobj(logarithms):
        return logarithms
    return np.asarray(logarithms.real + 1j * np.angle(np.exp(1j * logarithms.imag)))


def _parts(values: NumberArray) -> list[FloatArray]:
    return [values.real, values.imag] if np.iscomplexobj(values) else [values]
