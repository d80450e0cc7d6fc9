"""Remove the second side of two-sided exports whose sides are triangulated differently.

Sides of equal triangles are the subject of `tetlux.meshing.repair.merge.single_faces`.
"""

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.repair.orient import flips_of
from tetlux.meshing.repair.topology import Edges, compact, components, distinct_rows
from tetlux.meshing.search.closest import ClosestPoint
from tetlux.meshing.search.proximity import winding_number
from tetlux.meshing.surface.triangles import signed_volume, triangle_areas

# A sheet is the other side of a finer one if its vertices lie within the first share of the diagonal of it (text of six
# digits rounds at 1e-6), the centroids of its triangles within the second, and it has at least the third share of its
# area. Of an icosphere of 80 triangles in a fine sphere these are 0, .02 and .87; an inscribed octahedron has .12.
ON_SHEET, BULGE, LEAST_AREA = 1e-5, 0.05, 0.5
# The two sides of a thin body also coincide, but each is shallow: an open sheet must be deeper than this share of its
# diagonal (three times the volume of the cone over its rim, over its area) to have a second side.
DEEP = 0.1
# Two triangles that meet at an edge with less than this angle between them, radians, are two sides at their rim.
FOLDED = 0.5
# The winding counts as consistent if all but this share of the edges with an even number of triangles are traversed
# equally often in both directions: a few triangles may be turned over. Edges with an odd number lie at cracks, holes.
UNBALANCED = 0.1
# Surfaces of more sheets are not searched.
MOST_SHEETS = 200


def drop_second_sides(points: FloatArray, faces: IntArray, repairs: list[str]) -> tuple[FloatArray, IntArray]:
    """Keep one of two sheets of triangles that coincide; inside a body remove both, since they are a wall.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
        In any orientation.
    repairs : list of str
        A sentence is appended.
    """
    sheet = _sheets(points, faces)
    count = int(sheet.max(initial=0)) + 1
    if not 2 <= count <= MOST_SHEETS:
        return points, faces
    copied = _find_copies(faces)
    parts = [np.flatnonzero(sheet == i) for i in range(count)]
    # Of sheets of equally many triangles the later one is dropped.
    parts.sort(key=lambda part: (len(part), -part[0]))
    dropped = np.zeros(len(faces), dtype=bool)
    sides, walls = 0, 0
    for i, part in enumerate(parts):
        if copied[part].all() or dropped[part].any():
            continue
        other = next((each for each in parts[i + 1 :] if _is_side_of(points, faces[part], faces[each])), None)
        if other is None:
            continue
        dropped[part] = True
        rest = np.concatenate([each for each in parts if each is not part and each is not other] or [part[:0]])
        if len(rest) and abs(winding_number(points, faces[rest], points[faces[part[:1]]].mean(axis=1))[0]) > 0.25:
            dropped[other] = True
            walls += len(part) + len(other)
        else:
            sides += len(part)
    if sides:
        repairs.append(f"kept one side of a two-sided surface, and removed the {sides} triangles of the other.")
    if walls:
        repairs.append(f"removed {walls} triangles of a wall inside the body.")
    return compact(points, faces[~dropped])


def _find_copies(faces: IntArray) -> BoolArray:
    """Whether each triangle is given more than once, in either orientation."""
    _, kind = distinct_rows(np.sort(faces, axis=1))
    return np.asarray(np.bincount(kind)[kind] > 1)


def _is_side_of(points: FloatArray, faces: IntArray, others: IntArray) -> bool:
    """Whether a sheet coincides with another one of at least as many triangles."""
    low, high = points[faces].min(axis=(0, 1)), points[faces].max(axis=(0, 1))
    other_low, other_high = points[others].min(axis=(0, 1)), points[others].max(axis=(0, 1))
    size = float(np.linalg.norm(other_high - other_low))
    if (low < other_low - ON_SHEET * size).any() or (high > other_high + ON_SHEET * size).any():
        return False
    area, other_area = (float(triangle_areas(points, each)[1].sum()) for each in (faces, others))
    if area < LEAST_AREA * other_area or _depth(points, others) < DEEP * size:
        return False
    closest = ClosestPoint(points, others)
    for places, share in ((points[np.unique(faces)], ON_SHEET), (points[faces].mean(axis=1), BULGE)):
        if (np.linalg.norm(closest(places)[0] - places, axis=1) > share * size).any():
            return False
    return True


