"""`FitProblem`: residuals of readings and their derivatives, on a fixed mesh."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tetlux.fem.inverse.parameters import FitUnknowns
from tetlux.fem.inverse.unknowns import GAIN, slopes_of_media
from tetlux.fem.lights.places import MovedLight
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region
from tetlux.fem.models.modulation import shift_of_frequency
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.sensitivity.sensitivity import sensitivity
from tetlux.fem.sources.light import Light
from tetlux.fem.system import System
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Least squares of logarithms of readings by parameters of unknowns, on a fixed mesh.

    Parameters are logarithms of coefficients, and places of lights: `FitUnknowns.parameters` and `values` convert them.

    Attributes
    ----------
    surface : Surface
    mesh : TetMesh
    lights : sequence of Light
        Each has readings of its own. Those that are moved are where the mesh was made for.
    detectors : sequence of detectors
        Where the readings were measured.
    regions : sequence of Region
        Only their surfaces are used; `unknowns` holds the media.
    unknowns : FitUnknowns
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
    ...     return minimize(problem.value_and_gradient, problem.start, jac=True, method="BFGS")
    """

    surface: Surface
    mesh: TetMesh
    lights: Sequence[Light]
    detectors: Sequence[Detector]
    regions: Sequence[Region]
    unknowns: FitUnknowns
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

    @property
    def start(self) -> FloatArray:
        """Parameters to begin with, (u,)."""
        return self.unknowns.parameters(self.unknowns.start)

    def residuals(self, parameters: FloatArray) -> FloatArray:
        """ln(fitted reading/measured reading) over the noise, (n,); real and imaginary parts of complex readings.

        Infinite where a light has been moved to where it does not light the body.
        """
        try:
            return self._at(parameters)[0]
        except InputError:
            if not (self.unknowns.coordinates and self.evaluations):
                raise
            return np.full(self.number, np.inf)

    @property
    def number(self) -> int:
        """Number of residuals."""
        return int(np.isfinite(self.readings).sum()) * (2 if np.iscomplexobj(self.readings) else 1)

    def jacobian(self, parameters: FloatArray) -> FloatArray:
        """Derivatives of the residuals with respect to the parameters, (n, u)."""
        return self._at(parameters)[1]

    def value_and_gradient(self, parameters: FloatArray) -> tuple[float, FloatArray]:
        """Half the sum of the squares of the residuals, and its gradient (u,)."""
        residuals, jacobian, _ = self._at(parameters)
        return 0.5 * float(residuals @ residuals), residuals @ jacobian

    def fitted(self, parameters: FloatArray) -> NumberArray:
        """Readings of the model, times the gain, (c, l, d), W/unit²."""
        return self._at(parameters)[2]

    def _at(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray, NumberArray]:
        key = np.asarray(parameters, dtype=float).tobytes()
        if key not in self._found:
            found = self._evaluate(self.unknowns.values(np.asarray(parameters, dtype=float)))
            self._counter["evaluations"] += 1
            self._found.clear()
            self._found[key] = found
        return self._found[key]

    def _evaluate(self, values: FloatArray) -> tuple[FloatArray, FloatArray, NumberArray]:
        """Residuals (n,), their derivatives to parameters (n, u), and readings (c, l, d), at values (u,)."""
        unknowns, lights = self.unknowns, self._lights(values)
        rows, moving = unknowns.media_rows, unknowns.moving
        slopes = slopes_of_media(unknowns.of_media, values[rows])
        gain = values[unknowns.names.index(GAIN)] if GAIN in unknowns.names else 1.0
        residuals, jacobians, fitted = [], [], []
        for channel, media in enumerate(unknowns.media(values)):
            system = self._system(media)
            found = sensitivity(system, lights, self.detectors, per="region", log=True, positions=moving)
            fitted.append(found.readings * gain)
            difference = np.log(fitted[-1]) - np.log(self.readings[channel])
            by_medium = np.stack([found.derivatives["sigma_a"], found.derivatives["sigma_s_prime"]], axis=-1)
            jacobian = np.zeros((*found.readings.shape, len(values)), by_medium.dtype)
            jacobian[..., rows] = np.tensordot(by_medium, slopes[channel], axes=2)
            for column, name in enumerate(unknowns.names):
                if name in unknowns.coordinates:
                    own = unknowns.coordinates[name]
                    of_light = found.derivatives["position"][moving.index(own.light)]
                    jacobian[own.light, :, column] = of_light[:, own.axis]
            jacobian *= unknowns.slopes(values)
            if GAIN in unknowns.names:
                jacobian[..., unknowns.names.index(GAIN)] = 1.0
            measured = np.isfinite(self.readings[channel])
            noise = self.noise[channel][measured]
            residuals += _parts(_least_turn(difference[measured]) / noise)
            jacobians += _parts(jacobian[measured] / noise[:, None])
        return np.concatenate(residuals), np.concatenate(jacobians), np.array(fitted)

    def _lights(self, values: FloatArray) -> list[Light]:
        """The lights at their places by values (u,), with the charges and patches that they had when they began."""
        return [
            own if own is begun else MovedLight(own, repr(begun))
            for own, begun in zip(self.unknowns.lights(self.lights, values), self.lights, strict=True)
        ]

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
