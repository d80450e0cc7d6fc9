"""`QuadraticSpace`: the quadratic finite-element space of a mesh, with edges bent onto the true surfaces."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import count

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.quadratic.elements import TRIANGLE_EDGES, cell_rule, shape_derivatives, shape_functions
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import triangle_areas
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.regions import corner_groups, owners

# Largest bend of an edge, as a share of its length; a longer displacement means that the edge is no chord of the
# surface.
LARGEST_BEND = 0.2
# Bends below this share of the body's diagonal are rounding errors.
SMALLEST_BEND = 1e-9
# Edges of a tetrahedron are bent less if bending leaves less than this share of its volume anywhere. With two facets on
# one smooth surface, which then are tangent where they meet, nothing is left there: one in a hundred of the mesher's
# tetrahedra on long cylinders. Errors of the worst readings of five such meshes in % with straight edges, with these
# constants, and without these tetrahedra: 1.28, .58, .31; .18, .18, .18; .11, .04, .01; .24, .10, .16; .14, .00, .01.
LEAST_VOLUME_SHARE = 0.15
# Factor by which bends are reduced, again and again, and how often at most before edges stay straight.
BEND_REDUCTION, MOST_REDUCTIONS = 0.85, 14
# Steps of Newton's method for the barycentric coordinates of a point in a curved triangle or tetrahedron.
NEWTON_STEPS = 3


@dataclass(frozen=True, eq=False)
class QuadraticSpace:
    """The basis functions of a mesh: hats of its n nodes, then bubbles of its e edges.

    Attributes
    ----------
    mesh : TetMesh
    bends : (e, 3) ndarray
        Displacement of the middle of each edge from the straight edge, unit.
    """

    mesh: TetMesh
    bends: FloatArray

    @property
    def size(self) -> int:
        """Number of basis functions."""
        return len(self.mesh.points) + len(self.bends)

    @cached_property
    def cells(self) -> IntArray:
        """DOF numbers of each tetrahedron, (m, 10)."""
        edges = self.mesh.tetrahedron_edges.astype(np.int64) + len(self.mesh.points)
        return np.hstack([self.mesh.tetrahedra, edges])

    @cached_property
    def boundary_faces(self) -> IntArray:
        """DOF numbers of the mesh's boundary triangles, (f, 6)."""
        return self.faces(self.mesh.boundary_faces)

    @cached_property
    def curved(self) -> IntArray:
        """The tetrahedra that have bent edges."""
        return np.flatnonzero(self.bent[self.mesh.tetrahedron_edges].any(axis=1))

    @cached_property
    def places_of_curved(self) -> IntArray:
        """The place of each tetrahedron in `curved`, (m,); -1 of straight ones."""
        places = np.full(len(self.mesh.tetrahedra), -1)
        places[self.curved] = np.arange(len(self.curved))
        return places

    @cached_property
    def bent(self) -> BoolArray:
        """Whether each edge is bent, (e,)."""
        return np.asarray(self.bends.any(axis=1))

    @cached_property
    def middles(self) -> FloatArray:
        """The middles of the edges, (e, 3)."""
        return np.asarray(self.mesh.points[self.mesh.edges].mean(axis=1) + self.bends)

    def faces(self, corners: IntArray) -> IntArray:
        """DOF numbers of triangles given by nodes (f, 3), (f, 6)."""
        nodes = len(self.mesh.points)
        pairs = np.sort(corners[:, TRIANGLE_EDGES], axis=2)
        return np.hstack([corners, nodes + np.searchsorted(self._edge_keys, pairs[..., 0] * nodes + pairs[..., 1])])

    @cached_property
    def _edge_keys(self) -> IntArray:
        """Numbers by which edges are found, ascending, (e,)."""
        low, high = self.mesh.edges.T
        return np.asarray(low.astype(np.int64) * len(self.mesh.points) + high)

    def corners_and_bends(self, dofs: IntArray) -> FloatArray:
        """Coordinates of nodes and bends of edges by DOF numbers (...), (..., 3)."""
        return np.asarray(np.concatenate([self.mesh.points, self.bends])[dofs])

    def interpolate(self, at_nodes: NumberArray, at_middles: NumberArray) -> NumberArray:
        """The function with given values at nodes (n,) and at middles of edges (e,), (n + e,)."""
        return np.concatenate([at_nodes, at_middles - at_nodes[self.mesh.edges].mean(axis=1)])

    def on_boundary(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """The boundary triangles nearest to points (q, 3), (q,), and barycentric coordinates there, (q, 3)."""
        _, face, weights = self.mesh.closest_boundary(points)
        shapes = self.corners_and_bends(self.faces(self.mesh.boundary_faces[face]))
        for _ in range(NEWTON_STEPS if self.bent.any() else 0):
            off = points - np.einsum("qa,qai->qi", shape_functions(weights, TRIANGLE_EDGES), shapes)
            slopes = np.einsum("qap,qai->qpi", shape_derivatives(weights, TRIANGLE_EDGES), shapes)
            tangents = slopes[:, 1:] - slopes[:, :1]
            gram = tangents @ tangents.transpose(0, 2, 1)
            step = np.linalg.solve(gram, np.einsum("qpi,qi->qp", tangents, off)[..., None])[..., 0]
            weights = weights + np.column_stack([-step.sum(axis=1), step])
        return face, weights

    def within(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """The tetrahedra that hold or adjoin points (q, 3) of the body, (q,), and barycentric coordinates, (q, 4)."""
        mesh = self.mesh
        cells, weights = mesh.locate(points)
        lost = np.flatnonzero(cells < 0)
        if len(lost):
            cells[lost] = mesh.boundary_cells[mesh.closest_boundary(points[lost])[1]]
            weights[lost] = mesh.barycentric(points[lost], cells[lost])
        bends = self.bends[mesh.tetrahedron_edges[cells]]
        for _ in range(NEWTON_STEPS if bends.any() else 0):
            displacements = np.einsum("qe,qei->qi", shape_functions(weights)[:, 4:], bends)
            weights = mesh.barycentric(points - displacements, cells)
        return cells, weights

    def jacobians(self, cells: IntArray, weights: FloatArray) -> FloatArray:
        """Jacobians of the maps that bend tetrahedra (c,), (c, q, 3, 3), at barycentric (q, 4) or (c, q, 4)."""
        mesh = self.mesh
        slopes = shape_derivatives(weights)[..., 4:, :] @ mesh.hat_gradients[cells][:, None]
        return np.eye(3) + self.bends[mesh.tetrahedron_edges[cells]].transpose(0, 2, 1)[:, None] @ slopes

    @cached_property
    def inverse_jacobians(self) -> FloatArray:
        """Inverses of `jacobians` at the corners of curved tetrahedra, (c, 4, 3, 3)."""
        return np.asarray(np.linalg.inv(self.jacobians(self.curved, np.eye(4))))

    @cached_property
    def curved_determinants(self) -> FloatArray:
        """Determinants of `jacobians` at the quadrature points of curved tetrahedra, (c, q)."""
        return np.asarray(np.linalg.det(self.jacobians(self.curved, cell_rule().points)))

    @cached_property
    def nodal_averaging(self) -> tuple[IntArray, csr_array]:
        """`corner_groups`, (m, 4), and the matrix of averages over each group, weighted by volume."""
        groups = corner_groups(self.mesh)
        volumes = np.repeat(self.mesh.volumes, 4)
        shares = volumes / np.bincount(groups.ravel(), volumes)[groups.ravel()]
        shape = (int(groups.max()) + 1, groups.size)
        return groups, csr_array((shares, (groups.ravel(), np.arange(groups.size))), shape=shape)

    __repr__ = one_line


def quadratic_space(mesh: TetMesh, surface: Surface, inner: Sequence[Surface] = ()) -> QuadraticSpace:
    """The space of a mesh with edges bent onto given surfaces; made once for a mesh."""
    return mesh.cache.get((QuadraticSpace, surface, tuple(inner)), lambda: _space(mesh, surface, inner))


def _space(mesh: TetMesh, surface: Surface, inner: Sequence[Surface]) -> QuadraticSpace:
    bends = np.zeros((len(mesh.edges), 3))
    if inner:
        faces, pairs, _ = mesh.interfaces
        owner = owners(pairs, inner)
        unbent = QuadraticSpace(mesh, bends)
        for number, each in enumerate(inner, 1):
            some = faces[owner == number]
            _bend(mesh, bends, some, unbent.faces(some)[:, 3:] - len(mesh.points), each)
    if surface is not mesh.surface:
        _bend(mesh, bends, mesh.boundary_faces, mesh.boundary_edges.astype(np.int64), surface)
    for reductions in count():
        space = QuadraticSpace(mesh, bends)
        inverted = _inverted_cells(space)
        if len(inverted) == 0:
            break
        bends = bends.copy()
        bends[np.unique(mesh.tetrahedron_edges[inverted])] *= BEND_REDUCTION if reductions < MOST_REDUCTIONS else 0.0
    return space


def _bend(mesh: TetMesh, bends: FloatArray, faces: IntArray, edges_of_faces: IntArray, surface: Surface) -> None:
    """Bend edges (f, 3) of triangles (f, 3) onto a surface, and those along its creases onto these, in place."""
    edges, places = np.unique(edges_of_faces, return_inverse=True)
    straight = mesh.points[mesh.edges[edges]].mean(axis=1)
    displacements = surface.project(straight)[0] - straight
    if surface.crease_angle > 0 and surface.creases is not None:
        normals, _ = triangle_areas(mesh.points, faces)
        # The sum of the normals of both triangles at an edge.
        sums = np.zeros((len(edges), 3))
        np.add.at(sums, places.reshape(-1, 3), normals[:, None])
        sharp = np.linalg.norm(sums, axis=1) < 2.0 * np.cos(0.5 * np.radians(surface.crease_angle))
        displacements[sharp] = surface.creases.closest(straight[sharp]) - straight[sharp]
    length = np.linalg.norm(displacements, axis=1)
    displacements[(length > LARGEST_BEND * mesh.edge_lengths[edges]) | (length < SMALLEST_BEND * mesh.diagonal)] = 0.0
    bends[edges] = displacements


def _inverted_cells(space: QuadraticSpace) -> IntArray:
    """The tetrahedra that bending inverts or compresses below `LEAST_VOLUME_SHARE`."""
    corners = np.vstack([np.eye(4), cell_rule().points])
    cells = space.curved
    shares = np.linalg.det(space.jacobians(cells, corners)) if len(cells) else np.ones((0, 1))
    return np.asarray(cells[shares.min(axis=1, initial=1.0) < LEAST_VOLUME_SHARE])
