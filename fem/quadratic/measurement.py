"""`Measurement`: weighted points of the surface or inside the body; `DiscreteMeasurement`: the same on a mesh."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.boundary import boundary_condition_of
from tetlux.fem.quadratic.elements import TRIANGLE_EDGES, shape_functions
from tetlux.fem.quadratic.space import QuadraticSpace
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray, sum_by_index
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False)
class Measurement:
    """A weighted mean over points: of ``phi/(2A)`` on the surface, or of the fluence inside.

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
        return isinstance(other, Measurement) and self._key == other._key

    def discretise(self, space: QuadraticSpace, coefficients: Coefficients) -> "DiscreteMeasurement":
        """Express the measurement by the shape functions of a mesh."""
        if self.inside:
            cells, weights = space.within(self.points)
            return DiscreteMeasurement(self, space, 1.0, cells, space.cells[cells], shape_functions(weights))
        face, weights = space.on_boundary(self.points)
        mesh = space.mesh
        dofs, shape_values = space.faces(mesh.boundary_faces[face]), shape_functions(weights, TRIANGLE_EDGES)
        return DiscreteMeasurement(
            self, space, boundary_condition_of(coefficients.outer).robin, mesh.boundary_cells[face], dofs, shape_values
        )

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class DiscreteMeasurement:
    """A measurement on a mesh.

    Attributes
    ----------
    measurement : Measurement
    space : QuadraticSpace
    scale : float
        Ratio of the measured quantity to the fluence.
    cells : (q,) ndarray
        The tetrahedron at each point.
    dofs, shape_values : (q, c) ndarray
        Numbers of the shape functions at each point, and their values.
    """

    measurement: Measurement
    space: QuadraticSpace
    scale: float
    cells: IntArray
    dofs: IntArray
    shape_values: FloatArray

    @property
    def load(self) -> FloatArray:
        """The measurement of each basis function, (size,)."""
        values = self.scale * self.measurement.weights[:, None] * self.shape_values
        return sum_by_index(self.dofs, values, self.space.size)

    def values(self, function: NumberArray) -> NumberArray:
        """Values of a function (size,) at the points, (q,)."""
        return np.asarray((function[self.dofs] * self.shape_values).sum(axis=1))

    @property
    def distances_from_mesh(self) -> FloatArray:
        """Distance of each point from the point of the mesh that stands for it, (q,), unit."""
        on_mesh = self.shape_values[..., None] * self.space.corners_and_bends(self.dofs)
        return np.asarray(np.linalg.norm(on_mesh.sum(axis=1) - self.measurement.points, axis=1))

    __repr__ = one_line
