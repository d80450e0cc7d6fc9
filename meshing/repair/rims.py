"""Join nested rims: a cut through a thick wall leaves two, and a ring between them closes it."""

from collections.abc import Sequence

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.repair.topology import components

# A rim lies in the plane of another if its distance from it is below this share of the gap between the two. For
# rims of one part the share is small, to exclude shallow funnels; ragged rims of two parts in a scan need a larger one.
LEVEL, LEVEL_OF_PARTS = 0.1, 0.5


def join_nested_rims(
    points: FloatArray, faces: IntArray, loops: Sequence[IntArray]
) -> tuple[list[IntArray], list[IntArray]]:
    """Join each rim to the rim around it, so that the cap of both is the ring between them.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
    loops : sequence of ndarray
        The rims, in the direction of the triangles along them; the inner rim of a wall has the opposite direction.

    Returns
    -------
    loops : list of ndarray
        In the order of the outer rims. A joined loop runs along a bridge to the inner rim, around it, and back.
    overlapping : list of ndarray
        Rims inside others in the same direction, so that their caps overlap.
    """
    if len(loops) < 2:
        return list(loops), []
    part = components(len(points), np.vstack([faces[:, :2], faces[:, 1:]]))
    parts = [int(part[loop[0]]) for loop in loops]
    vectors = np.array([_area_vector(points[loop]) for loop in loops]).reshape(-1, 3)
    areas = np.linalg.norm(vectors, axis=1)
    around = [_around(points, loops, vectors, parts, i) for i in range(len(loops))]
    inner: dict[int, list[int]] = {}
    overlapping = []
    for i, those in enumerate(around):
        if len(those) % 2 == 0:
            continue
        parent = min(those, key=lambda j: areas[j])
        if vectors[i] @ vectors[parent] < 0:
            inner.setdefault(parent, []).append(i)
        else:
            overlapping.append(loops[i])
    joined = {i for those in inner.values() for i in those}
    result = []
    for i, loop in enumerate(loops):
        if i not in joined:
            result.append(_bridge(points, loop, [loops[j] for j in inner.get(i, [])]))
    return result, overlapping


def _around(points: FloatArray, loops: Sequence[IntArray], vectors: FloatArray, parts: list[int], i: int) -> list[int]:
    """The rims around a rim, in its plane."""
    rim = points[loops[i]]
    low, high = rim.min(axis=0), rim.max(axis=0)
    found = []
    for j, loop in enumerate(loops):
        outer = points[loop]
        slack = 0.5 * np.ptp(outer, axis=0).max()
        near = (low >= outer.min(axis=0) - slack).all() and (high <= outer.max(axis=0) + slack).all()
        level = LEVEL if parts[i] == parts[j] else LEVEL_OF_PARTS
        if i != j and near and _within(rim, outer, vectors[j], level):
            found.append(j)
    return found


def _within(rim: FloatArray, outer: FloatArray, vector: FloatArray, level: float) -> bool:
    """Whether a rim lies in the plane of an outer rim and, along that rim's area vector, inside it."""
    length = np.linalg.norm(vector)
    if length == 0.0:
        return False
    normal = vector / length
    axes = np.linalg.svd(normal[None])[2][1:]
    middle = outer.mean(axis=0)
    flat, frame = (rim - middle) @ axes.T, (outer - middle) @ axes.T
    if not _inside(flat, frame).all():
        return False
    gap = float(np.linalg.norm(flat[:, None] - frame, axis=2).min())
    return bool(np.abs((rim - middle) @ normal).max() <= level * gap)


def _inside(queries: FloatArray, polygon: FloatArray) -> BoolArray:
    """Whether each query (q, 2) is inside a polygon (k, 2)."""
    spokes = polygon - queries[:, None]
    following = np.roll(spokes, -1, axis=1)
    cross = spokes[..., 0] * following[..., 1] - spokes[..., 1] * following[..., 0]
    angles = np.arctan2(cross, (spokes * following).sum(axis=2))
    return np.asarray(np.abs(angles.sum(axis=1)) > np.pi)


def _area_vector(rim: FloatArray) -> FloatArray:
    spokes = rim - rim.mean(axis=0)
    return np.asarray(0.5 * np.cross(spokes, np.roll(spokes, -1, axis=0)).sum(axis=0))


def _bridge(points: FloatArray, loop: IntArray, inner: list[IntArray]) -> IntArray:
    """One loop along an outer rim and all inner ones, the nearest first, so that no bridge crosses another."""
    rest = list(inner)
    while rest:
        gaps = [np.linalg.norm(points[loop][:, None] - points[other], axis=2) for other in rest]
        nearest = int(np.argmin([gap.min() for gap in gaps]))
        i, j = np.unravel_index(int(gaps[nearest].argmin()), gaps[nearest].shape)
        other = rest.pop(nearest)
        loop = np.concatenate([loop[: i + 1], other[j:], other[: j + 1], loop[i:]])
    return loop
