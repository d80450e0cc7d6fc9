"""Overlapping boxes, winding numbers and line intersections of triangles."""

from collections.abc import Iterator

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray

# A line whose angle to a triangle's plane has a sine below this is parallel to it.
PARALLEL = 1e-9
# Pairs of boxes processed at once (tens of megabytes).
BOX_PAIRS_AT_ONCE = 1 << 18


def overlapping_boxes(low: FloatArray, high: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Pairs of boxes that touch or overlap, each pair once.

    Boxes are sorted along a Morton curve into a binary tree of bounding boxes; pairs of tree nodes are split level by
    level, many at a time.

    Parameters
    ----------
    low, high : (n, 3) ndarray
        Corners of the boxes.

    Yields
    ------
    first, second : (p,) ndarray
        Indices of the boxes, in portions that bound the memory.
    """
    order = np.argsort(_morton_code(0.5 * (low + high)))
    depth = int(len(order) - 1).bit_length()
    padding = (0, (1 << depth) - len(order))
    # Padded with empty boxes.
    lows = [np.pad(x[order], padding, constant_values=np.inf) for x in low.T]
    highs = [np.pad(x[order], padding, constant_values=-np.inf) for x in high.T]
    levels = [(lows, highs)]
    for _ in range(depth):
        lows = [np.minimum(x[0::2], x[1::2]) for x in lows]
        highs = [np.maximum(x[0::2], x[1::2]) for x in highs]
        levels.append((lows, highs))
    todo = [(depth, np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))]
    while todo:
        level, i, j = todo.pop()
        if level == 0:
            distinct = i != j
            yield order[i[distinct]], order[j[distinct]]
        elif len(i) > BOX_PAIRS_AT_ONCE:
            half = len(i) // 2
            todo += [(level, i[:half], j[:half]), (level, i[half:], j[half:])]
        else:
            lows, highs = levels[level - 1]
            i, j = 2 * i, 2 * j
            # For a node paired with itself, the pair (second child, first child) repeats (first, second).
            distinct = i != j
            i, j = np.concatenate([i, i, i + 1, i[distinct] + 1]), np.concatenate([j, j + 1, j + 1, j[distinct]])
            for lowest, highest in zip(lows, highs, strict=True):
                keep = (lowest[i] <= highest[j]) & (lowest[j] <= highest[i])
                i, j = i[keep], j[keep]
            todo.append((level - 1, i, j))


def _morton_code(points: FloatArray) -> IntArray:
    """Morton code of each point, (n,): the interleaved bits of its coordinates."""
    size = float(np.ptp(points, axis=0).max())
    code = ((points - points.min(axis=0)) * (1023.0 / size if size > 0 else 0.0)).astype(np.int64)
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        code = (code | code << shift) & mask
    return np.asarray(code[:, 0] | code[:, 1] << 1 | code[:, 2] << 2)


def winding_number(points: FloatArray, faces: IntArray, queries: FloatArray) -> FloatArray:
    """Winding number of a closed surface around each query point: 1 inside, 0 outside.

    The sum of the triangles' signed solid angles (Van Oosterom & Strackee 1983) over 4 pi.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray, outward oriented
    queries : (q, 3) ndarray

    Returns
    -------
    (q,) ndarray
    """
    # By coordinate, since NumPy is slow along axes of three.
    corners = [np.ascontiguousarray(points[faces[:, i]].T) for i in range(3)]
    result = np.empty(len(queries))
    for i, query in enumerate(queries):
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (corner - query[:, None] for corner in corners)
        la = np.sqrt(ax * ax + ay * ay + az * az)
        lb = np.sqrt(bx * bx + by * by + bz * bz)
        lc = np.sqrt(cx * cx + cy * cy + cz * cz)
        numerator = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        denominator = (
            la * lb * lc
            + (ax * bx + ay * by + az * bz) * lc
            + (bx * cx + by * cy + bz * cz) * la
            + (cx * ax + cy * ay + cz * az) * lb
        )
        result[i] = np.arctan2(numerator, denominator).sum() / (2.0 * np.pi)
    return result


def cross_segments(
    origins: FloatArray, directions: FloatArray, corners: FloatArray, slack: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Intersections of lines with triangles, pairwise (Möller & Trumbore 1997).

    Parameters
    ----------
    origins, directions : (n, 3) ndarray
    corners : (n, 3, 3) ndarray
        The triangle of each pair.
    slack : float
        Distance outside a triangle, in barycentric coordinates, that still counts as a hit.

    Returns
    -------
    distances : (n,) ndarray
        In multiples of each direction's length; nan where the line misses the triangle or is parallel.
    barycentric : (n, 2) ndarray
        Weights of the triangle's second and third corner.
    """
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(directions, edge2)
    determinant = np.einsum("ij,ij->i", edge1, p)
    size = np.prod([np.linalg.norm(v, axis=1) for v in (edge1, edge2, directions)], axis=0)
    # Products of huge origins overflow; such a line misses the triangle.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        inverse = 1.0 / determinant
        s = origins - corners[:, 0]
        u = np.einsum("ij,ij->i", s, p) * inverse
        q = np.cross(s, edge1)
        v = np.einsum("ij,ij->i", directions, q) * inverse
        t = np.einsum("ij,ij->i", edge2, q) * inverse
        hit = (u >= -slack) & (v >= -slack) & (u + v <= 1.0 + slack) & (np.abs(determinant) > PARALLEL * size)
    return np.where(hit, t, np.nan), np.column_stack([u, v])
