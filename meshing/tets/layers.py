"""Layers of flat tetrahedra along the boundary, where something varies with depth much faster than along the surface.

The mesh is pulled inward from its boundary, and the gap is filled with prisms, each of three tetrahedra. Their lateral
size stays that of the facets, and their heights are chosen freely.
"""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import cg

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.surface.triangles import triangle_areas
from tetlux.meshing.tets.geometry import tetrahedron_volumes
from tetlux.meshing.tets.mesh import TetMesh

# Layers together are at most this many times as deep as the mean length of the edges at a node.
REACH = 1.5
# Their depth changes along the surface by at most this much for each length.
STEEPEST = 0.5
# A pulled tetrahedron keeps at least this share of its volume: layers are made thinner at its corners until it does.
SMALLEST_SHARE = 0.25
# Layers are made thinner by this factor, so often; where that is not enough they are left out, again so often at most.
THINNER, ATTEMPTS = 0.6, 6
# Relative accuracy of the displacement of inner nodes: any that keeps volumes positive will do.
ACCURACY = 1e-2
# The three tetrahedra of a prism: of each corner its edge, and whether it is the upper (0) or the lower end of it.
_PARTS = [
    (np.array(edges), np.array(ends))
    for edges, ends in (((0, 2, 1, 2), (0, 0, 0, 1)), ((0, 1, 1, 2), (0, 0, 1, 1)), ((0, 1, 0, 2), (0, 1, 1, 1)))
]
# Odd orders of three corners, as numbers to the base 3.
_ODD_ORDERS = [int(np.dot(order, [9, 3, 1])) for order in ((0, 2, 1), (1, 0, 2), (2, 1, 0))]


def add_layers(mesh: TetMesh, depths: FloatArray, where: BoolArray) -> tuple[TetMesh, IntArray]:
    """Put layers of flat tetrahedra along the boundary of a mesh.

    Parameters
    ----------
    mesh : TetMesh
    depths : (k,) ndarray
        Depths of the layers' lower sides, ascending, unit.
    where : (n,) ndarray of bool
        The nodes of the boundary below which there are layers, as many as fit within `REACH`.

    Returns
    -------
    mesh : TetMesh
        Its boundary is that of the mesh given. Layers are thinner, or fewer, where the body is too thin for them.
    parents : (m,) ndarray
        The tetrahedron of the mesh given that each of its tetrahedra is pulled from, or stands on the facet of.
    """
    lit = np.zeros(len(mesh.points), dtype=bool)
    lit[mesh.boundary_nodes] = where[mesh.boundary_nodes]
    if mesh.regions.any():
        # An interface that reaches the boundary would be bent.
        lit[mesh.interfaces[0]] = False
    reach = np.where(lit, REACH * _edge_lengths_at_nodes(mesh), 0.0)
    normals, lowest = _node_normals(mesh), np.concatenate([[0.0], depths])
    pull = _Pull(mesh)
    for attempt in range(2 * ATTEMPTS):
        reach = _even_out(mesh, reach)
        numbers = np.searchsorted(depths, reach, side="right")
        lower = pull(-lowest[numbers][:, None] * normals)
        layers = _fill(mesh, lower, numbers, lowest, normals)
        squashed = tetrahedron_volumes(lower, mesh.tetrahedra) < SMALLEST_SHARE * mesh.volumes
        folded = np.unique(layers.facets[tetrahedron_volumes(layers.points, layers.tetrahedra) < layers.least])
        if not squashed.any() and len(folded) == 0:
            return _joined(mesh, layers)
        nodes = np.union1d(mesh.tetrahedra[squashed], mesh.boundary_faces[folded])
        if not reach[nodes].any():  # they are within the body, next to a region
            nodes = np.flatnonzero(reach)
        if attempt >= ATTEMPTS:  # a node without layers may be squashed by what is beside it
            nodes = np.unique(mesh.tetrahedra[np.isin(mesh.tetrahedra, nodes).any(axis=1)])
        reach[nodes] *= THINNER if attempt < ATTEMPTS else 0.0
    return mesh, np.arange(len(mesh.tetrahedra))


def are_layered(mesh: TetMesh, cells: IntArray) -> BoolArray:
    """Whether each of some tetrahedra (c,) is a part of a prism of a layer, (c,)."""
    if mesh.columns is None:
        return np.zeros(len(cells), dtype=bool)
    ends = mesh.columns[cells]
    return np.asarray((ends[:, :, 0] != ends[:, :, 1]).all(axis=1))


def tops_of(mesh: TetMesh) -> IntArray:
    """The node of the boundary above each node of layers, and other nodes themselves, (n,)."""
    above = np.arange(len(mesh.points))
    if mesh.columns is not None:
        upper, lower = mesh.columns.reshape(-1, 2).T
        above[lower[upper != lower]] = upper[upper != lower]
    while (above != (higher := above[above])).any():
        above = higher
    return above


class _Filled(NamedTuple):
    """The layers, and the nodes of the mesh below them.

    Attributes
    ----------
    points : (p, 3) ndarray
        Those of the mesh that is pulled inward, then those of the layers.
    tetrahedra : (t, 4) ndarray
        Of the layers.
    facets : (t,) ndarray
        The boundary triangle above each.
    least : (t,) ndarray
        The least volume of each, unit³: those of a fold are smaller.
    columns : (t, 4, 2) ndarray
        The nodes above and below each corner, see `TetMesh`.
    """

    points: FloatArray
    tetrahedra: IntArray
    facets: IntArray
    least: FloatArray
    columns: IntArray


