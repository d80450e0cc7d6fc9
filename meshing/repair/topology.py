"""Connectivity of triangles and tetrahedra: edges, rims, connected bodies."""

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray


def compact(points: FloatArray, cells: IntArray) -> tuple[FloatArray, IntArray]:
    """Points and cells without the points that no cell uses."""
    used = np.zeros(len(points), dtype=bool)
    used[cells.ravel()] = True
    return points[used], (np.cumsum(used) - 1)[cells]


def distinct_rows(rows: npt.NDArray[np.generic]) -> tuple[IntArray, IntArray]:
    """The first of each set of equal rows, and the index of each row's set.

    Several times faster than ``np.unique(axis=0)``.
    """
    order = np.lexsort(rows.T[::-1])
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    kind = np.empty(len(rows), dtype=np.int64)
    kind[order] = np.cumsum(new) - 1
    return order[new], kind


def components(count: int, pairs: IntArray) -> IntArray:
    """The connected component of each of `count` items, (count,), given connected pairs (p, 2)."""
    from scipy.sparse import coo_matrix  # noqa: PLC0415
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    graph = coo_matrix((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def bodies(point_count: int, cells: IntArray) -> IntArray:
    """The connected body of each cell, (m,), numbered from 0; cells with a common vertex are connected."""
    pairs = np.column_stack([np.repeat(cells[:, 0], cells.shape[1] - 1), cells[:, 1:].ravel()])
    labels = components(point_count, pairs)[cells[:, 0]]
    _, numbered = np.unique(labels, return_inverse=True)
    return np.asarray(numbered.reshape(-1), dtype=np.int64)


class Edges:
    """The edges of triangles (m, 3), per triangle side and per edge of the surface.

    Attributes
    ----------
    start, end : (3 m,) ndarray
        Vertices of the triangles' sides, in the direction of the triangle.
    edge : (3 m,) ndarray
        The edge of each side.
    triangles, balance : (e,) ndarray
        For each edge: the number of its triangles, and how many more of them traverse it in ascending than in
        descending order of vertices.
    """

    def __init__(self, faces: IntArray) -> None:
        self.start = faces.T.ravel()
        self.end = faces[:, [1, 2, 0]].T.ravel()
        # One integer per edge sorts several times faster than two.
        key = np.minimum(self.start, self.end) * (int(faces.max(initial=0)) + 1) + np.maximum(self.start, self.end)
        _, self.edge, self.triangles = np.unique(key, return_inverse=True, return_counts=True)
        self.balance = np.bincount(self.edge, np.where(self.start < self.end, 1, -1))

    @property
    def consistent(self) -> bool:
        """Whether the two triangles at each edge traverse it in opposite directions."""
        return bool((self.balance[self.triangles == 2] == 0).all())

    @property
    def closed(self) -> bool:
        """Whether an even number of triangles meets at each edge."""
        return not bool((self.triangles % 2).any())

    def sides(self, chosen: BoolArray) -> IntArray:
        """The sides, numbered as `start`, of chosen edges (e,)."""
        return np.flatnonzero(chosen[self.edge])


def boundary_loops(edges: Edges) -> list[IntArray]:
    """The rims of holes: closed loops of vertices along edges of one triangle only."""
    single = edges.sides(edges.triangles == 1)
    rim = list(zip(edges.start[single].tolist(), edges.end[single].tolist(), strict=True))
    neighbours: dict[int, list[int]] = {}
    for a, b in rim:
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    directed = set(rim)
    loops = []
    for start in neighbours:
        path, place = [start], {start: 0}
        while path:
            here = path[-1]
            if not neighbours[here]:
                del place[path.pop()]
                continue
            following = neighbours[here].pop()
            neighbours[following].remove(here)
            if following in place:
                # Holes that touch at a vertex are separated: each return to a vertex ends a loop.
                first = place[following]
                loop = path[first:]
                for vertex in path[first + 1 :]:
                    del place[vertex]
                del path[first + 1 :]
                forward = (loop[0], loop[1]) in directed
                loops.append(np.array(loop if forward else loop[::-1], dtype=np.int64))
            else:
                place[following] = len(path)
                path.append(following)
    return loops
