"""What is wrong with a triangle mesh, what can be mended safely, and words for both."""

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.crossings import count_self_intersections
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.proximity import winding_number
from tetlux.meshing.surface import UNITS, Surface, signed_volume, triangle_areas

# Vertices nearer than this share of the diagonal are one: text formats round at about 1e-7.
MERGE_TOLERANCE = 1e-7
# A hole wider than this share of the diagonal is a missing part, and closing it would invent a shape.
LARGEST_HOLE = 0.05
# A body whose thickness, 2 V/A, is below this share of its diagonal has no inside.
FLAT = 1e-7
# In whatever unit.
LONGEST = 1e30
# Triangles do not join if more edges than these belong to one triangle only: so many, and so many a triangle.
MOST_RIMS = (300, 0.25)
# More separate bodies than these are a surface that fell to pieces.
MOST_BODIES = 1000
# A surface that crosses itself at more triangles than these, and at more than this share of them, is a tangle: the
# mesher would be at it for minutes.
TANGLE = (100, 0.75)
# Coordinates that are rounded to more than this share of the diagonal are worth a sentence.
COARSE = 1e-4


def surface_from_arrays(
    points: npt.ArrayLike, faces: npt.ArrayLike, *, unit: str = "mm", name: str = "surface"
) -> Surface:
    """Check a triangle mesh, mend what can be mended safely, and say what was done.

    Parameters
    ----------
    points : (n, 3) array_like
    faces : (m, 3) array_like
    unit : str
        One of nm, um, mm, cm, m, in.
    name : str
        Used in messages.

    Returns
    -------
    Surface
        Closed and outward oriented; `repairs` and `warnings` tell what was found.

    Raises
    ------
    InputError
        If the mesh bounds no body: empty, not finite, flat, or open beyond small holes.
    """
    if unit not in UNITS:
        raise InputError(f'unit "{unit}" is not known; give one of {", ".join(UNITS)}.')
    points, faces = _checked_arrays(points, faces, name)
    repairs: list[str] = []
    warnings: list[str] = []
    rounding = _rounding(points)
    points, faces = _merged(points, faces, repairs)
    if len(faces) < 4 and rounding > MERGE_TOLERANCE:
        raise InputError(
            f"{name}: the surface lies so far from the origin that its vertices are not told apart; move it to the "
            "origin where it was made, and write it again."
        )
    if len(faces) < 4:
        raise InputError(f"{name}: the mesh has {len(faces)} usable triangles; a body needs at least four.")
    if np.ptp(points, axis=0).min() == 0:
        raise InputError(f"{name}: the surface is flat and encloses no volume; give a closed surface.")
    points, faces = _closed(points, faces, name, repairs, warnings)
    faces, nested = _oriented(points, faces, name, repairs, warnings)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    if 2.0 * signed_volume(points, faces) <= FLAT * diagonal * float(triangle_areas(points, faces)[1].sum()):
        raise InputError(f"{name}: the surface is flat and encloses no volume; give a closed surface.")
    crossing = count_self_intersections(points, faces)
    if crossing is None:
        warnings.append(
            Note(
                "crossing-unchecked",
                "whether the surface crosses itself was not looked at, since too many of its triangles lie side by "
                "side, like the needles of a fan; evenly shaped triangles are quicker and more accurate.",
            )
        )
    elif crossing > max(TANGLE[0], TANGLE[1] * len(faces)):
        raise InputError(
            f"{name}: the surface crosses itself at {crossing:,} of {len(faces):,} triangles, a tangle that bounds no "
            "body; repair it in a mesh editor."
        )
    elif crossing:
        warnings.append(
            Note(
                "crossing",
                f"the surface crosses itself at {crossing} triangles; the union of what it encloses is taken.",
                value=crossing,
            )
        )
    if rounding > COARSE:
        warnings.append(
            Note(
                "far-from-origin",
                f"the surface lies so far from the origin that its coordinates are rounded to {rounding:.1%} of its "
                "size; move it to the origin where it was made, and write it again.",
                value=rounding,
            )
        )
    # Walls between bodies that touch count on both sides.
    overlaps = nested or bool(crossing) or bool((Edges(faces).triangles > 2).any())
    return Surface(points, faces, unit, name, tuple(repairs), tuple(warnings), overlaps)


