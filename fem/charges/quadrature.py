"""Quadrature over a smooth surface."""

import numpy as np

from tetlux.fem.charges.samples import Cells, Samples, Spacing, cells_of
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides

# Largest size of a group of triangles that has one point, in spacings, with 100 charges. Exited power, and norm of the
# residual, are then off by .05 % and 1 % (hare, spot: 3.6 %), and twice as large by .2 and 5 (17) %.
LARGEST_GROUP = 0.4
# With more charges the same number of points suffices, down to groups of this size.
LARGEST_GROUP_OF_MANY = 0.8
# Longest side of a part of a triangle, in spacings.
LARGEST_PIECE = 1.0
# Parts of a triangle up to this share of the spacing have one point; longer ones have the middles of their sides, exact
# for quadratics.
LARGEST_ONE_POINT_PIECE = 0.5
MIDDLES = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])


def group_size(count: int) -> float:
    """The largest size of a group of triangles that has one point, in spacings of `count` charges."""
    return float(np.clip(LARGEST_GROUP * np.sqrt(count / 100.0), LARGEST_GROUP, LARGEST_GROUP_OF_MANY))


def quadrature(surface: Surface, spacing: Spacing, count: int = 100) -> Samples:
    """Points and weights on the smooth surface, to integrate the field of `count` charges a spacing apart.

    A group of triangles has one point, the one nearest to its centroid: the points are as many as the spacing asks for,
    however many triangles there are.
    """
    cells = cells_of(surface, spacing, group_size(count), LARGEST_PIECE)
    grouped = cells.is_group
    points, normals = surface.project(cells.centroids[grouped])
    of_groups = points, normals, cells.areas[grouped], cells.spacing[grouped]
    of_pieces = _points_of_pieces(surface, cells, np.flatnonzero(~grouped))
    return Samples(*(np.concatenate(both) for both in zip(of_groups, of_pieces, strict=True)))


def _points_of_pieces(surface: Surface, cells: Cells, some: IntArray) -> tuple[FloatArray, ...]:
    """Points, normals, weights and spacings of cells that are parts of one triangle, mapped to the smooth surface."""
    corners = cells.corners[some]
    coarse = longest_sides(corners) > LARGEST_ONE_POINT_PIECE * cells.spacing[some]
    own = np.concatenate([some[~coarse], np.repeat(some[coarse], 3)])
    at_sides = np.einsum("pi,mij->mpj", MIDDLES, corners[coarse]).reshape(-1, 3)
    flat = np.vstack([corners[~coarse].mean(axis=1), at_sides])
    shares = np.where(np.arange(len(own)) < (~coarse).sum(), 1.0, 1.0 / 3.0)
    points, normals = surface.on_curve(cells.faces[own], flat)
    return points, normals, shares * cells.areas[own], cells.spacing[own]
