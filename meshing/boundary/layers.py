"""Layers of flat tetrahedra along the boundary, for what varies across the boundary far more than along it.

The tetrahedra of a mesh are pressed inwards, and the space under each boundary triangle is filled with prisms, each cut
into three tetrahedra. Every boundary node has a column of nodes under it, in distances that grow from the boundary
inwards, until layers are as high as the triangles are wide.
"""

from dataclasses import dataclass, replace

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.boundary.press import level_off, shorten, spread
from tetlux.meshing.surface.triangles import vertex_normals
from tetlux.meshing.tets.geometry import tetrahedron_volumes
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.thickness import thickness

# Each layer is this many times as high as the one above it.
GROWTH = 1.5
# Layers end where they would be higher than this many edges of the boundary triangles around a node.
HIGHEST = 0.7
# All layers together are at most this share of the local thickness of the body, ...
LARGEST_SHARE = 0.25
# ... and their depth changes by at most this much over a unit of length along the boundary.
STEEPEST = 0.4
# Where layers of less than this many times the first layer's height have room, there is none.
LEAST_DEPTH = 0.3
# A tetrahedron of a layer, or one that was pressed inwards, keeps at least this share of the volume that it would have
# with columns at right angles to the boundary.
LEAST_PART = 0.05
# Where columns cross, they are made half as deep, and after half of so many times left out.
MOST_FILLINGS = 12


@dataclass(frozen=True, eq=False)
class LayeredMesh:
    """A mesh with layers.

    Attributes
    ----------
    mesh : TetMesh
        The nodes and tetrahedra of the mesh without layers come first.
    parents : (m,) ndarray of int
        The tetrahedron of the mesh without layers that each is, or that each lies over.
    """

    mesh: TetMesh
    parents: IntArray


def add_layers(mesh: TetMesh, heights: FloatArray, least_depths: FloatArray) -> LayeredMesh:
    """Add layers along the boundary of a mesh.

    Parameters
    ----------
    mesh : TetMesh
    heights : (b,) ndarray
        Height of the first layer at each boundary node, unit; inf where none is wanted.
    least_depths : (b,) ndarray
        Depth that all layers together have to have, where the body is thick enough, unit.

    Returns
    -------
    LayeredMesh
        With the same boundary triangles. Interfaces between regions stay where they are.
    """
    share = np.ones(len(heights))
    for attempt in range(MOST_FILLINGS):
        columns = _columns(mesh, heights, least_depths, share)
        if columns is None:
            break
        layered = _fill(mesh, columns)
        flat = tetrahedron_volumes(layered.points, layered.tetrahedra) < LEAST_PART * layered.expected
        if not flat.any():
            return _made(mesh, layered)
        # Neighbouring columns cross where the surface is creased or strongly curved inwards.
        owner = np.full(len(layered.points), -1)
        owner[mesh.boundary_nodes] = np.arange(len(heights))
        owner[len(mesh.points) :] = columns.owner
        crossing = np.unique(owner[layered.tetrahedra[flat]])
        share[crossing[crossing >= 0]] *= 0.5 if attempt < MOST_FILLINGS // 2 else 0.0
    return LayeredMesh(mesh, np.arange(len(mesh.tetrahedra)))


@dataclass(frozen=True, eq=False)
class _Filled:
    """Points and tetrahedra of a mesh with layers, the parent of each, and about what volume each should have."""

    points: FloatArray
    tetrahedra: IntArray
    parents: IntArray
    expected: FloatArray


def _made(mesh: TetMesh, filled: _Filled) -> LayeredMesh:
    regions = mesh.regions[filled.parents] if mesh.regions.any() else np.zeros(len(filled.parents), dtype=np.int64)
    layered = replace(mesh, points=filled.points, tetrahedra=filled.tetrahedra, regions=regions)
    return LayeredMesh(layered, filled.parents)


@dataclass(frozen=True, eq=False)
class _Columns:
    """Columns of nodes under the boundary nodes of a mesh.

    Attributes
    ----------
    moved : (n, 3) ndarray
        The nodes of the mesh, pressed inwards: those of the boundary are the deepest of their columns.
    layers : (b,) ndarray of int
        Number of layers in each column.
    owner : (c,) ndarray of int
        The column of each of its other nodes.
    points : (c, 3) ndarray
        These, from the boundary inwards.
    """

    moved: FloatArray
    layers: IntArray
    owner: IntArray
    points: FloatArray

    def node(self, mesh: TetMesh, column: IntArray, level: IntArray) -> IntArray:
        """Numbers of the nodes at given levels of columns, 0 at the boundary."""
        first = len(mesh.points) + np.cumsum(self.layers) - self.layers
        return np.where(level == self.layers[column], mesh.boundary_nodes[column], first[column] + level)


def _columns(mesh: TetMesh, heights: FloatArray, least_depths: FloatArray, share: FloatArray) -> _Columns | None:
    """The columns that have room, a share (b,) of what they could have; None if there are none."""
    growing = _growing_layers(mesh, heights)
    depths = share * _wanted_depths(mesh, heights, growing, least_depths)
    with np.errstate(invalid="ignore"):
        depths[~(depths > LEAST_DEPTH * heights)] = 0.0
    if not depths.any():
        return None
    nodes, normals = mesh.boundary_nodes, vertex_normals(mesh.boundary_points, mesh.boundary_triangles)
    kept = np.zeros(len(mesh.points), dtype=bool)
    kept[mesh.interfaces[0]] = True
    depths[kept[nodes]] = 0.0
    steps = np.zeros(mesh.points.shape)
    steps[nodes] = -depths[:, None] * normals
    kept[nodes] = True
    steps = shorten(mesh, spread(mesh, steps, kept))
    depths = np.linalg.norm(steps[nodes], axis=1)
    some = depths > 0
    layers = np.zeros(len(nodes), dtype=np.int64)
    layers[some] = _number(depths[some] / heights[some], growing[some])
    column = np.repeat(np.arange(len(nodes)), layers)
    shares = _reached(_ranks(layers), growing[column]) / _reached(layers[column], growing[column])
    points = mesh.points[nodes[column]] + shares[:, None] * steps[nodes[column]]
    return _Columns(mesh.points + steps, layers, column, points)


