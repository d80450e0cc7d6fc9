"""Cap a hole: triangulate its rim, refine to the density of the rim, and relax the cap like a membrane.

Liepa, Filling holes in meshes, SGP 2003, with a harmonic surface in place of his thin plate. It stays within the convex
hull of the rim, so the cap of a flat rim is flat, and it does not leave a concave flat rim.
"""

from collections.abc import Callable

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.repair.merge import drop_collapsed
from tetlux.meshing.repair.topology import Edges

# Of longer rims one in k vertices is triangulated first, since time grows with the cube (.3 s at this length).
LONGEST_RIM = 300
# Weight of squared sides relative to area, over the squared shortest edge of the rim as a share of its extent. All
# triangulations of a flat rim that stay within it have one area, and this prefers compact ones; with a constant weight
# of 1e-3, triangles leave the rim at concave corners.
COMPACT = 0.01
# Triangles are split until their sides are this many rim edges long (Liepa's alpha).
DENSITY = 2.0
# Rounds of splitting and flipping; each at least halves the lengths.
ROUNDS = 12
# Largest number of triangles of one cap. A rim of n edges needs about n squared / 10.
MOST = 20_000
# Triangles without area may count as turned over by this share of the cap's area.
ROUNDING = 1e-12
# Gain (e,) of flipping the edge a-b of triangles abc and bad, from their corners (e, 3).
Gain = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], FloatArray]


def cap(points: FloatArray, loop: IntArray, first: int) -> tuple[FloatArray, IntArray]:
    """Triangles over a hole.

    Parameters
    ----------
    points : (n, 3) ndarray
    loop : (k,) ndarray
        The vertices of the rim, in the direction of the triangles along it.
    first : int
        The number of the first new vertex.

    Returns
    -------
    added : (a, 3) ndarray
        New vertices.
    faces : (f, 3) ndarray
        Oriented like the triangles along the rim.
    """
    faces = triangulate_polygon(points[loop])[:, ::-1]
    # A loop through several rims contains the ends of its bridge twice. Merged, the bridge is an inner edge.
    names, place = np.unique(loop, return_inverse=True)
    faces, rim = drop_collapsed(place.reshape(-1)[faces])[0], points[names]
    inner, faces = _refine(rim, _spacing(points, loop, names), faces) if len(loop) > 4 else (rim[:0], faces)
    inner = _relax(rim, inner, faces)
    return inner, np.concatenate([names, first + np.arange(len(inner))])[faces]


def _spacing(points: FloatArray, loop: IntArray, names: IntArray) -> FloatArray:
    """Mean length of the rim edges at each of the vertices `names` (r,), without bridges."""
    following = np.roll(loop, -1)
    bridge = np.isin(loop * len(points) + following, following * len(points) + loop)
    start, end = np.searchsorted(names, loop[~bridge]), np.searchsorted(names, following[~bridge])
    length = np.linalg.norm(points[loop[~bridge]] - points[following[~bridge]], axis=1)
    ends, lengths = np.concatenate([start, end]), np.concatenate([length, length])
    return np.asarray(np.bincount(ends, lengths, len(names)) / np.bincount(ends, minlength=len(names)))


def triangulate_polygon(corners: FloatArray) -> IntArray:
    """The triangulation (k - 2, 3) of least area of a polygon in space (k, 3), in its orientation."""
    count = len(corners)
    if count <= LONGEST_RIM:
        return _least_area(corners)
    coarse = _sharpest(corners, -(-count // LONGEST_RIM))
    parts = [coarse[_least_area(corners[coarse])]]
    for start, end in zip(coarse, [*coarse[1:], coarse[0] + count], strict=True):
        if end - start > 1:
            chain = np.arange(start, end + 1) % count
            parts.append(chain[_least_area(corners[chain])])
    faces = np.vstack(parts)
    # Where the rim is concave, triangles of a chain overlap others; flips unfold them.
    for _ in range(ROUNDS):
        faces, flips = _flip(corners, faces, _area_saved)
        if not flips:
            break
    return faces


def _sharpest(corners: FloatArray, step: int) -> IntArray:
    """The sharpest of each `step` consecutive vertices of a polygon (k, 3), so that corners are among them."""
    ahead = np.roll(corners, -1, axis=0) - corners
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), np.finfo(float).tiny)
    straight = np.round(np.einsum("ij,ij->i", ahead, np.roll(ahead, 1, axis=0)), 9)
    starts = range(0, len(corners), step)
    return np.array([start + int(straight[start : start + step].argmin()) for start in starts])


def _least_area(corners: FloatArray) -> IntArray:
    """Triangulate by dynamic programming (Barequet & Sharir 1995) over all chains of one length at a time."""
    count = len(corners)
    if count == 3:
        return np.arange(3).reshape(1, 3)
    squares = ((corners[:, None] - corners) ** 2).sum(axis=2)
    edges = np.append(squares[np.arange(count - 1), np.arange(1, count)], squares[0, -1])
    compact = COMPACT * edges.min(initial=np.inf, where=edges > 0) / squares.max()
    best = np.zeros((count, count))
    apex = np.zeros((count, count), dtype=np.int64)
    for gap in range(2, count):
        i = np.arange(count - gap)[:, None]
        k = i + np.arange(1, gap)
        j = i + gap
        a, b, c = squares[i, k], squares[k, j], squares[i, j]
        # Heron's formula in squared sides; cross products take three times as long.
        area = 0.25 * np.sqrt(np.maximum(4.0 * a * b - (a + b - c) ** 2, 0.0))
        weight = best[i, k] + best[k, j] + area + compact * (a + b + c)
        least = weight.argmin(axis=1)
        rows = i[:, 0]
        best[rows, rows + gap] = weight[rows, least]
        apex[rows, rows + gap] = rows + 1 + least
    faces, todo = [], [(0, count - 1)]
    while todo:
        one, other = todo.pop()
        if other - one > 1:
            middle = int(apex[one, other])
            faces.append((one, middle, other))
            todo += [(one, middle), (middle, other)]
    return np.array(faces, dtype=np.int64)


