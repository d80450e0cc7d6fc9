"""The error of a reading, and the contribution of each tetrahedron to it.

A reading is linear in the fluence. The dual solution z, whose load is the reading, is the weight of a local residual in
it. With R the average of gradients over the tetrahedra around a node, the contribution of a tetrahedron K is::

    eta_K = D ∫_K (grad phi_h - R grad phi_h) . (grad z_h - R grad z_h)

Contributions have either sign and cancel mostly, like the steps of a random walk. The estimated error is
``RANDOM_SCALE sqrt(sum eta_K² + (CORRELATED_WEIGHT sum eta_K)²)``. Where bent facets differ from the true surface, the
change of the fluence over that distance is added.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.coefficients import at_cells
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.quadratic.measurement import Measurement
from tetlux.fem.quadratic.recovered_gradient import recovered_gradient_difference
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line

# Factor of all contributions. With it the true error is at most twice the estimated error for 95 % of readings
# (`tests.benchmarks.readings`).
RANDOM_SCALE = 0.48
# Weight of the sum of contributions, which do not cancel entirely, beside the root of their squares.
CORRELATED_WEIGHT = 0.4
# Relative error that is always added, for errors that gradients do not show, such as those of the surface itself.
LEAST_RELATIVE_ERROR = 5e-4
# Relative error of the load of broad beams on bubbles. A broad beam is one ray through the middle of each facet, where
# bubbles are 4/3 of their mean.
BEAM_RELATIVE_ERROR = 0.35


@dataclass(frozen=True, eq=False)
class ReadingError:
    """A reading and its estimated error.

    Attributes
    ----------
    value : float
        W/unit².
    squares : (m,) ndarray
        Squares of the contributions of tetrahedra to its error.
    sum : float
        Weighted sum of the signed contributions, W/unit².
    rays : float
        Contribution of rays in place of broad beams, W/unit².
    """

    value: float
    squares: FloatArray
    sum: float
    rays: float

    @staticmethod
    def add(parts: "Sequence[ReadingError]") -> "ReadingError":
        """The reading of the sum of several lights."""
        return ReadingError(
            sum(part.value for part in parts),
            np.sum([part.squares for part in parts], axis=0),
            sum(part.sum for part in parts),
            sum(part.rays for part in parts),
        )

    @property
    def error(self) -> float:
        """Estimated error, W/unit²."""
        return float(
            np.sqrt(self.squares.sum() + self.sum**2 + self.rays**2 + (LEAST_RELATIVE_ERROR * self.value) ** 2)
        )

    @property
    def relative(self) -> float:
        """Estimated relative error; infinite if the reading is 0."""
        return self.error / abs(self.value) if self.value else np.inf

    __repr__ = one_line


def read_with_error(solution: QuadraticSolution, measurement: Measurement) -> ReadingError:
    """The value of a measurement and its estimated error."""
    operator = solution.operator
    mesh, space = operator.mesh, operator.space
    dual = operator.duals([measurement])[0]
    local = np.einsum("mij,mij->m", solution.gradient_difference, recovered_gradient_difference(space, dual)) / 4.0
    local *= operator.coefficients.diffusion * mesh.volumes
    value = solution.read(measurement)
    discrete = operator.discretise(measurement)
    squares = (RANDOM_SCALE * local) ** 2
    if not measurement.inside:
        # Along the normal the relative change of the fluence over the extrapolation length is 1.
        robin = boundary_condition_of(operator.coefficients.outer).robin
        steepness = robin / at_cells(operator.coefficients.diffusion, discrete.cells)
        off = float(np.abs(measurement.weights) @ (discrete.distances_from_mesh * steepness)) * abs(value)
        squares[discrete.cells[0]] += off**2
    rays = BEAM_RELATIVE_ERROR * float(solution.broad_beams @ dual)
    return ReadingError(value, squares, RANDOM_SCALE * CORRELATED_WEIGHT * float(local.sum()), rays)


def fluence_with_error(solution: QuadraticSolution, points: FloatArray) -> FloatArray:
    """Fluence at points (q, 3) inside the body, W/unit², and its relative error, (2, q)."""
    measurements = [Measurement(point[None], np.ones(1), inside=True) for point in points]
    solution.operator.duals(measurements)
    readings = [read_with_error(solution, measurement) for measurement in measurements]
    return np.array([[reading.value for reading in readings], [reading.relative for reading in readings]])