def _checked_arrays(points: npt.ArrayLike, faces: npt.ArrayLike, name: str) -> tuple[FloatArray, IntArray]:
    """Arrays of the right shape that hold finite vertices, all of them used."""
    try:
        vertices = np.array(points, dtype=np.float64)
        triangles = np.array(faces, dtype=np.int64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name}: points and faces must be arrays of numbers.") from error
    if vertices.size == 0:
        raise InputError(f"{name}: the mesh is empty; give a closed triangle mesh.")
    if triangles.size == 0:
        raise InputError(f"{name}: there are points but no triangles; give a closed triangle mesh.")
    if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3:
        raise InputError(
            f"{name}: points have shape {vertices.shape} and faces {triangles.shape}; "
            "give (n, 3) coordinates and (m, 3) triangles."
        )
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise InputError(f"{name}: a triangle names a vertex that does not exist; the file is damaged.")
    # Vertices that no triangle uses are no part of the surface, wherever they are.
    vertices, triangles = compact(vertices, triangles)
    bad = int((~np.isfinite(vertices)).any(axis=1).sum())
    if bad:
        raise InputError(
            f"{name}: {bad} of {len(vertices)} vertices are not finite (NaN or infinity); repair the file."
        )
    largest = float(np.abs(vertices).max())
    if (vertices == vertices[0]).all():
        raise InputError(
            f"{name}: all vertices are at one place; give a closed triangle mesh, and if it is of a body far from the "
            "origin, move it there before it is written."
        )
    if not 1 / LONGEST <= largest <= LONGEST:
        raise InputError(f"{name}: coordinates reach {largest:g}, absurdly far or near; check the scale and the unit.")
    return vertices, triangles


def _rounding(points: FloatArray) -> float:
    """To what share of the diagonal coordinates are rounded, by how far from the origin they are."""
    single = np.asarray(points, dtype=np.float32)
    largest = np.abs(points).max()
    unit = float(np.spacing(np.float32(largest)) if (single == points).all() else np.spacing(largest))
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    return unit / diagonal if diagonal > 0 else 0.0


def _merged(points: FloatArray, faces: IntArray, repairs: list[str]) -> tuple[FloatArray, IntArray]:
    """Coincident vertices made one; collapsed and repeated triangles removed."""
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    cell = max(MERGE_TOLERANCE * diagonal, np.finfo(float).tiny)
    first, inverse = _distinct_rows(np.round((points - points.min(axis=0)) / cell))
    if len(first) < len(points):
        # Formats that give every triangle vertices of its own are no flaw of the surface.
        if len(points) != 3 * len(faces):
            repairs.append(f"merged {len(points) - len(first)} vertices that coincide with another.")
        points, faces = points[first], inverse[faces]

    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    if not distinct.all():
        repairs.append(f"removed {int((~distinct).sum())} triangles without area.")
    faces = faces[distinct]
    once = single(faces)
    if len(once) < len(faces):
        repairs.append(f"removed {len(faces) - len(once)} triangles given twice.")
    return compact(points, once)


def compact(points: FloatArray, cells: IntArray) -> tuple[FloatArray, IntArray]:
    """Without the points that no cell uses."""
    used = np.zeros(len(points), dtype=bool)
    used[cells.ravel()] = True
    return points[used], (np.cumsum(used) - 1)[cells]


def _distinct_rows(rows: npt.NDArray[np.generic]) -> tuple[IntArray, IntArray]:
    """The first of each kind of row, and for every row the number of its kind.

    What ``np.unique(axis=0)`` does, several times quicker.
    """
    order = np.lexsort(rows.T[::-1])
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    kind = np.empty(len(rows), dtype=np.int64)
    kind[order] = np.cumsum(new) - 1
    return order[new], kind


