"""Separate a surface at edges of more than two triangles and at vertices where fans of triangles touch.

Where parts of a body touch along an edge or at a vertex, triangles of different parts meet. No light passes through an
edge or a vertex, and quadric decimation requires a manifold surface. With separate vertices for each part, the
surface is manifold and bounds the same body.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.search.proximity import winding_number
from tetlux.meshing.surface.subdivide import mark_longest_edges, number_triangle_edges, split_edges
from tetlux.meshing.surface.triangles import signed_volume

# Triangles at one edge with less than this angle between them, radians, coincide.
SAME_PLANE = 1e-4
# A part attached by an edge or a vertex only is removed below the first share of the volume, if all such parts together
# are below the second: the mesher loses such parts, and no light reaches them through the body.
CRUMB = (1e-3, 5e-2)
# Triangles that enclose less than this share of the volume are a wall and no part.
NOTHING = 1e-12


def pull_apart(points: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray] | None:
    """Give each part of a body separate vertices where parts touch along edges or at vertices.

    Edges of more than two triangles are first split at their midpoints, so that they can be separated where both ends
    belong to one part.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
        A closed surface, consistently oriented.

    Returns
    -------
    points : (k, 3) ndarray
        The given points, repeated where parts touch, and the midpoints of split edges.
    faces : (l, 3) ndarray
        Two triangles at each edge, one fan at each vertex.
        None instead of both if the surface is not consistently oriented.
    """
    edges = number_triangle_edges(faces)
    crowded = np.bincount(edges[1].ravel(), minlength=len(edges[0])) > 2
    if crowded.any():
        points, faces, _ = split_edges(points, faces, edges, mark_longest_edges(points, edges, crowded))
    pairs = _pairs(points, faces)
    if pairs is None:
        return None
    # Sides are numbered like the corners where they start; each starts where its partner ends.
    one, other = pairs
    rows, columns = np.concatenate([one, _following(one)]), np.concatenate([_following(other), other])
    graph = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(faces.size, faces.size))
    _, fan = connected_components(graph, directed=False)
    _, corner = np.unique(fan, return_index=True)
    return points[faces.ravel()[corner]], fan.reshape(-1, 3).astype(np.int64)


def parts_of(points: FloatArray, faces: IntArray) -> IntArray | None:
    """The part of the body that each triangle bounds, (m,), numbered from 0; None if it is not oriented.

    Parts that touch along an edge or at a vertex are not connected.
    """
    pairs = _pairs(points, faces)
    if pairs is None:
        return None
    rows, columns = pairs[0] // 3, pairs[1] // 3
    graph = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(len(faces), len(faces)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def mend_parts(points: FloatArray, faces: IntArray, bodies: IntArray, repairs: list[str]) -> IntArray:
    """Turn inside-out parts outward, and remove attached parts that are too small to be meshed.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
        A closed surface, consistently oriented.
    bodies : (m,) ndarray
        The body of each triangle, where shared vertices connect.
    repairs : list of str
        Sentences on the repairs are appended.

    Returns
    -------
    (l, 3) ndarray
    """
    part = parts_of(points, faces)
    if part is None or part.max() == bodies.max():
        return faces
    count = int(part.max()) + 1
    body = np.zeros(count, dtype=np.int64)
    body[part] = bodies
    volumes = np.array([signed_volume(points, faces[part == i]) for i in range(count)])
    turned = np.zeros(count, dtype=bool)
    for i in np.flatnonzero(volumes < 0):
        others = faces[(bodies == body[i]) & (part != i)]
        middle = points[faces[part == i][:1]].mean(axis=1)
        # An inward part inside the others is a cavity that touches the surface.
        turned[i] = len(others) > 0 and abs(winding_number(points, others, middle)[0]) < 0.5
    if turned.any():
        repairs.append(f"turned {_parts_are(int(turned.sum()))} inside out outward.")
        faces = np.where(turned[part][:, None], faces[:, ::-1], faces)
    volumes = np.abs(volumes)
    largest = np.zeros(int(body.max()) + 1)
    np.maximum.at(largest, body, volumes)
    # The largest part of a body is the body itself, and walls without volume are no parts.
    shares = volumes / volumes.sum()
    small = (shares < CRUMB[0]) & (volumes < largest[body]) & (shares > NOTHING)
    if shares[small].sum() > CRUMB[1]:
        return faces
    if small.any():
        repairs.append(
            f"removed {_parts_hang(int(small.sum()))} on the body by an edge or a vertex only, with "
            f"{shares[small].sum():.2g} of its volume."
        )
    return np.asarray(faces[~small[part]])


def _parts_are(count: int) -> str:
    return "a part that was" if count == 1 else f"{count} parts that were"


def _parts_hang(count: int) -> str:
    return "a small part that hung" if count == 1 else f"{count} small parts that hung"


def _following(side: IntArray) -> IntArray:
    """The next side (or corner) of the same triangle."""
    return np.asarray(side + np.where(side % 3 == 2, -2, 1))


def _pairs(points: FloatArray, faces: IntArray) -> tuple[IntArray, IntArray] | None:
    """Pairs of sides that meet at an edge of one part, each once; side 3 f + k of face f starts at its corner k."""
    ends, number = number_triangle_edges(faces)
    number = number.ravel()
    up = faces.ravel() == ends[number, 0]
    if np.bincount(number, np.where(up, 1, -1)).any():
        return None
    crowded = (np.bincount(number) > 2)[number]
    plain = np.flatnonzero(~crowded)
    one, other = plain[np.argsort(number[plain], kind="stable")].reshape(-1, 2).T
    sides = np.flatnonzero(crowded)
    if len(sides) == 0:
        return one, other
    edge = number[sides]
    angle = _angles(points, faces, ends[edge], sides, edge)
    order = np.lexsort((angle, edge))
    sides, edge, angle = sides[order], edge[order], angle[order]
    first = np.flatnonzero(np.diff(edge, prepend=-1))
    before = np.arange(len(edge)) - 1
    before[first] = np.append(first[1:], len(edge)) - 1
    gap = angle - angle[before]
    gap[first] += 2.0 * np.pi
    each = zip(*(np.split(values, first[1:]) for values in (up[sides], gap, sides)), strict=True)
    pairs = np.concatenate([_match(*(values.tolist() for values in at_one)) for at_one in each])
    return np.concatenate([one, pairs[:, 0]]), np.concatenate([other, pairs[:, 1]])


def _angles(points: FloatArray, faces: IntArray, ends: IntArray, sides: IntArray, edge: IntArray) -> FloatArray:
    """The angle of each side's triangle around its edge, radians, right-handed about the direction of the edge."""
    along = points[ends[:, 1]] - points[ends[:, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    reach = points[faces.ravel()[_following(_following(sides))]] - points[ends[:, 0]]
    across = reach - np.einsum("ij,ij->i", reach, along)[:, None] * along
    _, first, number = np.unique(edge, return_index=True, return_inverse=True)
    ahead = across[first][number]
    aside = np.cross(along, ahead)
    turn = np.arctan2(np.einsum("ij,ij->i", across, aside), np.einsum("ij,ij->i", across, ahead))
    return np.asarray(turn % (2.0 * np.pi))


def _match(up: list[bool], gap: list[float], sides: list[int]) -> IntArray:
    """Pairs (k, 2) of the sides at one edge.

    In order of angle, the body begins behind a triangle whose side runs down the edge and ends at one whose side runs
    up. They match like brackets, which are nested where one part is inside out or inside another. Triangles back to
    back are a wall between two parts: they match first, and the remaining triangles bound both parts as one.

    Parameters
    ----------
    up : list of bool
        Whether each side runs up the edge, in the order of their angles.
    gap : list of float
        The angle between each triangle and the one before it, radians.
    sides : list of int
    """
    pairs: list[tuple[int, int]] = []
    left: list[tuple[bool, int]] = []
    # Start at the widest gap, so that no wall lies between the last and the first.
    start = gap.index(max(gap))
    for i in [*range(start, len(sides)), *range(start)]:
        if left and gap[i] < SAME_PLANE and left[-1][0] != up[i]:
            pairs.append((left.pop()[1], sides[i]))
        else:
            left.append((up[i], sides[i]))
    # Sides whose partner comes before the first angle are matched in a second round.
    begun: list[int] = []
    done: set[int] = set()
    for ends, side in 2 * left:
        if side in done:
            continue
        if not ends and side not in begun:
            begun.append(side)
        elif ends and begun:
            pairs.append((begun.pop(), side))
            done.update(pairs[-1])
    return np.array(pairs, dtype=np.int64)
