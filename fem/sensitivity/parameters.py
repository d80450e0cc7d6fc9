"""What coefficients are varied of: nodes, tetrahedra, regions or the voxels of a grid."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.media.coefficients import WITHIN
from tetlux.meshing.arrays import FloatArray, IntArray, Vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True)
class Grid:
    """Coefficients at the points of a regular grid, interpolated linearly as by `grid_field`.

    Parameters
    ----------
    shape : (3,) int
        Number of points along each axis.
    origin : (3,) floats
        The first point, unit.
    spacing : float or (3,) floats
        Distance between neighbouring points, along each axis or along all, unit.

    Raises
    ------
    InputError
        If a number of points or a spacing is not positive.

    Examples
    --------
    >>> Grid(shape=(20, 20, 10), origin=(-9.5, -9.5, 0.5), spacing=1.0).size
    4000
    """

    shape: tuple[int, int, int]
    origin: Vector
    spacing: float | Vector

    def __post_init__(self) -> None:
        if len(self.shape) != 3 or min(self.shape) < 1:
            raise InputError(f"the grid has shape {self.shape}; give three numbers of points, at least 1.")
        if not (np.isfinite(self.origin).all() and len(self.origin) == 3):
            raise InputError(f"the grid's origin is {self.origin}; give three finite coordinates.")
        if not (np.isfinite(self.spacing).all() and np.min(self.spacing) > 0):
            raise InputError(f"the grid's spacing is {self.spacing}; give one length greater than 0, or three.")

    @property
    def size(self) -> int:
        """Number of its points."""
        return int(np.prod(self.shape))

    def weights(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Numbers of the eight grid points around each of some points (q, 3), and their weights, two (q, 8)."""
        counts = np.array(self.shape)
        places = np.clip((points - np.array(self.origin)) / np.asarray(self.spacing), 0.0, counts - 1.0)
        low = np.minimum(places.astype(np.int64), np.maximum(counts - 2, 0))
        numbers, weights = np.empty((len(points), 8), dtype=np.int64), np.ones((len(points), 8))
        for corner in range(8):
            up = np.array([corner >> 2 & 1, corner >> 1 & 1, corner & 1])
            at = np.minimum(low + up, counts - 1)
            numbers[:, corner] = np.ravel_multi_index(tuple(at.T), self.shape)
            weights[:, corner] = np.where(up == 1, places - low, 1.0 - (places - low)).prod(axis=1)
        return numbers, weights


Per = Literal["node", "tetrahedron", "region"] | Grid


def parameter_shares(mesh: TetMesh, labels: IntArray, per: Per) -> csr_array:
    """Shares of parameters in the coefficient of each tetrahedron, (m, p); each row sums to 1.

    Parameters
    ----------
    mesh : TetMesh
    labels : (m,) ndarray
        The number of the medium of each tetrahedron, from 0.
    per : {"node", "tetrahedron", "region"} or Grid
        The coefficient of a tetrahedron is the mean of those at its nodes; of a grid it is that of the four points by
        which a medium that varies is evaluated.

    Raises
    ------
    InputError
        If it is none of these.
    """
    cells = len(mesh.tetrahedra)
    if isinstance(per, Grid):
        numbers, weights = per.weights((WITHIN @ mesh.points[mesh.tetrahedra]).reshape(-1, 3))
        rows = np.repeat(np.arange(cells), 32)
        return csr_array((0.25 * weights.ravel(), (rows, numbers.ravel())), shape=(cells, per.size))
    if per == "node":
        columns, count = mesh.tetrahedra, len(mesh.points)
    elif per == "tetrahedron":
        columns, count = np.arange(cells)[:, None], cells
    elif per == "region":
        columns, count = labels[:, None], int(labels.max()) + 1
    else:
        raise InputError(f'per is "{per}"; it is "node", "tetrahedron", "region" or a Grid.', field="per")
    width = columns.shape[1]
    shares = np.full(columns.size, 1.0 / width)
    return csr_array((shares, columns.ravel(), np.arange(0, columns.size + 1, width)), shape=(cells, count))
