"""`TetMesh`: the tetrahedra that fill a body."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tetlux.meshing.arrays import FloatArray, IndexArray, IntArray, sum_by_index
from tetlux.meshing.describe import count, label_text, size
from tetlux.meshing.errors import InputError
from tetlux.meshing.html import mesh_html
from tetlux.meshing.search.cell_tree import CellTree
from tetlux.meshing.search.rays import RayCaster
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.surface.triangles import longest_sides, triangle_areas
from tetlux.meshing.tets import geometry, topology
from tetlux.meshing.tets.cache import MeshCache
from tetlux.meshing.tets.queries import BoundaryQueries

_NO_REGIONS = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class TetMesh:
    """A conforming mesh of positively oriented tetrahedra.

    Parameters
    ----------
    points : (n, 3) ndarray
        Nodes, in `unit`.
    tetrahedra : (m, 4) ndarray
        Corners; the first three are anticlockwise seen from the fourth, so that volumes are positive.
    unit : str
        Unit of length; coefficients are in 1/unit.
    regions : (m,) ndarray of int, optional
        The region or label of each tetrahedron; all 0 if not given. In a mesh made from surfaces, 0 is the body itself
        and regions are numbered from 1; the labels of other meshes are kept.
    labels : mapping of int to str, optional
        Names of labels; not every label needs one.
    repairs, warnings : tuple of str
        Sentences: what was repaired when the mesh was read, and what the user should know about it.
    columns : (m, 4, 2) ndarray of int, optional
        The upper and the lower end of the edge of a prism on which each corner lies, where tetrahedra are parts of
        prisms (`tetlux.meshing.tets.layers`); elsewhere twice the corner itself.

    Raises
    ------
    InputError
        If shapes or indices are wrong, a coordinate is not finite, or a tetrahedron is inverted or flat.

    Examples
    --------
    >>> import numpy as np
    >>> points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    >>> mesh = TetMesh(points, np.array([[0, 1, 2, 3]]))
    >>> len(mesh.edges), len(mesh.boundary_faces), round(mesh.volume, 6)
    (6, 4, 0.166667)
    >>> mesh.locate([[0.25, 0.25, 0.25], [1.0, 1.0, 1.0]])[0].tolist()
    [0, -1]
    """

    points: FloatArray
    tetrahedra: IntArray
    unit: str = "mm"
    regions: IntArray = field(default_factory=lambda: _NO_REGIONS)
    labels: Mapping[int, str] = field(default_factory=dict)
    repairs: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    columns: IntArray | None = None

    def __post_init__(self) -> None:
        topology.check_arrays(self.points, self.tetrahedra)
        total = len(self.tetrahedra)
        if self.regions is _NO_REGIONS:
            # A broadcast zero takes no memory.
            object.__setattr__(self, "regions", np.broadcast_to(np.int64(0), total))
        elif self.regions.shape != (total,) or self.regions.dtype.kind not in "iu":
            raise InputError(f"a mesh of {total} tetrahedra needs as many numbers of regions, all integers.")
        if bad := int((self.volumes <= 0).sum()):
            raise InputError(f"{bad} of {total} tetrahedra are inverted or flat; orient and clean the mesh.")

    @cached_property
    def volumes(self) -> FloatArray:
        """Volume of each tetrahedron, (m,), unit³."""
        return geometry.tetrahedron_volumes(self.points, self.tetrahedra)

    @cached_property
    def volume(self) -> float:
        """Volume of the body, unit³."""
        return float(self.volumes.sum())

    @cached_property
    def _edges(self) -> tuple[IntArray, IndexArray]:
        return topology.number_edges(self.tetrahedra, len(self.points))

    @property
    def edges(self) -> IntArray:
        """Edges as node numbers (e, 2), the smaller first, in ascending order."""
        return self._edges[0]

    @cached_property
    def edge_lengths(self) -> FloatArray:
        """Length of each edge, (e,), unit."""
        first, second = self.points[self.edges.T]
        return np.asarray(np.linalg.norm(second - first, axis=1))

    @property
    def tetrahedron_edges(self) -> IndexArray:
        """The edges of each tetrahedron, (m, 6), between the corners 01, 02, 03, 12, 13 and 23."""
        return self._edges[1]

    @cached_property
    def neighbours(self) -> IndexArray:
        """The tetrahedron behind the face opposite each corner, (m, 4); -1 at the boundary."""
        return topology.find_neighbours(self.tetrahedra, len(self.points))

    @cached_property
    def _boundary(self) -> tuple[IntArray, IntArray]:
        return topology.find_boundary(self.tetrahedra, len(self.points))

    @property
    def boundary_faces(self) -> IntArray:
        """Boundary triangles (f, 3), outward oriented, as node numbers."""
        return self._boundary[1]

    @property
    def boundary_cells(self) -> IntArray:
        """The tetrahedron behind each boundary triangle, (f,)."""
        return self._boundary[0] // 4

    @property
    def boundary_edges(self) -> IndexArray:
        """The three edges of each boundary triangle, (f, 3)."""
        return np.asarray(
            self.tetrahedron_edges[self.boundary_cells[:, None], topology.EDGES_OF_FACES[self._boundary[0] % 4]]
        )

    @cached_property
    def interfaces(self) -> tuple[IntArray, IntArray, IntArray]:
        """Triangles between tetrahedra of different regions.

        Returns
        -------
        faces : (f, 3) ndarray
            Node numbers, anticlockwise seen from the second region.
        regions : (f, 2) ndarray
            The regions on either side, the smaller number first.
        cells : (f, 2) ndarray
            The tetrahedra on either side.
        """
        return topology.find_interfaces(self.tetrahedra, self.regions, len(self.points))

    @cached_property
    def boundary_nodes(self) -> IntArray:
        """Node numbers on the boundary, (b,), ascending."""
        return np.unique(self.boundary_faces)

    @cached_property
    def boundary_triangles(self) -> IntArray:
        """`boundary_faces` as indices into `boundary_nodes`, (f, 3)."""
        return np.searchsorted(self.boundary_nodes, self.boundary_faces)

    @cached_property
    def boundary_points(self) -> FloatArray:
        """Coordinates of the boundary nodes, (b, 3)."""
        return self.points[self.boundary_nodes]

    @cached_property
    def surface(self) -> Surface:
        """The boundary as a surface with flat facets."""
        return Surface(self.boundary_points, self.boundary_triangles, self.unit, "mesh", crease_angle=0.0)

    @cached_property
    def boundary_areas(self) -> FloatArray:
        """Area of each boundary triangle, (f,), unit²."""
        return triangle_areas(self.points, self.boundary_faces)[1]

    @cached_property
    def boundary_sides(self) -> FloatArray:
        """Longest side of each boundary triangle, (f,), unit."""
        return longest_sides(self.points[self.boundary_faces])

    @cached_property
    def boundary_node_areas(self) -> FloatArray:
        """A third of the area of the triangles at each boundary node, (b,), unit²: weights that sum to `area`."""
        return self.to_boundary_nodes(self.boundary_areas)

    def to_boundary_nodes(self, shares: FloatArray) -> FloatArray:
        """Distribute integrals over boundary triangles (f,) to boundary nodes (b,), a third to each corner."""
        return sum_by_index(self.boundary_triangles, np.repeat(shares / 3.0, 3), len(self.boundary_nodes))

    @cached_property
    def node_volumes(self) -> FloatArray:
        """A quarter of the volume of the tetrahedra at each node, (n,), unit³: weights that sum to `volume`."""
        return self.to_nodes(self.volumes)

    def to_nodes(self, shares: FloatArray) -> FloatArray:
        """Distribute integrals over tetrahedra (m,) to nodes (n,), a quarter to each corner or its edge of a prism."""
        nodes = self.tetrahedra if self.columns is None else self.columns.reshape(-1, 8)
        return geometry.distribute(shares, nodes, len(self.points))

    @cached_property
    def hat_gradients(self) -> FloatArray:
        """Gradients of the barycentric coordinates in each tetrahedron, (m, 4, 3), 1/unit."""
        return geometry.hat_gradients(self.points, self.tetrahedra, self.volumes)

    @cached_property
    def area(self) -> float:
        """Area of the boundary, unit²."""
        return float(self.boundary_areas.sum())

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the bounding box, unit."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @cached_property
    def longest_edges(self) -> FloatArray:
        """Longest edge of each tetrahedron, (m,), unit."""
        return geometry.longest_edges(self.points, self.tetrahedra)

    @cached_property
    def quality(self) -> FloatArray:
        """Shape of each tetrahedron, (m,): three inradii over the circumradius, from 0 (flat) to 1 (regular)."""
        return geometry.quality(self.points, self.tetrahedra)

    @cached_property
    def _boundary_queries(self) -> BoundaryQueries:
        return BoundaryQueries(self.points, self.boundary_faces)

    def closest_boundary(self, queries: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        """Closest boundary points to queries (q, 3): points (q, 3), their faces (q,), barycentric weights (q, 3)."""
        return self._boundary_queries.closest(queries)

    def boundary_distances(self, surface: Surface, faces: IntArray) -> FloatArray:
        """Distance of the centroids of boundary triangles (q,) from a surface, (q,), unit; each is computed once."""
        return self._boundary_queries.distances(surface, faces)

    @cached_property
    def rays(self) -> RayCaster:
        """A ray caster for the boundary; faces are numbered as in `boundary_faces`."""
        return RayCaster(self.points, self.boundary_faces)

    @cached_property
    def tree(self) -> CellTree:
        """A tree of boxes that finds the tetrahedra that contain points or that paths pass."""
        return CellTree(self.points, self.tetrahedra)

    @cached_property
    def cache(self) -> MeshCache:
        """Results that are computed once for this mesh, and paths traced through it."""
        return MeshCache()

    def barycentric(self, queries: FloatArray, cells: IntArray) -> FloatArray:
        """Barycentric coordinates of query i in tetrahedron ``cells[i]``, (q, 4)."""
        return geometry.barycentric_coordinates(self.points[self.tetrahedra[cells]], queries)

    def locate(self, queries: FloatArray) -> tuple[IntArray, FloatArray]:
        """The tetrahedron that contains each of some points (q, 3).

        Returns
        -------
        cells : (q,) ndarray
            -1 for points outside.
        weights : (q, 4) ndarray
            Barycentric coordinates; nan for points outside.
        """
        return self.tree.locate(np.asarray(queries, dtype=float).reshape(-1, 3))

    def region_at(self, queries: FloatArray) -> IntArray:
        """The region of the tetrahedron that contains each point (q, 3), or of the nearest one, (q,)."""
        cells, _ = self.locate(queries)
        if len(outside := np.flatnonzero(cells < 0)):
            cells[outside] = self.boundary_cells[self.closest_boundary(queries[outside])[1]]
        return np.asarray(self.regions[cells])

    def label_text(self, labels: Iterable[int]) -> str:
        """Labels as text, with their names: ``1 (scalp) and 2 (skull)``."""
        return label_text(labels, self.labels)

    @cached_property
    def region_volumes(self) -> dict[int, float]:
        """Volume of each region, unit³, by its number in ascending order."""
        if self.regions.strides == (0,):
            return {int(self.regions[0]): self.volume}
        numbers, index = np.unique(self.regions, return_inverse=True)
        return dict(zip(numbers.tolist(), np.bincount(index, self.volumes).tolist(), strict=True))

    def __repr__(self) -> str:
        regions = len(np.unique(self.regions))
        parts = "" if regions == 1 else f"{count(regions, 'region')}, "
        return (
            f"TetMesh({count(len(self.points), 'node')}, {count(len(self.tetrahedra), 'tetrahedron', 'tetrahedra')}, "
            f"{parts}{size(self.points, self.unit)}, volume {self.volume:.3g} {self.unit}³)"
        )

    _repr_html_ = mesh_html
