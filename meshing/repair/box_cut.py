"""The part of a surface's body that lies within a box, closed by the faces of the box."""

from dataclasses import replace

import numpy as np

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.repair.crossings import count_self_intersections
from tetlux.meshing.repair.topology import Edges
from tetlux.meshing.surface.solids import Sphere
from tetlux.meshing.surface.subdivide import mark_longest_edges, number_triangle_edges, split_edges
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import signed_volume

# Points nearer than this share of the box are joined.
MERGE = 1e-9
# Rounds of splitting large triangles around the box; each halves edges.
MOST_SPLITS = 80


def cut_to_box(surface: Surface, low: FloatArray, high: FloatArray) -> Surface | None:
    """The surface of the part of a body within a box.

    Parameters
    ----------
    surface : Surface
    low, high : (3,) ndarray
        Corners of the box, unit.

    Returns
    -------
    Surface or None
        None if no part of the body is within the box.

    Raises
    ------
    InputError
        If the cut is not closed, as where triangles meet the box at their edges.
    """
    inside = ((surface.points > low) & (surface.points < high)).all(axis=1)
    if inside.all():
        return surface
    # VTK takes a tenth of a second to import.
    from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: PLC0415
    from vtkmodules.vtkCommonDataModel import vtkPlane, vtkPlaneCollection  # noqa: PLC0415
    from vtkmodules.vtkFiltersCore import vtkCleanPolyData, vtkTriangleFilter  # noqa: PLC0415
    from vtkmodules.vtkFiltersGeneral import vtkClipClosedSurface  # noqa: PLC0415

    planes = vtkPlaneCollection()
    for axis in range(3):
        for side, corner in ((1.0, low), (-1.0, high)):
            plane = vtkPlane()
            plane.SetNormal(*(side * np.eye(3)[axis]))
            plane.SetOrigin(*corner)
            planes.AddItem(plane)
    clip, triangles, clean = vtkClipClosedSurface(), vtkTriangleFilter(), vtkCleanPolyData()
    clip.SetInputData(_as_vtk(surface))
    clip.SetClippingPlanes(planes)
    triangles.SetInputConnection(clip.GetOutputPort())
    clean.SetInputConnection(triangles.GetOutputPort())
    clean.SetTolerance(MERGE)
    clean.Update()
    found = clean.GetOutput()
    if found.GetNumberOfPolys() == 0:
        return None
    points = np.array(vtk_to_numpy(found.GetPoints().GetData()), dtype=np.float64)
    faces = np.array(vtk_to_numpy(found.GetPolys().GetConnectivityArray()), dtype=np.int64).reshape(-1, 3)
    edges = Edges(faces)
    if (edges.balance != 0).any() or signed_volume(points, faces) <= 0:
        raise InputError("the cut of the surface is not closed")
    crosses = surface.overlaps or (count_self_intersections(points, faces) or 0) > 0
    return replace(surface, points=points, faces=faces, overlaps=crosses, shape=None)


def refine_around(surface: Surface, place: FloatArray, radius: float, edge: float) -> Surface:
    """Split the triangles near a place, with their new vertices on the smooth surface; on the sphere, if it is one.

    Parameters
    ----------
    surface : Surface
    place : (3,) ndarray
        unit.
    radius : float
        Triangles nearer than this are split, unit.
    edge : float
        Edges longer than this are split, unit.

    Returns
    -------
    Surface
    """
    flat, points, faces, parents = surface.points, surface.points, surface.faces, np.arange(len(surface.faces))
    shape = surface.shape
    for _ in range(MOST_SPLITS):
        edges = ends, number = number_triangle_edges(faces)
        middles, lengths = flat[ends].mean(axis=1), np.linalg.norm(flat[ends[:, 0]] - flat[ends[:, 1]], axis=1)
        marked = (lengths > edge) & (np.linalg.norm(points[ends].mean(axis=1) - place, axis=1) < radius + lengths)
        if not marked.any():
            break
        marked = mark_longest_edges(flat, edges, marked)
        owner = np.empty(len(ends), dtype=np.int64)
        owner[number.ravel()] = np.repeat(parents, 3)
        flat, faces, origin = split_edges(flat, faces, edges, marked)
        if isinstance(shape, Sphere):
            away = middles[marked] - np.asarray(shape.center)
            new = shape.center + shape.radius * away / np.linalg.norm(away, axis=1)[:, None]
        else:
            new = surface.on_curve(owner[marked], middles[marked])[0]
        points = np.vstack([points, new])
        parents = parents[origin]
    return replace(surface, points=points, faces=faces)


def _as_vtk(surface: Surface) -> object:
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray  # noqa: PLC0415
    from vtkmodules.vtkCommonCore import vtkPoints  # noqa: PLC0415
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData  # noqa: PLC0415

    points, cells, data = vtkPoints(), vtkCellArray(), vtkPolyData()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(surface.points, dtype=np.float64), deep=True))
    offsets = np.arange(0, 3 * len(surface.faces) + 1, 3, dtype=np.int64)
    connectivity = np.ascontiguousarray(surface.faces.ravel(), dtype=np.int64)
    cells.SetData(numpy_to_vtkIdTypeArray(offsets, deep=True), numpy_to_vtkIdTypeArray(connectivity, deep=True))
    data.SetPoints(points)
    data.SetPolys(cells)
    return data