def _ranks(counts: IntArray) -> IntArray:
    """0, 1, ... for each of several groups of given sizes."""
    return np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)


def _growing_layers(mesh: TetMesh, heights: FloatArray) -> FloatArray:
    """How many layers grow in each column (b,), until they are as high as the triangles are wide."""
    corners = mesh.boundary_triangles
    length = np.linalg.norm(mesh.boundary_points[corners] - mesh.boundary_points[corners[:, [1, 2, 0]]], axis=2)
    width = np.bincount(corners.ravel(), length.ravel()) / np.bincount(corners.ravel())
    return np.asarray(np.ceil(np.log(np.maximum(HIGHEST * width / heights, 1.0)) / np.log(GROWTH)))


def _reached(layers: FloatArray | IntArray, growing: FloatArray) -> FloatArray:
    """Depth of so many layers, the first of which grow, over the height of the first."""
    grown = np.minimum(layers, growing)
    highest = GROWTH ** np.maximum(growing - 1.0, 0.0)
    return np.asarray((GROWTH**grown - 1.0) / (GROWTH - 1.0) + highest * (layers - grown))


def _number(depths: FloatArray, growing: FloatArray) -> IntArray:
    """How many layers reach a depth, over the height of the first, about; at least one."""
    grown = np.minimum(np.log1p((GROWTH - 1.0) * depths) / np.log(GROWTH), growing)
    highest = GROWTH ** np.maximum(growing - 1.0, 0.0)
    rest = np.maximum(depths - _reached(grown, growing), 0.0) / highest
    return np.asarray(np.maximum(np.round(grown + rest), 1), dtype=np.int64)


def _wanted_depths(mesh: TetMesh, heights: FloatArray, growing: FloatArray, least_depths: FloatArray) -> FloatArray:
    """Depth of all layers together at each boundary node, (b,), unit; 0 where there are none."""
    depths = np.zeros(len(heights))
    wanted = np.isfinite(heights) & (growing > 0)
    if not wanted.any():
        return depths
    reached = _reached(growing[wanted], growing[wanted]) * heights[wanted]
    depths[wanted] = np.maximum(reached, least_depths[wanted])
    thin = np.full(len(heights), np.inf)
    np.minimum.at(thin, mesh.boundary_triangles, thickness(mesh)[:, None])
    depths = np.minimum(depths, LARGEST_SHARE * thin)
    corners = mesh.boundary_triangles
    edges = np.concatenate([corners[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    length = np.linalg.norm(np.diff(mesh.boundary_points[edges], axis=1)[:, 0], axis=1)
    return level_off(depths, edges, STEEPEST * length)


def _fill(mesh: TetMesh, columns: _Columns) -> _Filled:
    """Fill the columns under each boundary triangle.

    From the boundary inwards, one of the three nodes of the lowest triangle goes on to the next level of its column,
    which cuts off one tetrahedron. Triangles agree on the order in which two columns go on, by level, and within a
    level by number. That order is turned around at every second level: else all of a column's light would be
    deposited too low, and all of another's too high.
    """
    triangles = mesh.boundary_triangles
    counts = columns.layers[triangles]
    steps = []
    for corner in range(3):
        face = np.repeat(np.arange(len(triangles)), counts[:, corner])
        steps.append(np.column_stack([face, np.full(len(face), corner), _ranks(counts[:, corner]) + 1]))
    face, corner, level = np.concatenate(steps).T
    column = triangles[face, corner]
    turn = np.where(level % 2 == 1, 1, -1)
    order = np.lexsort((turn * _shuffled(len(columns.layers))[column], level, face))
    face, corner, level, column = face[order], corner[order], level[order], column[order]
    total = counts.sum(axis=1)
    start = np.repeat(np.cumsum(total) - total, total)
    lowest = []
    for place in range(3):
        made = np.concatenate([[0], np.cumsum(corner == place)])[:-1]
        lowest.append(columns.node(mesh, triangles[face, place], made - made[start]))
    # Boundary triangles are anticlockwise seen from outside, tetrahedra from within.
    corners = np.column_stack([lowest[0], lowest[2], lowest[1], columns.node(mesh, column, level)])
    points = np.concatenate([columns.moved, columns.points])
    rise = np.linalg.norm(points[corners[:, 3]] - points[columns.node(mesh, column, level - 1)], axis=1)
    return _Filled(
        points,
        np.concatenate([mesh.tetrahedra, corners]),
        np.concatenate([np.arange(len(mesh.tetrahedra)), mesh.boundary_cells[face]]),
        np.concatenate([mesh.volumes, mesh.boundary_areas[face] * rise / 3.0]),
    )


def _shuffled(count: int) -> IntArray:
    """The numbers 0 to count - 1 in an order that has nothing to do with where nodes are; always the same."""
    return np.random.default_rng(0).permutation(count)