def _depth(points: FloatArray, faces: IntArray) -> float:
    """Three times the volume of the cone over an open sheet's rim, over its area; infinity for a closed sheet."""
    edges = Edges(faces)
    rim = edges.start[edges.sides(edges.triangles == 1)]
    if len(rim) == 0:
        return np.inf
    turned = flips_of(edges, len(faces))
    if turned is None:
        return 0.0
    oriented = np.where(turned[:, None], faces[:, ::-1], faces)
    volume = signed_volume(points - points[rim].mean(axis=0), oriented)
    return float(3.0 * abs(volume) / triangle_areas(points, faces)[1].sum())


def _sheets(points: FloatArray, faces: IntArray) -> IntArray:
    """The sheet of each triangle, (m,): triangles that continue each other across edges.

    Two triangles that fold back on each other do not. Where more than two meet at an edge, pairs continue each other:
    those that are farthest from folded, of equal ones those that come first in the file. If the winding is consistent
    at nearly all edges, only those that traverse the edge in opposite directions continue each other.
    """
    edges = Edges(faces)
    across = _across(points, faces)
    two = np.flatnonzero(edges.triangles[edges.edge] == 2)
    plain = two[np.argsort(edges.edge[two], kind="stable")].reshape(-1, 2)
    folded = np.einsum("ij,ij->i", across[plain[:, 0]], across[plain[:, 1]]) > np.cos(FOLDED)
    links = [plain[~folded]]
    crowded = np.flatnonzero(edges.triangles[edges.edge] > 2)
    crowded = crowded[np.lexsort([crowded % len(faces), edges.edge[crowded]])]
    first = np.flatnonzero(np.diff(edges.edge[crowded], prepend=-1))
    # Greater than any difference of cosines.
    balance = edges.balance[edges.triangles % 2 == 0]
    alike = 4.0 if np.count_nonzero(balance) <= UNBALANCED * len(balance) else 1e-6
    for sides in np.split(crowded, first[1:]) if len(crowded) else []:
        links.append(_continuing(across[sides], edges.start[sides], sides, alike))
    return components(len(faces), np.concatenate(links) % len(faces))


def _across(points: FloatArray, faces: IntArray) -> FloatArray:
    """Unit vectors from each side of the triangles to their third corners, perpendicular to the side, (3 m, 3)."""
    start, end, apex = (points[np.roll(faces, -i, axis=1).T.ravel()] for i in range(3))
    along = end - start
    length2 = np.einsum("ij,ij->i", along, along)
    reach = apex - start
    reach -= (np.einsum("ij,ij->i", reach, along) / np.where(length2 > 0, length2, 1.0))[:, None] * along
    length = np.linalg.norm(reach, axis=1)
    return np.asarray(reach / np.where(length > 0, length, 1.0)[:, None])


def _continuing(across: FloatArray, starts: IntArray, sides: IntArray, alike: float) -> IntArray:
    """Pairs (p, 2) of the sides (k,) at one edge that continue each other.

    Parameters
    ----------
    across : (k, 3) ndarray
        See `_across`.
    starts, sides : (k,) ndarray
    alike : float
        The cost of a pair in one direction, compared with the cosine of the angle between the triangles.
    """
    cost = across @ across.T + alike * (starts[:, None] == starts)
    one, other = np.triu_indices(len(sides), 1)
    pairs, taken = [], set[int]()
    for k in np.argsort(np.round(cost[one, other], 9), kind="stable"):
        i, j = int(one[k]), int(other[k])
        if i not in taken and j not in taken:
            taken |= {i, j}
            pairs.append((sides[i], sides[j]))
    return np.array(pairs, dtype=np.int64)