def single(faces: IntArray) -> IntArray:
    """One of triangles given twice; none of a pair back to back, which is a wall inside the body."""
    if len(faces) == 0:
        return faces
    order = np.argsort(faces, axis=1)
    ordered = np.take_along_axis(faces, order, axis=1)
    # A permutation of three is even if it is a rotation.
    even = (order[:, 1] - order[:, 0]) % 3 == 1
    first, inverse = _distinct_rows(ordered)
    facing = np.bincount(inverse, np.where(even, 1, -1))
    return np.asarray(faces[np.sort(first[facing != 0])])


def _closed(
    points: FloatArray, faces: IntArray, name: str, repairs: list[str], warnings: list[str]
) -> tuple[FloatArray, IntArray]:
    """Small holes closed by a fan about their middle."""
    edges = Edges(faces)
    rims = int((edges.triangles == 1).sum())
    if rims > max(MOST_RIMS[0], MOST_RIMS[1] * len(faces)):
        raise InputError(
            f"{name}: the surface is open: {rims:,} of {len(edges.triangles):,} edges belong to one triangle only, as "
            "if its triangles did not join; merge its vertices by distance in a mesh editor."
        )
    loops = boundary_loops(edges)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    centres, fans = [points], [faces]
    for centre, loop in enumerate(loops, len(points)):
        width = float(np.linalg.norm(np.ptp(points[loop], axis=0)))
        if width > LARGEST_HOLE * diagonal:
            at = ", ".join(f"{x:.4g}" for x in points[loop].mean(axis=0))
            raise InputError(
                f"{name}: the surface is open: a hole {width:.4g} wide around ({at}), of {len(loops)} in all; "
                "close it in a mesh editor (holes up to 5 % of the body's size are closed here)."
            )
        centres.append(points[loop].mean(axis=0, keepdims=True))
        fans.append(np.column_stack([np.roll(loop, -1), loop, np.full(len(loop), centre)]))
    if loops:
        points, faces = np.concatenate(centres), np.concatenate(fans)
        repairs.append(f"closed {len(loops)} small {'hole' if len(loops) == 1 else 'holes'}.")
        edges = Edges(faces)
    odd, crowded = int((edges.triangles % 2).sum()), int((edges.triangles > 2).sum())
    if odd:
        raise InputError(
            f"{name}: the surface is open: {odd} edges belong to an odd number of triangles; "
            "repair it in a mesh editor."
        )
    if crowded:
        warnings.append(
            Note(
                "edges-shared",
                f"{crowded} edges are shared by more than two triangles (touching parts).",
                value=crowded,
            )
        )
    return points, faces


class Edges:
    """The edges of triangles (m, 3), as each triangle walks them and as the surface has them.

    Attributes
    ----------
    start, end : (3 m,) ndarray
        Vertices of the triangles' sides in the order walked.
    edge : (3 m,) ndarray
        The number of the edge that each side is.
    triangles, balance : (e,) ndarray
        Of each edge: how many triangles share it; how many more walk it up than down the vertex numbers.
    """

    def __init__(self, faces: IntArray) -> None:
        self.start = faces.T.ravel()
        self.end = faces[:, [1, 2, 0]].T.ravel()
        # One integer an edge sorts several times faster than two.
        key = np.minimum(self.start, self.end) * (int(faces.max()) + 1) + np.maximum(self.start, self.end)
        _, self.edge, self.triangles = np.unique(key, return_inverse=True, return_counts=True)
        self.balance = np.bincount(self.edge, np.where(self.start < self.end, 1, -1))

    @property
    def consistent(self) -> bool:
        """Whether each edge between two triangles is walked once each way."""
        return bool((self.balance[self.triangles == 2] == 0).all())


def boundary_loops(edges: Edges) -> list[IntArray]:
    """The rims of holes: closed chains of vertices along edges that belong to one triangle only."""
    single = edges.triangles[edges.edge] == 1
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
                # Holes that touch at a vertex come apart here: each return to a vertex ends a loop.
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