def _fill(mesh: TetMesh, lower: FloatArray, numbers: IntArray, depths: FloatArray, normals: FloatArray) -> _Filled:
    """Fill the gap between the boundary and the pulled nodes (n, 3) with prisms."""
    points, nodes = [lower], np.tile(np.arange(len(lower)), (int(numbers.max()) + 1, 1))
    total = len(lower)
    for level in range(int(numbers.max())):
        # The lowest side of the layers at a node is the pulled node itself.
        own = np.flatnonzero(numbers > level)
        nodes[level, own] = total + np.arange(len(own))
        total += len(own)
        points.append(mesh.points[own] - depths[level] * normals[own])
    # Neighbouring prisms divide the side between them alike, as the corners are in the order of the nodes.
    order = np.argsort(mesh.boundary_faces, axis=1)
    corners = np.take_along_axis(mesh.boundary_faces, order, axis=1)
    is_odd = np.isin(order @ [9, 3, 1], _ODD_ORDERS)
    cells, facets, least = [np.zeros((0, 4), np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
    columns = [np.zeros((0, 4, 2), np.int64)]
    for level, (upper, below) in enumerate(pairwise(nodes)):
        ends = np.stack([upper[corners], below[corners]], axis=2)
        is_whole = (ends[:, :, 0] != ends[:, :, 1]).all(axis=1)
        share = SMALLEST_SHARE / 3.0 * (depths[level + 1] - depths[level]) * mesh.boundary_areas
        for column, end in _PARTS:
            own = ends[:, column]
            own[is_odd] = own[is_odd][:, [0, 2, 1, 3]]
            side = np.where(is_odd[:, None], end[[0, 2, 1, 3]], end)[:, :, None]
            tetrahedra = np.take_along_axis(own, side, axis=2)
            # A prism that has lost an edge has the nodes of its tetrahedra.
            own = np.where(is_whole[:, None, None], own, tetrahedra)
            solid = np.flatnonzero((np.diff(np.sort(tetrahedra[:, :, 0], axis=1), axis=1) > 0).all(axis=1))
            cells.append(tetrahedra[solid, :, 0])
            facets.append(solid)
            least.append(share[solid])
            columns.append(own[solid])
    every = np.concatenate(columns)
    return _Filled(np.vstack(points), np.vstack(cells), np.concatenate(facets), np.concatenate(least), every)


def _joined(mesh: TetMesh, layers: _Filled) -> tuple[TetMesh, IntArray]:
    """The pulled mesh with its layers, and its parents: see `add_layers`."""
    parents = np.concatenate([np.arange(len(mesh.tetrahedra)), mesh.boundary_cells[layers.facets]])
    tetrahedra = np.vstack([mesh.tetrahedra, layers.tetrahedra])
    columns = np.concatenate([np.repeat(mesh.tetrahedra[:, :, None], 2, axis=2), layers.columns])
    layered = TetMesh(layers.points, tetrahedra, mesh.unit, labels=mesh.labels, columns=columns, warnings=mesh.warnings)
    return (replace(layered, regions=mesh.regions[parents]) if mesh.regions.any() else layered), parents


def _even_out(mesh: TetMesh, reach: FloatArray) -> FloatArray:
    """Let the depth of layers (n,) grow along the surface by no more than `STEEPEST` times the way."""
    first, second = mesh.edges[np.unique(mesh.boundary_edges)].T
    most = STEEPEST * np.linalg.norm(mesh.points[first] - mesh.points[second], axis=1)
    while True:
        before = reach.copy()
        np.minimum.at(reach, first, before[second] + most)
        np.minimum.at(reach, second, before[first] + most)
        if (reach == before).all():
            return reach


def _edge_lengths_at_nodes(mesh: TetMesh) -> FloatArray:
    """Mean length of the edges at each node, (n,), unit."""
    ends, lengths = mesh.edges.reshape(-1), np.repeat(mesh.edge_lengths, 2)
    return np.asarray(np.bincount(ends, lengths) / np.bincount(ends))


def _node_normals(mesh: TetMesh) -> FloatArray:
    """Outward unit normals at nodes of the boundary, zero at others, (n, 3)."""
    vectors, areas = triangle_areas(mesh.points, mesh.boundary_faces)
    sums = np.zeros_like(mesh.points)
    for corner in mesh.boundary_faces.T:
        np.add.at(sums, corner, vectors * areas[:, None])
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.asarray(sums / np.where(lengths > 0, lengths, 1.0))


class _Pull:
    """Moves the nodes of a mesh as the boundary is moved: inner nodes follow by Laplace's equation.

    Nodes between regions stay.
    """

    def __init__(self, mesh: TetMesh) -> None:
        self._mesh = mesh
        self._free = self._find_free()
        gradients, corners = mesh.hat_gradients, mesh.tetrahedra
        stiffness = np.einsum("mik,mjk,m->mij", gradients, gradients, mesh.volumes)
        places = np.repeat(corners, 4, axis=1).reshape(-1), np.tile(corners, 4).reshape(-1)
        matrix = coo_array((stiffness.reshape(-1), places), shape=(len(mesh.points),) * 2).tocsr()
        self._rows = matrix[self._free]
        self._inner = self._rows[:, self._free]
        self._scaled = diags_array(1.0 / self._inner.diagonal())

    def _find_free(self) -> BoolArray:
        free = np.ones(len(self._mesh.points), dtype=bool)
        free[self._mesh.boundary_nodes] = False
        if self._mesh.regions.any():
            free[np.unique(self._mesh.interfaces[0])] = False
        return free

    def __call__(self, shifts: FloatArray) -> FloatArray:
        """The nodes (n, 3), with those of the boundary moved by the shifts (n, 3)."""
        moved = self._mesh.points + shifts
        for axis, load in enumerate((-(self._rows @ shifts)).T):
            if load.any():
                moved[self._free, axis] += cg(self._inner, load, rtol=ACCURACY, M=self._scaled)[0]
        return moved
