"""Merge coincident vertices and remove duplicate triangles."""

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.repair.topology import Edges, compact, components, distinct_rows
from tetlux.meshing.search.proximity import winding_number

# Vertices closer than this share of the diagonal are merged; text formats round at about 1e-7.
MERGE_TOLERANCE = 1e-7


def merge_vertices(points: FloatArray, faces: IntArray, repairs: list[str]) -> tuple[FloatArray, IntArray]:
    """Merge coincident vertices and remove the triangles that collapse."""
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    first, kind = _same_places(points, max(MERGE_TOLERANCE * diagonal, np.finfo(float).tiny))
    if len(first) < len(points):
        # Separate vertices for each triangle are a property of the format, so they are not reported.
        if len(points) != 3 * len(faces):
            repairs.append(f"merged {len(points) - len(first)} vertices that coincide with another.")
        points, faces = points[first], kind[faces]
    faces, collapsed = drop_collapsed(faces)
    if collapsed:
        repairs.append(f"removed {collapsed} triangles without area.")
    return compact(points, faces)


def drop_collapsed(faces: IntArray) -> tuple[IntArray, int]:
    """The triangles with three different corners, and the number of others."""
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return faces[distinct], int((~distinct).sum())


def near_pairs(points: FloatArray, tolerance: float) -> IntArray:
    """Pairs (p, 2) of points no farther apart than `tolerance`."""
    from scipy.spatial import cKDTree  # noqa: PLC0415

    return np.asarray(cKDTree(points).query_pairs(tolerance, output_type="ndarray"), dtype=np.int64).reshape(-1, 2)


def _same_places(points: FloatArray, tolerance: float) -> tuple[IntArray, IntArray]:
    """The first vertex at each place, and the index of each vertex's place."""
    # Merge exact copies first: with six copies per place, as in files of loose triangles, near pairs are too many.
    first, kind = distinct_rows(points)
    pairs = near_pairs(points[first], tolerance)
    if len(pairs) == 0:
        return first, kind
    place = components(len(first), pairs)[kind]
    _, first = np.unique(place, return_index=True)
    return first, place


def single_faces(points: FloatArray, faces: IntArray, repairs: list[str]) -> IntArray:
    """Keep one copy of each triangle, and remove walls inside the body.

    A triangle that is given equally often in both orientations is part of a two-sided export, or of a wall between two
    touching bodies. Patches of such triangles are kept if the surface is open without them.
    """
    if len(faces) == 0:
        return faces
    order = np.argsort(faces, axis=1)
    # A permutation of three is even if it is a rotation.
    way = np.where((order[:, 1] - order[:, 0]) % 3 == 1, 1, -1)
    first, kind = distinct_rows(np.take_along_axis(faces, order, axis=1))
    if len(first) == len(faces):
        return faces
    facing = np.bincount(kind, way)
    # Of equal triangles, keep the first with the majority's orientation.
    usual = np.flatnonzero(way * facing[kind] >= 0)[::-1]
    first[kind[usual]] = usual
    both = facing == 0
    wall = both.copy()
    wall[both] = ~_bounding(points, faces[first[~both]], faces[first[both]])
    kept = first[~wall]
    if (~wall & both).any():
        repairs.append(f"kept one side of {int((~wall & both).sum())} triangles given on both sides.")
    rest = len(faces) - len(kept) - int((both & ~wall)[kind].sum()) + int((both & ~wall).sum())
    if rest:
        repairs.append(f"removed {rest} triangles given twice.")
    return np.asarray(faces[np.sort(kept)])


def without_pairs(faces: IntArray) -> IntArray:
    """No copy of triangles given an even number of times, one of others: the parity at each edge is unchanged."""
    first, kind = distinct_rows(np.sort(faces, axis=1))
    return np.asarray(faces[np.sort(first[np.bincount(kind) % 2 == 1])])


def _bounding(points: FloatArray, plain: IntArray, double: IntArray) -> BoolArray:
    """Which two-sided triangles (d, 3) belong to the surface that the one-sided ones (p, 3) are part of, (d,)."""
    if len(double) == 0:
        return np.zeros(0, dtype=bool)
    edges = Edges(np.vstack([plain, double]))
    count = len(plain) + len(double)
    side = np.tile(np.arange(count), 3) - len(plain)
    plains = np.bincount(edges.edge[side < 0], minlength=len(edges.triangles))
    doubles = edges.triangles - plains
    # Patches: two-sided triangles joined at edges.
    mine = np.flatnonzero(side >= 0)
    mine = mine[np.argsort(edges.edge[mine], kind="stable")]
    same = edges.edge[mine[1:]] == edges.edge[mine[:-1]]
    patch = components(len(double), side[np.column_stack([mine[1:][same], mine[:-1][same]])])
    rim = mine[doubles[edges.edge[mine]] % 2 == 1]
    beside, of = plains[edges.edge[rim]], patch[side[rim]]
    patches = int(patch.max()) + 1
    votes = np.bincount(of, np.where(beside == 0, 0, np.where(beside % 2 == 1, 1, -1)), patches)
    loose = np.bincount(of, beside > 0, patches) == 0
    closed = np.bincount(of, minlength=patches) == 0
    keep = votes > 0
    _, member = np.unique(patch, return_index=True)
    for one in np.flatnonzero(closed):
        # The surface of a core that fills its shell is a wall.
        middle = points[double[member[one]]].mean(axis=0, keepdims=True)
        keep[one] = len(plain) == 0 or abs(winding_number(points, plain, middle)[0]) < 0.25
    if len(plain) == 0 and not keep.any():
        # An open body given on both sides; beside a closed one it would be a fin.
        keep = loose
    return np.asarray(keep[patch])