def _oriented(
    points: FloatArray, faces: IntArray, name: str, repairs: list[str], warnings: list[str]
) -> tuple[IntArray, bool]:
    """Consistent winding within each body, and every body outward; and whether one lies within another.

    Cavities are refused.
    """
    edges = Edges(faces)
    if not edges.consistent:
        turned = _to_turn(edges, len(faces))
        if turned is None:
            raise InputError(f"{name}: the surface has no inside and outside (like a Klein bottle); repair it.")
        faces = np.where(turned[:, None], faces[:, ::-1], faces)
        repairs.append("made the winding of the triangles consistent.")
    body = bodies(len(points), faces)
    count = int(body.max()) + 1
    if count > MOST_BODIES:
        raise InputError(
            f"{name}: the surface falls into {count:,} bodies that share no vertex, more than {MOST_BODIES:,}; merge "
            "its vertices by distance in a mesh editor, or keep the largest bodies."
        )
    order = np.argsort(body, kind="stable")
    parts = np.split(faces[order], np.flatnonzero(np.diff(body[order])) + 1)
    inward = np.array([_volume_of(points[part]) < 0 for part in parts])
    low = np.array([points[part].min(axis=(0, 1)) for part in parts])
    high = np.array([points[part].max(axis=(0, 1)) for part in parts])
    inner = []
    for i, part in enumerate(parts):
        boxes = ((low <= low[i]) & (high >= high[i])).all(axis=1)
        boxes[i] = False
        start = points[part[0, :1]]
        around = [j for j in np.flatnonzero(boxes) if abs(winding_number(points, parts[j], start)[0]) > 0.5]
        if (inward[around] != inward[i]).any():
            raise InputError(
                f"{name}: there is a cavity inside the body, and cavities are not supported; remove the inner surface."
            )
        if around:
            inner.append(i + 1)
    if inner:
        which = f"body {inner[0]} of {count} lies" if len(inner) == 1 else f"{len(inner)} bodies of {count} lie"
        warnings.append(
            Note(
                "nested-bodies",
                f"{which} inside another and {'changes' if len(inner) == 1 else 'change'} nothing.",
                value=len(inner),
            )
        )
    if inward.any():
        several = int(inward.sum())
        repairs.append(
            "turned an inside-out surface outward."
            if several == 1
            else f"turned {several} inside-out surfaces outward."
        )
    outer = count - len(inner)
    if outer > 1:
        warnings.append(
            Note(
                "several-bodies",
                f"the surface consists of {outer} bodies; light does not pass between those that are apart.",
                value=outer,
            )
        )
    return np.where(inward[body][:, None], faces[:, ::-1], faces), bool(inner)


def _to_turn(edges: Edges, count: int) -> BoolArray | None:
    """Which triangles to turn over, (m,), for each edge between two to be walked once each way; None if nothing helps.

    Each triangle stands in a graph twice, as it is and turned over, and is joined to its neighbours as they would go
    with it. Where both are in one part there is a way round from one side of the surface to the other.
    """
    from scipy.sparse import coo_matrix  # noqa: PLC0415
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    between_two = np.flatnonzero(edges.triangles[edges.edge] == 2)
    pairs = between_two[np.argsort(edges.edge[between_two], kind="stable")].reshape(-1, 2)
    against = count * (edges.balance[edges.edge[pairs[:, 0]]] != 0)
    one, other = (pairs % count).T
    rows, columns = np.concatenate([one, one + count]), np.concatenate([other + against, other + count - against])
    graph = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(2 * count, 2 * count))
    part = connected_components(graph, directed=False)[1]
    as_is, turned = part[:count], part[count:]
    return None if (as_is == turned).any() else np.asarray(as_is > turned)


def _volume_of(corners: FloatArray) -> float:
    """Signed volume within triangles (f, 3, 3)."""
    return signed_volume(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def bodies(point_count: int, cells: IntArray) -> IntArray:
    """Which connected part each cell belongs to, (m,), numbered from 0; shared vertices connect."""
    from scipy.sparse import coo_matrix  # noqa: PLC0415
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    first = np.repeat(cells[:, 0], cells.shape[1] - 1)
    other = cells[:, 1:].ravel()
    graph = coo_matrix((np.ones(len(first)), (first, other)), shape=(point_count, point_count))
    labels = connected_components(graph, directed=False)[1][cells[:, 0]]
    _, compact = np.unique(labels, return_inverse=True)
    return np.asarray(compact.reshape(-1), dtype=np.int64)
