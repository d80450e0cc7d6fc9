"""Split edges of triangle meshes so that the meshes stay conforming."""

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray

# Corner i of a triangle is followed by corner NEXT_CORNER[i].
NEXT_CORNER = np.array([1, 2, 0])


def number_triangle_edges(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Number the edges of triangles (f, 3): end nodes (e, 2), and the edge from each corner to the next, (f, 3)."""
    ends = np.sort(np.stack([faces, faces[:, NEXT_CORNER]], axis=2).reshape(-1, 2), axis=1)
    count = int(faces.max(initial=0)) + 1
    key, number = np.unique(ends[:, 0] * np.int64(count) + ends[:, 1], return_inverse=True)
    return np.column_stack([key // count, key % count]), number.reshape(-1, 3)


def mark_longest_edges(points: FloatArray, edges: tuple[IntArray, IntArray], marked: BoolArray) -> BoolArray:
    """Mark the longest edge of every triangle with a marked edge, until nothing changes.

    `edges` are those of `number_triangle_edges`, `marked` has shape (e,). Longest-edge splits keep triangles from
    degenerating (Rivara 1984).
    """
    ends, edge = edges
    lengths = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    longest = edge[np.arange(len(edge)), lengths[edge].argmax(axis=1)]
    marked = marked.copy()
    while True:
        missing = marked[edge].any(axis=1) & ~marked[longest]
        if not missing.any():
            return marked
        marked[longest[missing]] = True


def split_edges(
    points: FloatArray, faces: IntArray, edges: tuple[IntArray, IntArray], marked: BoolArray
) -> tuple[FloatArray, IntArray, IntArray]:
    """Split edges of triangles at their midpoints, and the triangles with them.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (f, 3) ndarray
    edges : tuple of ndarray
        The edges of the triangles, from `number_triangle_edges`.
    marked : (e,) ndarray of bool
        Edges to split, as `mark_longest_edges` returns them.

    Returns
    -------
    points : (n + s, 3) ndarray
        The given points, then the midpoints of the marked edges in their order.
    faces : (g, 3) ndarray
    parents : (g,) ndarray
        The given triangle that contains each.
    """
    ends, edge = edges
    middle = np.full(len(ends), -1)
    middle[marked] = len(points) + np.arange(int(marked.sum()))
    lengths = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    # The longest edge, from a to b, is split first.
    turn = (lengths[edge].argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, turn, axis=1).T
    ab, bc, ca = np.take_along_axis(middle[edge], turn, axis=1).T
    whole, halved = ab < 0, ab >= 0
    parts, parents = [], []
    for rows, *triangle in (
        (whole, a, b, c),
        (halved & (ca < 0), a, ab, c),
        (halved & (ca >= 0), a, ab, ca),
        (halved & (ca >= 0), ab, c, ca),
        (halved & (bc < 0), ab, b, c),
        (halved & (bc >= 0), ab, b, bc),
        (halved & (bc >= 0), ab, bc, c),
    ):
        parts.append(np.column_stack(triangle)[rows])
        parents.append(np.flatnonzero(rows))
    return np.vstack([points, points[ends[marked]].mean(axis=1)]), np.vstack(parts), np.concatenate(parents)


def quarter_triangles(corners: FloatArray) -> FloatArray:
    """Split each triangle (f, 3, 3) into four, (4 f, 3, 3)."""
    a, b, c = (corners[:, i] for i in range(3))
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.stack([np.stack(part, axis=1) for part in parts], axis=1).reshape(-1, 3, 3)