def _refine(rim: FloatArray, size: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Insert vertices as dense as the nearby rim; return them and the triangles of all vertices."""
    points = rim
    for _ in range(ROUNDS):
        corners, wanted = points[faces], size[faces]
        middle = corners.mean(axis=1)
        reach = np.linalg.norm(corners - middle[:, None], axis=2)
        large = (np.sqrt(DENSITY) * reach > wanted.mean(axis=1)[:, None]).all(axis=1)
        if not large.any() or len(faces) + 2 * large.sum() > MOST:
            break
        new = len(points) + np.arange(large.sum())
        a, b, c = faces[large].T
        pieces = [np.column_stack(each) for each in ((a, b, new), (b, c, new), (c, a, new))]
        faces = np.vstack([faces[~large], *pieces])
        points, size = np.vstack([points, middle[large]]), np.concatenate([size, wanted[large].mean(axis=1)])
        for _ in range(ROUNDS):
            faces, flips = _flip(points, faces, _angles_beyond)
            if not flips:
                break
    return points[len(rim) :], faces


def _flip(points: FloatArray, faces: IntArray, gain: Gain) -> tuple[IntArray, int]:
    """Flip inner edges where that gains, at most one per triangle; return triangles and the number of flips."""
    edges = Edges(faces)
    count = len(faces)
    inner = edges.sides((edges.triangles == 2) & (edges.balance == 0))
    pairs = inner[np.argsort(edges.edge[inner], kind="stable")].reshape(-1, 2)
    if len(pairs) == 0:
        return faces, 0
    apex = faces.T[[2, 0, 1]].ravel()
    a, b, c, d = edges.start[pairs[:, 0]], edges.end[pairs[:, 0]], apex[pairs[:, 0]], apex[pairs[:, 1]]
    gains = gain(*(points[corner] for corner in (a, b, c, d)))
    existing = set((np.minimum(edges.start, edges.end) * len(points) + np.maximum(edges.start, edges.end)).tolist())
    busy = np.zeros(count, dtype=bool)
    result = faces.copy()
    flips = 0
    for i in np.argsort(-gains):
        if gains[i] <= 0:
            break
        first, second = pairs[i] % count
        key = int(min(c[i], d[i]) * len(points) + max(c[i], d[i]))
        if busy[first] or busy[second] or key in existing:
            continue
        result[first], result[second] = (a[i], d[i], c[i]), (d[i], b[i], c[i])
        busy[first] = busy[second] = True
        existing.add(key)
        flips += 1
    return result, flips


def _angles_beyond(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """The sum of the angles at c and d minus pi: positive where the Delaunay criterion is violated."""

    def angle(apex: FloatArray) -> FloatArray:
        u, v = a - apex, b - apex
        return np.asarray(np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v)))

    return angle(c) + angle(d) - np.pi - 1e-6


def _area_saved(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Area saved by flipping two triangles that overlap each other."""

    def area(p: FloatArray, q: FloatArray, r: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(np.cross(q - p, r - p), axis=1))

    before, after = area(a, b, c) + area(a, b, d), area(a, c, d) + area(b, c, d)
    return before * (1.0 - 1e-9) - after


def _relax(rim: FloatArray, inner: FloatArray, faces: IntArray) -> FloatArray:
    """Move the inner vertices of a cap onto a membrane.

    If no triangle overlaps another, seen along the mean normal, they move along that normal only, so that none ever
    does: by a membrane in all directions, triangles would fold over at concave corners of the rim (Tutte 1963).
    """
    moved = _membrane(rim, inner, faces)
    corners = np.vstack([rim, inner])[faces]
    vectors = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = vectors.sum(axis=0)
    if (vectors @ normal < -ROUNDING * (normal @ normal)).any():
        return moved
    normal /= np.linalg.norm(normal)
    return np.asarray(inner + ((moved - inner) @ normal)[:, None] * normal)


def _membrane(rim: FloatArray, inner: FloatArray, faces: IntArray) -> FloatArray:
    """Move each inner vertex to the mean of its neighbours, weighted by their inverse distances."""
    if len(inner) == 0:
        return inner
    from scipy.sparse import coo_matrix  # noqa: PLC0415
    from scipy.sparse.linalg import spsolve  # noqa: PLC0415

    count, fixed = len(rim) + len(inner), len(rim)
    points = np.vstack([rim, inner])
    sides = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    length = np.linalg.norm(points[sides[:, 0]] - points[sides[:, 1]], axis=1)
    weight = 1.0 / np.maximum(length, 1e-12 * length.max())
    rows, columns = np.concatenate([sides, sides[:, ::-1]]).T
    links = coo_matrix((np.tile(weight, 2), (rows, columns)), shape=(count, count)).tocsr()[fixed:]
    degree = np.asarray(links.sum(axis=1)).ravel()
    system = coo_matrix((degree, (np.arange(len(inner)), np.arange(len(inner)))), shape=(len(inner),) * 2).tocsc()
    return np.asarray(spsolve(system - links[:, fixed:].tocsc(), links[:, :fixed] @ rim)).reshape(-1, 3)
