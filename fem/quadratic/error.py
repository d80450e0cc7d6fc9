"""The error of what is read, and the share of each tetrahedron in it.

A detector's reading is linear in the fluence, and a dual solution z, with the reading as its load, is the weight of a
local error in it. With quadratic elements and their gradients averaged by R over nodes, in each tetrahedron K::

    eta_K = D ∫_K (grad phi_h - R grad phi_h) . (grad z_h - R grad z_h)

These have either sign and cancel mostly, like the steps of a random walk, but not all: the error is
``SIZE sqrt(sum eta_K² + (SUM sum eta_K)²)``.
Points that lie off the mesh, where its bent facets miss the true surface, add what the fluence changes by on the way.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.coefficients import at_cells
from tetlux.fem.quadratic.roughness import roughness
from tetlux.fem.quadratic.sight import Sight
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line

# Calibrated so that the true error is within twice the bar for 95 % of readings (`tests.benchmarks.readings`).
SIZE, SUM = 0.48, 0.4
# The share of a reading that is always added: what gradients do not show, such as how far the surface is known.
LEAST = 5e-4
# A broad beam is one ray through the middle of each facet, where bubbles are 4/3 of their mean: this share of what they
# get of the beam is in doubt.
RAYS = 0.35


@dataclass(frozen=True, eq=False)
class ReadingError:
    """A reading and its error.

    Attributes
    ----------
    value : float
        W/unit².
    squares : (m,) ndarray
        Squares of what tetrahedra add to its error.
    sum : float
        What they add together, by their signs, W/unit².
    rays : float
        What rays in place of broad beams add, W/unit².
    """

    value: float
    squares: FloatArray
    sum: float
    rays: float

    @staticmethod
    def add(parts: "Sequence[ReadingError]") -> "ReadingError":
        """The reading of several lights together."""
        return ReadingError(
            sum(part.value for part in parts),
            np.sum([part.squares for part in parts], axis=0),
            sum(part.sum for part in parts),
            sum(part.rays for part in parts),
        )

    @property
    def error(self) -> float:
        """Estimated error, W/unit²."""
        return float(np.sqrt(self.squares.sum() + self.sum**2 + self.rays**2 + (LEAST * self.value) ** 2))

    @property
    def relative(self) -> float:
        """Estimated relative error; infinite if nothing is read."""
        return self.error / abs(self.value) if self.value else np.inf

    __repr__ = one_line


def read_with_error(solution: QuadraticSolution, sight: Sight) -> ReadingError:
    """What is read and how far it is off."""
    operator = solution.operator
    mesh, space = operator.mesh, operator.space
    dual = operator.duals([sight])[0]
    local = np.einsum("mij,mij->m", solution.unresolved, roughness(space, dual)) / 4.0
    local *= operator.coefficients.diffusion * mesh.volumes
    value = solution.read(sight)
    seen = operator.see(sight)
    squares = (SIZE * local) ** 2
    if not sight.inside:
        # Along the normal fluence changes by itself over the extrapolation length.
        steepness = operator.coefficients.robin / at_cells(operator.coefficients.diffusion, seen.cells)
        off = float(np.abs(sight.weights) @ (seen.away * steepness)) * abs(value)
        squares[seen.cells[0]] += off**2
    rays = RAYS * float(solution.broad_beams @ dual)
    return ReadingError(value, squares, SIZE * SUM * float(local.sum()), rays)


def fluence_with_error(solution: QuadraticSolution, points: FloatArray) -> FloatArray:
    """Fluence at points (q, 3) inside the body, W/unit², and its relative error, (2, q)."""
    sights = [Sight(point[None], np.ones(1), inside=True) for point in points]
    solution.operator.duals(sights)
    readings = [read_with_error(solution, sight) for sight in sights]
    return np.array([[reading.value for reading in readings], [reading.relative for reading in readings]])
