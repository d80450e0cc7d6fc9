"""`TetMesh`: the tetrahedra that fill a body."""

from collections.abc import Callable, Hashable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray, IndexArray, IntArray
from tetlux.meshing.describe import count, size
from tetlux.meshing.errors import InputError
from tetlux.meshing.host.blocks import grouped, in_blocks, once
from tetlux.meshing.host.corners import cross, dot, over_corners
from tetlux.meshing.search.cell_tree import CellTree
from tetlux.meshing.search.proximity import ClosestPoint
from tetlux.meshing.search.rays import RayCaster
from tetlux.meshing.surface.surface import Surface, barycentric_of, triangle_areas
from tetlux.meshing.tets.path_cache import Kept

# Faces of a positively oriented tetrahedron, each anticlockwise seen from outside.
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
# The edges of the face opposite each corner.
EDGES_OF_FACES = np.array([[3, 4, 5], [1, 2, 5], [0, 2, 4], [0, 1, 3]])
# Corners of a tetrahedron's edges, in the order of `TetMesh.tetrahedron_edges`.
EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])

_NO_REGIONS = np.zeros(0, dtype=np.int64)
# What is remembered of one mesh for others.
MOST_REMEMBERED = 32
# Labels that a sentence names; of more it says how many there are.
MOST_NAMED = 8
_T = TypeVar("_T")


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
    regions : (m,) ndarray of int, optional
        The region, or the label, of each tetrahedron; all 0 if not given. Of a mesh that was made of surfaces 0 is the
        body itself, and its regions are numbered from 1; of a mesh made elsewhere labels are whatever they are.
    labels : mapping of int to str, optional
        Names of labels, as far as they have any.
    repairs, warnings : tuple of str
        What was mended when it was read, and what was left that a user should know.

    Raises
    ------
    InputError
        If shapes or indices are wrong, a coordinate is not finite, or a tetrahedron is inverted or flat.
    """

    points: FloatArray
    tetrahedra: IntArray
    unit: str = "mm"
    regions: IntArray = field(default_factory=lambda: _NO_REGIONS)
    labels: Mapping[int, str] = field(default_factory=dict)
    repairs: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        p, t = self.points, self.tetrahedra
        if p.ndim != 2 or p.shape[1] != 3 or t.ndim != 2 or t.shape[1] != 4 or len(t) == 0:
            raise InputError(f"a mesh needs (n, 3) points and (m, 4) tetrahedra, not {p.shape} and {t.shape}.")
        if t.min() < 0 or t.max() >= len(p):
            raise InputError("a tetrahedron names a node that does not exist.")
        if not np.isfinite(p).all():
            raise InputError("a node's coordinate is not finite.")
        if self.regions is _NO_REGIONS:
            # Zeros that take no memory.
            object.__setattr__(self, "regions", np.broadcast_to(np.int64(0), len(t)))
        elif self.regions.shape != (len(t),) or self.regions.dtype.kind not in "iu":
            raise InputError(f"a mesh of {len(t)} tetrahedra needs as many numbers of regions, all integers.")
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
    def _edges(self) -> tuple[IntArray, IndexArray]:
        nodes, keys = len(self.points), np.empty((6, len(self.tetrahedra)), dtype=np.uint64)

        def fill(block: slice) -> None:
            corners = np.ascontiguousarray(self.tetrahedra[block].T)
            for edge, (i, j) in enumerate(EDGES):
                low, high = np.minimum(corners[i], corners[j]), np.maximum(corners[i], corners[j])
                keys[edge, block] = low * nodes + high

        in_blocks(fill, len(self.tetrahedra))
        unique, inverse = grouped(keys.reshape(-1))
        return np.stack(np.divmod(unique.view(np.int64), nodes), axis=1), inverse.reshape(6, -1).T

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

    def _face_keys(self) -> npt.NDArray[np.uint64]:
        """A number for each face of each tetrahedron, (4m,), the same for the two sides of a face."""
        nodes, keys = len(self.points), np.empty((len(self.tetrahedra), 4), dtype=np.uint64)
        # Three node numbers fit 64 bits up to here; beyond, the first two give way to the number of their pair.
        small = nodes <= 2_600_000
        pairs = np.empty((0 if small else len(keys), 4), dtype=np.uint64)

        def fill(block: slice) -> None:
            corners = np.ascontiguousarray(self.tetrahedra[block].T)
            for face, (i, j, k) in enumerate(FACES):
                a, b, c = corners[i], corners[j], corners[k]
                low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
                pair = low * nodes + (a + b + c - low - high)
                if small:
                    keys[block, face] = pair * nodes + high
                else:
                    keys[block, face], pairs[block, face] = high, pair

        in_blocks(fill, len(keys))
        if not small:
            keys += (grouped(pairs.reshape(-1))[1].astype(np.uint64) * np.uint64(nodes)).reshape(-1, 4)
        return keys.reshape(-1)

    @cached_property
    def neighbours(self) -> IndexArray:
        """The tetrahedron behind the face opposite each corner, (m, 4); -1 at the boundary."""
        unique, face = grouped(self._face_keys())
        # Sums of the numbers of the tetrahedra on both sides: less the one's own it is the other's.
        owners = np.repeat(np.arange(len(self.tetrahedra)), 4)
        both = np.bincount(face, minlength=len(unique)) == 2
        sides = np.bincount(face, owners, len(unique)).astype(np.int64)
        return np.where(both[face], sides[face] - owners, -1).astype(np.int32).reshape(-1, 4)

    @cached_property
    def _boundary(self) -> tuple[IntArray, IntArray]:
        """Faces that belong to one tetrahedron only, as ``4 tetrahedron + face``, and their corners (f, 3)."""
        places = once(self._face_keys())
        return places, self.tetrahedra[places[:, None] // 4, FACES[places % 4]]

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
        return np.asarray(self.tetrahedron_edges[self.boundary_cells[:, None], EDGES_OF_FACES[self._boundary[0] % 4]])

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
            The tetrahedra there.
        """
        kinds_at = np.zeros(len(self.points), dtype=np.int64)
        for kind in np.unique(self.regions):
            touched = np.zeros(len(kinds_at), dtype=bool)
            touched[self.tetrahedra[self.regions == kind]] = True
            kinds_at += touched
        # Both sides of every such triangle are among those whose corners are all of several regions.
        between = kinds_at > 1
        cells = np.flatnonzero(between[self.tetrahedra].sum(axis=1) > 2)
        faces = self.tetrahedra[cells][:, FACES].reshape(-1, 3)
        chosen = between[faces].all(axis=1)
        faces, cells = faces[chosen], np.repeat(cells, 4)[chosen]
        region = self.regions[cells]
        key = np.sort(faces, axis=1)
        order = np.lexsort((region, key[:, 2], key[:, 1], key[:, 0]))
        first, second = order[:-1], order[1:]
        pair = (key[first] == key[second]).all(axis=1) & (region[first] != region[second])
        first, second = first[pair], second[pair]
        return (
            faces[first],
            np.column_stack([region[first], region[second]]),
            np.column_stack([cells[first], cells[second]]),
        )

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
        """The boundary as a surface of its own, flat facets and all."""
        return Surface(self.boundary_points, self.boundary_triangles, self.unit, "mesh", crease_angle=0.0)

    @cached_property
    def boundary_areas(self) -> FloatArray:
        """Area of each boundary triangle, (f,), unit²."""
        return triangle_areas(self.points, self.boundary_faces)[1]

    @cached_property
    def boundary_node_areas(self) -> FloatArray:
        """A third of the area of the triangles around each boundary node, (b,): weights that sum to `area`."""
        return self.to_boundary_nodes(self.boundary_areas)

    def to_boundary_nodes(self, shares: FloatArray) -> FloatArray:
        """Sums (b,) at boundary nodes of what boundary triangles (f,) give to their corners, a third to each."""
        nodes, weights = self.boundary_triangles.ravel(), np.repeat(shares / 3.0, 3)
        return np.asarray(np.bincount(nodes, weights, minlength=len(self.boundary_nodes)), dtype=np.float64)

    @cached_property
    def node_volumes(self) -> FloatArray:
        """A quarter of the volume of the tetrahedra around each node, (n,): weights that sum to `volume`."""
        return self.to_nodes(self.volumes)

    def to_nodes(self, shares: FloatArray) -> FloatArray:
        """Sums (n,) at nodes of what tetrahedra (m,) give to their corners, a quarter to each."""
        sums = np.zeros(len(self.points))
        for corner in self.tetrahedra.T:
            sums += np.bincount(corner, shares / 4.0, minlength=len(sums))
        return sums

    @cached_property
    def hat_gradients(self) -> FloatArray:
        """Gradients of the barycentric coordinates in each tetrahedron, (m, 4, 3), 1/unit."""
        result = np.empty((len(self.tetrahedra), 4, 3))

        def fill(block: slice, corners: FloatArray) -> None:
            u, v, w = corners[1:] - corners[0]
            three = np.stack([cross(v, w), cross(w, u), cross(u, v)]) / (6.0 * self.volumes[block])
            result[block, 1:] = three.transpose(2, 0, 1)
            result[block, 0] = -three.sum(axis=0).T

        over_corners(fill, self.points, self.tetrahedra)
        return result

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
        result = np.empty(len(self.tetrahedra))

        def fill(block: slice, corners: FloatArray) -> None:
            squares = [dot(side, side) for side in (corners[j] - corners[i] for i, j in EDGES)]
            result[block] = np.sqrt(np.maximum.reduce(squares))

        over_corners(fill, self.points, self.tetrahedra)
        return result

    @cached_property
    def quality(self) -> FloatArray:
        """Shape of each tetrahedron, (m,): three inradii over the circumradius, 1 regular, 0 flat."""
        result = np.empty(len(self.tetrahedra))

        def fill(block: slice, corners: FloatArray) -> None:
            u, v, w = corners[1:] - corners[0]
            vw, wu, uv = cross(v, w), cross(w, u), cross(u, v)
            volume = dot(u, vw) / 6.0
            moment = dot(u, u) * vw + dot(v, v) * wu + dot(w, w) * uv
            circumradius = np.sqrt(dot(moment, moment)) / (12.0 * volume)
            area = 0.5 * sum(np.sqrt(dot(n, n)) for n in (vw, wu, uv, vw + wu + uv))
            result[block] = 9.0 * volume / area / circumradius

        over_corners(fill, self.points, self.tetrahedra)
        return result

    @cached_property
    def _closest(self) -> ClosestPoint:
        return ClosestPoint(self.points, self.boundary_faces)

    def closest_boundary(self, queries: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        """Nearest boundary points of queries (q, 3): points (q, 3), faces (q,), barycentric weights (q, 3)."""
        nearest, face = self._closest(queries)
        return nearest, face, barycentric_of(nearest, self.points[self.boundary_faces[face]])

    @cached_property
    def _distances(self) -> dict[Surface, FloatArray]:
        return {}

    def boundary_distances(self, surface: Surface, faces: IntArray) -> FloatArray:
        """How far the middles of boundary triangles (q,) are from a surface, (q,), unit; each is measured once."""
        known = self._distances.setdefault(surface, np.full(len(self.boundary_faces), np.nan))
        new = faces[np.isnan(known[faces])]
        middles = self.points[self.boundary_faces[new]].mean(axis=1)
        known[new] = np.linalg.norm(surface.project(middles)[0] - middles, axis=1)
        return np.asarray(known[faces])

    @cached_property
    def rays(self) -> RayCaster:
        """The boundary, ready to be met by rays; faces are numbered as `boundary_faces`."""
        return RayCaster(self.points, self.boundary_faces)

    @cached_property
    def tree(self) -> CellTree:
        """The tetrahedra in a tree of boxes, which finds those that points lie in and paths pass."""
        return CellTree(self.points, self.tetrahedra)

    @cached_property
    def marched(self) -> Kept:
        """Paths that were marched through it, see `tetlux.meshing.tets.march`."""
        return Kept()

    @cached_property
    def _remembered(self) -> dict[Hashable, Any]:
        return {}

    def remembered(self, key: Hashable, work: Callable[[], _T]) -> _T:
        """What others work out for this mesh and ask for again: the latest of it is kept, by a key.

        Nothing is kept if the key has no hash, as one with lists in it has none.
        """
        known = self._remembered
        try:
            found: _T | None = known.get(key)
        except TypeError:
            return work()
        if found is not None:
            return found
        made = work()
        # Another thread may be at it too.
        with suppress(KeyError, RuntimeError, StopIteration):
            while len(known) >= MOST_REMEMBERED:
                del known[next(iter(known))]
        known[key] = made
        return made

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
        return self.tree.locate(np.asarray(queries, dtype=float).reshape(-1, 3))

    def region_at(self, queries: FloatArray) -> IntArray:
        """The region of the tetrahedron that holds each point (q, 3), or of the one nearest to it, (q,)."""
        cells, _ = self.locate(queries)
        outside = np.flatnonzero(cells < 0)
        if len(outside):
            cells[outside] = self.boundary_cells[self.closest_boundary(queries[outside])[1]]
        return np.asarray(self.regions[cells])

    def named(self, labels: Iterable[int]) -> str:
        """Labels as text, with their names, to be read: ``1 (scalp) and 2 (skull)``."""
        texts = [f"{label} ({self.labels[label]})" if label in self.labels else str(label) for label in labels]
        shown = texts if len(texts) <= MOST_NAMED else [*texts[:MOST_NAMED], f"{len(texts) - MOST_NAMED} more"]
        return " and ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)

    @cached_property
    def region_volumes(self) -> dict[int, float]:
        """Volume of each region, unit³, by its number in ascending order."""
        if self.regions.strides == (0,):
            return {int(self.regions[0]): self.volume}
        numbers, place = np.unique(self.regions, return_inverse=True)
        volumes = np.bincount(place, self.volumes)
        return dict(zip(numbers.tolist(), volumes.tolist(), strict=True))

    def __repr__(self) -> str:
        regions = len(np.unique(self.regions))
        parts = "" if regions == 1 else f"{count(regions, 'region')}, "
        return (
            f"TetMesh({count(len(self.points), 'node')}, {count(len(self.tetrahedra), 'tetrahedron', 'tetrahedra')}, "
            f"{parts}{size(self.points, self.unit)}, volume {self.volume:.3g} {self.unit}³)"
        )


def tetrahedron_volumes(points: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """Signed volumes (m,) of tetrahedra (m, 4)."""
    result = np.empty(len(tetrahedra))

    def fill(block: slice, corners: FloatArray) -> None:
        u, v, w = corners[1:] - corners[0]
        result[block] = dot(u, cross(v, w)) / 6.0

    over_corners(fill, points, tetrahedra)
    return result
