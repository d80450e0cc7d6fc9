"""Fields of coefficients, interpolated between values on a regular grid or on a mesh of tetrahedra."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from tetlux.fem.media.varying import Field
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.describe import as_text, one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.tets.mesh import TetMesh

# Points outside a mesh by less than this share of its diagonal take the value of the closest point of the mesh: two
# meshes of one curved body differ by about as much.
OUTSIDE_MARGIN = 0.01
# Largest origin and spacing, in any unit: their quotients do not overflow.
LARGEST_LENGTH = 1e30
# A point outside a grid by less than this many spacings is on its rim, but for rounding.
RIM_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class _Grid:
    values: FloatArray | npt.NDArray[np.float32]
    origin: FloatArray
    spacing: FloatArray

    def __call__(self, points: FloatArray) -> FloatArray:
        indices = (points - self.origin) / self.spacing
        counts = np.array(self.values.shape)
        covered = ((indices >= -0.5 - RIM_TOLERANCE) & (indices <= counts - 0.5 + RIM_TOLERANCE)).all(axis=1)
        if not covered.all():
            low, high = self.origin - 0.5 * self.spacing, self.origin + (counts - 0.5) * self.spacing
            raise InputError(
                f"the grid from {as_text(low)} to {as_text(high)} does not cover the body: at "
                f"{as_text(points[np.argmin(covered)])} it has no value; check its origin, spacing and unit."
            )
        # Imported here, since SciPy's module of images takes a tenth of the time that tetlux.fem takes to import.
        from scipy.ndimage import map_coordinates  # noqa: PLC0415

        # "nearest" continues the outermost values to the far sides of their voxels.
        return np.asarray(map_coordinates(self.values, indices.T, output=np.float64, order=1, mode="nearest"))

    __repr__ = one_line


def grid_field(values: npt.ArrayLike, *, origin: Vector, spacing: float | Vector) -> Field:
    """Make a field from values on a regular grid, by trilinear interpolation.

    A value belongs to the centre of its voxel. In the outer half of an outermost voxel, its value is constant.

    Parameters
    ----------
    values : (nx, ny, nz) array_like
        Value ``[i, j, k]`` is at ``origin + (i, j, k) * spacing``.
    origin : (3,) floats
        Centre of the first voxel, unit.
    spacing : float or (3,) floats
        Distance between neighbouring values along each axis, unit.

    Returns
    -------
    Field
        It raises InputError at points that the grid does not cover.

    Raises
    ------
    InputError
        If the values are not a three-dimensional array of finite numbers, `origin` is not three finite numbers, or
        `spacing` is not positive.

    Examples
    --------
    >>> field = grid_field([[[0.1]], [[0.2]]], origin=(0.0, 0.0, 0.0), spacing=1.0)
    >>> field(np.array([[0.5, 0.0, 0.0], [1.5, 0.0, 0.0]])).round(6).tolist()
    [0.15, 0.2]
    """
    array = _finite_array(values, "the grid")
    if array.ndim != 3 or array.size == 0:
        raise InputError(f"a grid needs values along x, y and z, and has the shape {array.shape}.")
    start = np.asarray(origin, dtype=float)
    if start.shape != (3,) or not (np.abs(start) <= LARGEST_LENGTH).all():
        raise InputError(f"origin is {origin}; give three finite coordinates, the middle of the first voxel.")
    step = np.asarray(spacing, dtype=float)
    if step.shape not in ((), (3,)) or not ((step > 0) & (step <= LARGEST_LENGTH)).all():
        raise InputError(f"spacing is {spacing}; give one length greater than 0, or three.")
    if (step < 1.0 / LARGEST_LENGTH).any():
        raise InputError(f"spacing is {spacing}; give lengths of at least {1.0 / LARGEST_LENGTH:g}.")
    return _Grid(array, start, np.broadcast_to(step, 3))


@dataclass(frozen=True, eq=False)
class _OnMesh:
    mesh: TetMesh
    values: FloatArray | npt.NDArray[np.float32]
    at: Literal["nodes", "tetrahedra"]

    def __call__(self, points: FloatArray) -> FloatArray:
        cells, weights = self.mesh.locate(points)
        outside = np.flatnonzero(cells < 0)
        if len(outside):
            nearest, faces, _ = self.mesh.closest_boundary(points[outside])
            distance = np.linalg.norm(nearest - points[outside], axis=1)
            if distance.max() > OUTSIDE_MARGIN * self.mesh.diagonal:
                worst = int(distance.argmax())
                raise InputError(
                    f"the mesh of the values does not cover the body: at {as_text(points[outside[worst]])} it has no "
                    f"value, {distance[worst]:.3g} {self.mesh.unit} outside; check its coordinates and unit."
                )
            cells[outside] = self.mesh.boundary_cells[faces]
            weights[outside] = self.mesh.barycentric(nearest, cells[outside])
        if self.at == "tetrahedra":
            return self.values[cells].astype(np.float64)
        # Rounding can make a weight negative, and so the result less than all values.
        weights = weights.clip(0.0)
        weights /= weights.sum(axis=1, keepdims=True)
        return np.asarray((weights * self.values[self.mesh.tetrahedra[cells]]).sum(axis=1))

    __repr__ = one_line


def mesh_field(mesh: TetMesh, values: npt.ArrayLike, *, at: Literal["nodes", "tetrahedra"] = "nodes") -> Field:
    """Make a field from values on a mesh of tetrahedra.

    Points outside the mesh by less than a hundredth of its diagonal take the value of the closest point of the mesh:
    they lie between a curved surface and its facets.

    Parameters
    ----------
    mesh : TetMesh
    values : (n,) or (m,) array_like
        Values at the nodes, interpolated linearly, or one for each tetrahedron.
    at : {"nodes", "tetrahedra"}
        Where the values are given.

    Returns
    -------
    Field
        It raises InputError at points that the mesh does not cover.

    Raises
    ------
    InputError
        If there is not one finite value for each node or tetrahedron.
    """
    if at not in ("nodes", "tetrahedra"):
        raise InputError(f'values are at "{at}"; they are at "nodes" or "tetrahedra".')
    count = len(mesh.points) if at == "nodes" else len(mesh.tetrahedra)
    array = _finite_array(values, "the mesh")
    if array.shape != (count,):
        raise InputError(f"a mesh of {count} {at} needs as many values, and not an array of shape {array.shape}.")
    return _OnMesh(mesh, array, at)


def _finite_array(values: npt.ArrayLike, owner: str) -> FloatArray | npt.NDArray[np.float32]:
    array = np.asarray(values)
    if array.dtype.kind not in "buif":
        raise InputError(f"the values of {owner} are of type {array.dtype}; give real numbers.")
    bad = array.size - int(np.isfinite(array).sum())
    if bad:
        raise InputError(f"{bad} of {array.size} values of {owner} are not finite; give a number at each place.")
    # Single precision remains, since image stacks are large.
    return array if array.dtype == np.float32 else array.astype(np.float64)
