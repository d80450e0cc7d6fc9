"""Quadrature over a smooth surface."""

import numpy as np

from tetlux.fem.charges.samples import Cells, Samples, Spacing, cells_of
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides

# Cells up to this share of the spacing have one point; longer ones have the middles of their sides, exact for
# quadratics.
LARGEST_ONE_POINT_CELL = 0.5
MIDDLES = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])
# Step of the finite difference for the area, as a share of a cell's sides.
DIFFERENCE_STEP = 1e-5


def quadrature(surface: Surface, spacing: Spacing) -> Samples:
    """Points and weights on the smooth surface, to integrate functions that vary over a spacing."""
    cells = cells_of(surface, spacing).cut(spacing, 1.0)
    coarse = longest_sides(cells.corners) > LARGEST_ONE_POINT_CELL * cells.spacing
    fine, rule = np.flatnonzero(~coarse), np.repeat(np.flatnonzero(coarse), 3)
    at_middle = cells.corners[fine].mean(axis=1)
    at_sides = np.einsum("pi,mij->mpj", MIDDLES, cells.corners[coarse]).reshape(-1, 3)
    return _map_to_surface(
        surface,
        cells,
        np.concatenate([fine, rule]),
        np.vstack([at_middle, at_sides]),
        np.concatenate([np.ones(len(fine)), np.full(len(rule), 1.0 / 3.0)]),
    )


def _map_to_surface(surface: Surface, cells: Cells, own: IntArray, flat: FloatArray, shares: FloatArray) -> Samples:
    """Points of cells mapped to the smooth surface, and their shares of the cells' areas there as weights."""
    faces, corners = cells.faces[own], cells.corners[own]
    points, normals = surface.on_curve(faces, flat)
    sides = [corners[:, i] - corners[:, 0] for i in (1, 2)]
    first, second = (
        (surface.on_curve(faces, flat + DIFFERENCE_STEP * side)[0] - points) / DIFFERENCE_STEP for side in sides
    )
    areas = 0.5 * np.linalg.norm(np.cross(first, second), axis=1)
    return Samples(points, normals, shares * areas, cells.spacing[own])
