"""`TetMesh`: the tetrahedra that fill a body."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.proximity import ClosestPoint
from tetlux.meshing.surface import Surface, triangle_areas

# Faces of a positively oriented tetrahedron, each anticlockwise seen from outside.
_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])


@dataclass(frozen=True, eq=False)
class TetMesh:
    """A conforming mesh of positively oriented tetrahedra.

    Parameters
    ----------
    points : (n, 3) ndarray
        Nodes, in `unit`.
    tetrahedra : (m, 4) ndarray
        Corners; the first three are anticlockwise seen from the fourth's far side, so volumes are positive.
    unit : str

    Raises
    ------
    InputError
        If shapes or indices are wrong, a coordinate is not finite, or a tetrahedron is inverted or flat.
    """

    points: FloatArray
    tetrahedra: IntArray
    unit: str = "mm"

    def __post_init__(self) -> None:
        p, t = self.points, self.tetrahedra
        if p.ndim != 2 or p.shape[1] != 3 or t.ndim != 2 or t.shape[1] != 4 or len(t) == 0:
            raise InputError(f"a mesh needs (n, 3) points and (m, 4) tetrahedra, not {p.shape} and {t.shape}.")
        if t.min() < 0 or t.max() >= len(p):
            raise InputError("a tetrahedron names a node that does not exist.")
        if not np.isfinite(p).all():
            raise InputError("a node's coordinate is not finite.")
        bad = int((self.volumes <= 0).sum())
        if bad:
            raise InputError(f"{bad} of {len(t)} tetrahedra are inverted or flat; orient and clean the mesh.")

    @cached_property
    def volumes(self) -> FloatArray:
        """Volume of each tetrahedron, (m,), unit³."""
        return tetrahedron_volumes(self.points, self.tetrahedra)

    @cached_property
    def volume(self) -> float:
        """Volume of the body, unit³."""
        return float(self.volumes.sum())

    @cached_property
    def _boundary(self) -> tuple[IntArray, IntArray]:
        """Faces that belong to one tetrahedron only, (f, 3), and that tetrahedron, (f,)."""
        faces = self.tetrahedra[:, _FACES].reshape(-1, 3)
        key = np.sort(faces, axis=1)
        count = len(self.points)
        # One integer a face sorts several times faster than three.
        flat = (key[:, 0] * count + key[:, 1]).astype(np.int64)
        order = np.lexsort((key[:, 2], flat))
        same = (flat[order][1:] == flat[order][:-1]) & (key[order][1:, 2] == key[order][:-1, 2])
        single = np.ones(len(faces), dtype=bool)
        single[order[1:][same]] = False
        single[order[:-1][same]] = False
        return faces[single], np.flatnonzero(single) // 4

    @property
    def boundary_faces(self) -> IntArray:
        """Boundary triangles (f, 3), outward oriented, as node numbers."""
        return self._boundary[0]

    @property
    def boundary_cells(self) -> IntArray:
        """The tetrahedron behind each boundary triangle, (f,)."""
        return self._boundary[1]

    @cached_property
    def boundary_nodes(self) -> IntArray:
        """Node numbers on the boundary, (b,), ascending."""
        return np.unique(self.boundary_faces)

    @cached_property
    def boundary_triangles(self) -> IntArray:
        """`boundary_faces` numbered within `boundary_nodes`, (f, 3)."""
        return np.searchsorted(self.boundary_nodes, self.boundary_faces)

    @cached_property
    def boundary_points(self) -> FloatArray:
        """Coordinates of the boundary nodes, (b, 3)."""
        return self.points[self.boundary_nodes]

    @cached_property
    def surface(self) -> Surface:
        """The boundary as a surface of its own."""
        return Surface(self.boundary_points, self.boundary_triangles, self.unit, "mesh")

    @cached_property
    def boundary_areas(self) -> FloatArray:
        """Area of each boundary triangle, (f,), unit²."""
        return triangle_areas(self.points, self.boundary_faces)[1]

    @cached_property
    def boundary_node_areas(self) -> FloatArray:
        """A third of the area of the triangles around each boundary node, (b,): weights that sum to `area`."""
        weights = np.repeat(self.boundary_areas / 3.0, 3)
        sums = np.bincount(self.boundary_triangles.ravel(), weights, minlength=len(self.boundary_nodes))
        return np.asarray(sums, dtype=np.float64)

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
        corners = self.points[self.tetrahedra]
        lengths = [np.linalg.norm(corners[:, i] - corners[:, j], axis=1) for i, j in _EDGES]
        return np.asarray(np.maximum.reduce(lengths))

    @cached_property
    def quality(self) -> FloatArray:
        """Shape of each tetrahedron, (m,): three inradii over the circumradius, 1 regular, 0 flat."""
        corners = self.points[self.tetrahedra]
        u, v, w = (corners[:, i] - corners[:, 0] for i in (1, 2, 3))
        uu, vv, ww = (np.einsum("ij,ij->i", x, x)[:, None] for x in (u, v, w))
        moment = uu * np.cross(v, w) + vv * np.cross(w, u) + ww * np.cross(u, v)
        circumradius = np.linalg.norm(moment, axis=1) / (12.0 * self.volumes)
        area = sum(triangle_areas(self.points, self.tetrahedra[:, f])[1] for f in _FACES)
        return np.asarray(9.0 * self.volumes / area / circumradius)

    @cached_property
    def _closest(self) -> ClosestPoint:
        return ClosestPoint(self.points, self.boundary_faces)

    def closest_boundary(self, queries: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        """Nearest boundary points of queries (q, 3): points (q, 3), faces (q,), barycentric weights (q, 3)."""
        nearest, face = self._closest(queries)
        a, b, c = (self.points[self.boundary_faces[face, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        scale = np.einsum("ij,ij->i", normal, normal)
        wb = np.einsum("ij,ij->i", np.cross(nearest - a, c - a), normal) / scale
        wc = np.einsum("ij,ij->i", np.cross(b - a, nearest - a), normal) / scale
        return nearest, face, np.column_stack([1.0 - wb - wc, wb, wc])

    @cached_property
    def _centroids(self) -> cKDTree:
        return cKDTree(self.points[self.tetrahedra].mean(axis=1))

    def barycentric(self, queries: FloatArray, cells: IntArray) -> FloatArray:
        """Barycentric coordinates of query i in tetrahedron ``cells[i]``, (q, 4)."""
        corners = self.points[self.tetrahedra[cells]]
        matrix = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
        rest = np.linalg.solve(matrix, (queries - corners[:, 0])[..., None])[..., 0]
        return np.column_stack([1.0 - rest.sum(axis=1), rest])

    def locate(self, queries: FloatArray) -> tuple[IntArray, FloatArray]:
        """The tetrahedron that holds each point.

        Parameters
        ----------
        queries : (q, 3) ndarray

        Returns
        -------
        cells : (q,) ndarray
            -1 for points outside.
        weights : (q, 4) ndarray
            Barycentric coordinates; nan for points outside.
        """
        queries = np.asarray(queries, dtype=float).reshape(-1, 3)
        cells = np.full(len(queries), -1, dtype=np.int64)
        weights = np.full((len(queries), 4), np.nan)
        left = np.arange(len(queries))
        tried = 0
        # Far from the origin coordinates carry fewer digits of a tetrahedron.
        size = float(self.volumes.min()) ** (1 / 3)
        slack = 1e-10 + 16.0 * np.finfo(float).eps * float(np.abs(self.points).max()) / size
        for wanted in (8, 64, 512, len(self.tetrahedra)):
            count = min(wanted, len(self.tetrahedra))
            if len(left) == 0 or count == tried:
                break
            found = self._centroids.query(queries[left], k=list(range(tried + 1, count + 1)))
            distance, near = np.asarray(found[0]), np.asarray(found[1], dtype=np.int64)
            for column in near.T:
                inner = self.barycentric(queries[left], column)
                hit = (inner.min(axis=1) >= -slack) & (cells[left] < 0)
                cells[left[hit]] = column[hit]
                weights[left[hit]] = inner[hit]
            # No tetrahedron reaches farther from its centroid than three quarters of its longest edge.
            reach = 0.75 * float(self.longest_edges.max())
            left = left[(cells[left] < 0) & (distance[:, -1] <= reach)]
            tried = count
        return cells, weights


def tetrahedron_volumes(points: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """Signed volumes (m,) of tetrahedra (m, 4)."""
    a, b, c, d = (points[tetrahedra[:, i]] for i in range(4))
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0)
