"""Areas, normals, volumes and barycentric coordinates of triangles."""

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray, sum_by_index
from tetlux.meshing.host.corners import cross, dot
from tetlux.meshing.surface.subdivide import NEXT_CORNER


def triangle_areas(points: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (m, 3) and areas (m,) of triangles; the normal of a degenerate one is zero."""
    a, b, c = np.ascontiguousarray(points.T)[:, faces.T].swapaxes(0, 1)
    normal = cross(b - a, c - a)
    length = np.sqrt(dot(normal, normal))
    return np.ascontiguousarray((normal / np.where(length > 0, length, 1.0)).T), 0.5 * length


def vertex_normals(points: FloatArray, faces: IntArray) -> FloatArray:
    """Unit normals (n, 3) at the vertices of triangles (m, 3), exact on a sphere (Max 1999); zero without triangles."""
    corners, sums = points[faces], np.zeros_like(points)
    for corner in range(3):
        first, second = (corners[:, (corner + step) % 3] - corners[:, corner] for step in (1, 2))
        squares = np.einsum("fi,fi->f", first, first) * np.einsum("fi,fi->f", second, second)
        weighted = np.cross(first, second) / np.where(squares > 0, squares, 1.0)[:, None]
        sums += np.column_stack([sum_by_index(faces[:, corner], axis, len(points)) for axis in weighted.T])
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.asarray(sums / np.where(lengths > 0, lengths, 1.0))


def body_sizes(points: FloatArray, faces: IntArray, body: IntArray) -> tuple[FloatArray, FloatArray]:
    """Volume and area of each body, (b,), of either orientation; `body` (m,) is the body of each triangle, from 0."""
    corners = points[faces]
    count = int(body.max()) + 1
    # Relative to its own centre, since a small body far from the origin would lose digits.
    middle = np.column_stack([sum_by_index(body, x, count) for x in corners.mean(axis=1).T])
    middle /= np.bincount(body, minlength=count)[:, None]
    a, b, c = (corners[:, i] - middle[body] for i in range(3))
    volume = np.abs(sum_by_index(body, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0, count))
    return volume, sum_by_index(body, triangle_areas(points, faces)[1], count)


def longest_sides(corners: FloatArray) -> FloatArray:
    """Longest sides (f,) of triangles (f, 3, 3)."""
    sides = corners - corners[:, NEXT_CORNER]
    return np.asarray(np.sqrt(np.einsum("fij,fij->fi", sides, sides).max(axis=1, initial=0.0)))


def signed_volume(points: FloatArray, faces: IntArray) -> float:
    """Volume enclosed by outward oriented triangles (divergence theorem), negative if they face inward."""
    origin = points.mean(axis=0)
    a, b, c = (points[faces[:, i]] - origin for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def barycentric_on_triangles(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Barycentric coordinates (q, 3) of points (q, 3) on triangles (q, 3, 3)."""
    origin, second, third = np.ascontiguousarray(triangles.transpose(1, 2, 0))
    u, v, w = second - origin, third - origin, points.T - origin
    normal = cross(u, v)
    scale = dot(normal, normal)
    scale = np.where(scale > 0, scale, 1.0)
    to_second, to_third = dot(cross(w, v), normal) / scale, dot(cross(u, w), normal) / scale
    return np.column_stack([1.0 - to_second - to_third, to_second, to_third])
