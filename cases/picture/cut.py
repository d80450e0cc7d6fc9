"""`cut_open`: a body of tetrahedra without what is on one side of a plane."""

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError


def cut_open(
    points: FloatArray, tetrahedra: IntArray, values: FloatArray, normal: FloatArray, through: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Take away what is in front of a plane.

    Parameters
    ----------
    points : (n, 3) ndarray
    tetrahedra : (m, 4) ndarray
    values : (n,) ndarray
    normal : (3,) ndarray
        Points to what is taken away.
    through : (3,) ndarray
        A point of the plane.

    Returns
    -------
    points : (k, 3) ndarray
    triangles : (t, 3) ndarray
        The surface of what is left, closed, seen from outside.
    values : (k,) ndarray

    Raises
    ------
    InputError
        If nothing is left.
    """
    import pyvista  # noqa: PLC0415 - takes half a second

    grid = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: np.asarray(tetrahedra, dtype=int)}, np.asarray(points))
    grid.point_data["values"] = values
    left = grid.clip(normal=normal, origin=through, invert=True)
    if left.n_cells == 0:
        raise InputError("the plane of the cut takes all of the body away; move it through the body.", field="through")
    surface = left.extract_surface(algorithm="dataset_surface").triangulate().clean()
    # Pieces of tetrahedra come with either orientation.
    surface = surface.compute_normals(point_normals=False, split_vertices=False, auto_orient_normals=True)
    return (
        np.asarray(surface.points, dtype=float),
        np.asarray(surface.regular_faces, dtype=np.int64),
        np.asarray(surface["values"], dtype=float),
    )
