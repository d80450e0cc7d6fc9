"""Close seams whose two sides do not share vertices: T-junctions, as CAD programs export them, and hair cracks."""

from itertools import pairwise

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.repair.merge import drop_collapsed, near_pairs
from tetlux.meshing.repair.topology import Edges, compact, components
from tetlux.meshing.search.proximity import overlapping_boxes

# A rim vertex within the first share of the diagonal of a rim edge lies on it (text of six digits rounds at 1e-6). Rim
# vertices closer than the second share of their rim edges are merged.
ON_EDGE = 1e-5
NEAR = 0.1
# A triangle whose height is below this share of the diagonal and of its longest side only fills a seam.
SLIVER = 1e-6
# Inserted vertices make new edges, so insertion is repeated; chains end after a few rounds.
ROUNDS = 4


def stitch(points: FloatArray, faces: IntArray, repairs: list[str]) -> tuple[FloatArray, IntArray]:
    """Close the seams of an open surface: insert the vertices that already lie on its edges.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
    repairs : list of str
        A sentence is appended.

    Returns
    -------
    points, faces : ndarray
        The same surface; no point has moved by more than ``ON_EDGE`` of the diagonal.
    """
    before = Edges(faces)
    if before.closed:
        return points, faces
    tolerance = ON_EDGE * float(np.linalg.norm(np.ptp(points, axis=0)))
    stitched, inserted, joined = faces, 0, 0
    for _ in range(ROUNDS):
        same = _merge_rims(points, Edges(stitched), tolerance)
        stitched = _without_slivers(points, drop_collapsed(same[stitched])[0], SLIVER / ON_EDGE * tolerance)
        stitched, added = _with_vertices_on_edges(points, stitched, tolerance)
        merged = int((same != np.arange(len(points))).sum())
        inserted, joined = inserted + added, joined + merged
        if added == merged == 0:
            break
    # A few of entirely unconnected triangles could be stitched by chance.
    if len(stitched) == 0 or (Edges(stitched).triangles % 2).sum() >= (before.triangles % 2).sum():
        return points, faces
    if joined:
        repairs.append(f"closed hair cracks: joined {joined} {'vertex' if joined == 1 else 'vertices'} to others.")
    if inserted:
        repairs.append(f"stitched {inserted} {'T-junction' if inserted == 1 else 'T-junctions'}.")
    return compact(points, stitched)


def _merge_rims(points: FloatArray, edges: Edges, tolerance: float) -> IntArray:
    """The vertex that each vertex is merged into, (n,): on rims, vertices much closer than the length of rim edges."""
    same = np.arange(len(points))
    sides = edges.sides(edges.triangles % 2 == 1)
    start, end = edges.start[sides], edges.end[sides]
    length = np.linalg.norm(points[end] - points[start], axis=1)
    shortest = np.full(len(points), np.inf)
    np.minimum.at(shortest, start, length)
    np.minimum.at(shortest, end, length)
    rim = np.flatnonzero(np.isfinite(shortest))
    pairs = rim[near_pairs(points[rim], tolerance)]
    apart = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    pairs = pairs[apart < NEAR * shortest[pairs].min(axis=1)]
    if len(pairs):
        _, first, kind = np.unique(components(len(points), pairs), return_index=True, return_inverse=True)
        same = first[kind.reshape(-1)]
    return same


def _without_slivers(points: FloatArray, faces: IntArray, height: float) -> IntArray:
    """Remove flat triangles with a corner on their longest side."""
    corners = points[faces]
    sides = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2)
    longest = sides.max(axis=1)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        low = (area / longest <= height) & (area / longest <= SLIVER * longest)
    return np.asarray(faces[~low])


def _with_vertices_on_edges(points: FloatArray, faces: IntArray, tolerance: float) -> tuple[IntArray, int]:
    """Split triangles at rim vertices on their open edges; return triangles and the number of splits."""
    edges = Edges(faces)
    sides = edges.sides(edges.triangles % 2 == 1)
    if len(sides) == 0:
        return faces, 0
    rim = np.unique(np.concatenate([edges.start[sides], edges.end[sides]]))
    side, vertex, share = _on_sides(points, edges.start[sides], edges.end[sides], rim, tolerance)
    if len(side) == 0:
        return faces, 0
    on: dict[tuple[int, int], list[int]] = {}
    for i in np.lexsort([share, side]):
        at = sides[side[i]]
        on.setdefault((int(edges.start[at]), int(edges.end[at])), []).append(int(vertex[i]))
    touched = np.zeros(len(faces), dtype=bool)
    touched[sides[side] % len(faces)] = True
    split: list[tuple[int, int, int]] = []
    for a, b, c in faces[touched].tolist():
        split += _split(a, b, c, {side: on[side] for side in ((a, b), (b, c), (c, a)) if side in on})
    added = len(split) - int(touched.sum())
    return np.vstack([faces[~touched], np.array(split, dtype=np.int64)]), added


def _split(a: int, b: int, c: int, on: dict[tuple[int, int], list[int]]) -> list[tuple[int, int, int]]:
    """Split a triangle with vertices `on` its sides: a fan from the corner opposite each such side.

    The sides that a fan makes are not split, be they those of other triangles.
    """
    for start, end, apex in ((a, b, c), (b, c, a), (c, a, b)):
        inner = [vertex for vertex in on.get((start, end), []) if vertex != apex]
        if inner:
            rest = {side: vertices for side, vertices in on.items() if side != (start, end)}
            chain = [start, *inner, end]
            return [piece for one, following in pairwise(chain) for piece in _split(one, following, apex, rest)]
    return [(a, b, c)]


def _on_sides(
    points: FloatArray, start: IntArray, end: IntArray, rim: IntArray, tolerance: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Sides and the vertices on them, with the relative position of each along its side."""
    a, b, v = points[start], points[end], points[rim]
    low = np.vstack([np.minimum(a, b) - tolerance, v])
    high = np.vstack([np.maximum(a, b) + tolerance, v])
    found: list[tuple[IntArray, IntArray, FloatArray]] = []
    for one, other in overlapping_boxes(low, high):
        pair = np.sort(np.column_stack([one, other]), axis=1)
        i, j = pair[(pair[:, 0] < len(a)) & (pair[:, 1] >= len(a))].T
        j = j - len(a)
        along, to = b[i] - a[i], v[j] - a[i]
        length2 = np.einsum("ij,ij->i", along, along)
        share = np.einsum("ij,ij->i", along, to) / np.where(length2 > 0, length2, 1.0)
        off = np.linalg.norm(to - share[:, None] * along, axis=1)
        margin = tolerance / np.sqrt(np.where(length2 > 0, length2, np.inf))
        between = (off <= tolerance) & (share > margin) & (share < 1.0 - margin)
        between &= (rim[j] != start[i]) & (rim[j] != end[i])
        found.append((i[between], rim[j[between]], share[between]))
    sides, vertices, shares = (np.concatenate(each) for each in zip(*found, strict=True))
    return sides, vertices, shares
