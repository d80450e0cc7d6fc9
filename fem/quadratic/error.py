"""The error of what is read, and the share of each tetrahedron in it.

A detector's reading is linear in the fluence, and a dual solution z, with the reading as its load, is the weight of a
local error in it. With quadratic elements and their gradients averaged by R over nodes, in each tetrahedron K::

    eta_K = D ∫_K (grad phi_h - R grad phi_h) . (grad z_h - R grad z_h)

These have either sign and cancel mostly, like the steps of a random walk, but not all: the error is
``SIZE sqrt(sum eta_K² + (SUM sum eta_K)²)``.
Points that lie off the mesh, where its bent facets miss the true surface, add what the fluence changes by on the way.
"""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.coefficients import at_cells
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.quadratic.roughness import roughness
from tetlux.fem.quadratic.sight import Sight
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line

# Calibrated so that the true error is within twice the bar for 95 % of readings (`tests.benchmarks.readings`).
SIZE, SUM = 0.55, 0.4
# The share of a reading that is always added: what gradients do not show, such as how far the surface is known.
LEAST = 5e-4


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
    """

    value: float
    squares: FloatArray
    sum: float

    @property
    def error(self) -> float:
        """Estimated error, W/unit²."""
        return float(np.sqrt(self.squares.sum() + self.sum**2 + (LEAST * self.value) ** 2))

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
        robin = boundary_condition_of(operator.coefficients.outer).robin
        steepness = robin / at_cells(operator.coefficients.diffusion, seen.cells)
        off = float(np.abs(sight.weights) @ (seen.away * steepness)) * abs(value)
        squares[seen.cells[0]] += off**2
    return ReadingError(value, squares, SIZE * SUM * float(local.sum()))
