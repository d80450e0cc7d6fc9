"""`Sight`: what a reading looks at, points of the surface or inside, and what it is on a mesh."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.quadratic.elements import TRIANGLE_EDGES, functions
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.meshing.arrays import FloatArray, IntArray, sum_by_index
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False)
class Sight:
    """A mean over points: of ``phi/(2A)`` on the surface, or of the fluence inside.

    Attributes
    ----------
    points : (q, 3) ndarray
    weights : (q,) ndarray
        They sum to 1.
    inside : bool
        Whether points lie inside the body, and not on its surface.
    """

    points: FloatArray
    weights: FloatArray
    inside: bool = False

    @property
    def _key(self) -> tuple[bytes, bytes, bool]:
        return self.points.tobytes(), self.weights.tobytes(), self.inside

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sight) and self._key == other._key

    def on(self, space: QuadraticSpace, coefficients: Coefficients) -> "Seen":
        """What it is on a mesh."""
        if self.inside:
            cells, weights = space.within(self.points)
            return Seen(self, space, 1.0, cells, space.cells[cells], functions(weights))
        face, weights = space.on_boundary(self.points)
        mesh = space.mesh
        places, hats = space.faces(mesh.boundary_faces[face]), functions(weights, TRIANGLE_EDGES)
        robin = boundary_condition_of(coefficients.outer).robin
        return Seen(self, space, robin, mesh.boundary_cells[face], places, hats)

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class Seen:
    """A sight on a mesh.

    Attributes
    ----------
    sight : Sight
    space : QuadraticSpace
    scale : float
        From fluence to what is read.
    cells : (q,) ndarray
        The tetrahedron at each point.
    places, hats : (q, c) ndarray
        Functions there, and their values.
    """

    sight: Sight
    space: QuadraticSpace
    scale: float
    cells: IntArray
    places: IntArray
    hats: FloatArray

    @property
    def load(self) -> FloatArray:
        """What it reads of each function, (size,)."""
        values = self.scale * self.sight.weights[:, None] * self.hats
        return sum_by_index(self.places, values, self.space.size)

    def values(self, function: FloatArray) -> FloatArray:
        """A function (size,) at the points, (q,)."""
        return np.asarray((function[self.places] * self.hats).sum(axis=1))

    @property
    def away(self) -> FloatArray:
        """How far each point is from where the mesh has it, (q,), unit."""
        there = self.hats[..., None] * self.space.corners_and_bends(self.places)
        return np.asarray(np.linalg.norm(there.sum(axis=1) - self.sight.points, axis=1))

    __repr__ = one_line
