"""What is wrong with a triangle mesh, what can be mended safely, and words for both."""

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.proximity import cross_segments, overlapping_boxes, winding_number
from tetlux.meshing.surface import UNITS, Surface, signed_volume, triangle_areas

# Vertices nearer than this share of the diagonal are one: text formats round at about 1e-7.
MERGE_TOLERANCE = 1e-7
# A hole wider than this share of the diagonal is a missing part, and closing it would invent a shape.
LARGEST_HOLE = 0.05
# A body whose thickness, 2 V/A, is below this share of its diagonal has no inside.
FLAT = 1e-7
# In whatever unit.
LONGEST = 1e30
# An edge whose end is this share of its length from a triangle touches it and does not pierce it.
TOUCH = 1e-6


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
    points, faces = _merged(points, faces, repairs)
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
    if crossing:
        warnings.append(f"the surface crosses itself at {crossing} triangles; the union of what it encloses is taken.")
    overlaps = nested or crossing > 0
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
    if not 1 / LONGEST <= largest <= LONGEST:
        raise InputError(f"{name}: coordinates reach {largest:g}, absurdly far or near; check the scale and the unit.")
    return vertices, triangles


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
    loops = boundary_loops(edges)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    for loop in loops:
        width = float(np.linalg.norm(np.ptp(points[loop], axis=0)))
        if width > LARGEST_HOLE * diagonal:
            at = ", ".join(f"{x:.4g}" for x in points[loop].mean(axis=0))
            raise InputError(
                f"{name}: the surface is open: a hole {width:.4g} wide around ({at}), of {len(loops)} in all; "
                "close it in a mesh editor (holes up to 5 % of the body's size are closed here)."
            )
        centre = len(points)
        points = np.vstack([points, points[loop].mean(axis=0)])
        fan = [[b, a, centre] for a, b in zip(loop, np.roll(loop, -1), strict=True)]
        faces = np.vstack([faces, np.array(fan, dtype=np.int64)])
    if loops:
        repairs.append(f"closed {len(loops)} small {'hole' if len(loops) == 1 else 'holes'}.")
        edges = Edges(faces)
    odd, crowded = int((edges.triangles % 2).sum()), int((edges.triangles > 2).sum())
    if odd:
        raise InputError(
            f"{name}: the surface is open: {odd} edges belong to an odd number of triangles; "
            "repair it in a mesh editor."
        )
    if crowded:
        warnings.append(f"{crowded} edges are shared by more than two triangles (touching parts).")
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
        path = [start]
        while path:
            here = path[-1]
            if not neighbours[here]:
                path.pop()
                continue
            following = neighbours[here].pop()
            neighbours[following].remove(here)
            if following in path:
                # Holes that touch at a vertex come apart here: each return to a vertex ends a loop.
                first = path.index(following)
                loop = path[first:]
                del path[first + 1 :]
                forward = (loop[0], loop[1]) in directed
                loops.append(np.array(loop if forward else loop[::-1], dtype=np.int64))
            else:
                path.append(following)
    return loops


def _oriented(
    points: FloatArray, faces: IntArray, name: str, repairs: list[str], warnings: list[str]
) -> tuple[IntArray, bool]:
    """Consistent winding within each body, and every body outward; and whether one lies within another.

    Cavities are refused.
    """
    if not Edges(faces).consistent:
        import trimesh  # noqa: PLC0415

        mesh = trimesh.Trimesh(points, faces, process=False)
        trimesh.repair.fix_winding(mesh)
        faces = np.asarray(mesh.faces, dtype=np.int64)
        if not Edges(faces).consistent:
            raise InputError(f"{name}: the surface has no inside and outside (like a Klein bottle); repair it.")
        repairs.append("made the winding of the triangles consistent.")
    body = bodies(len(points), faces)
    parts = [faces[body == i] for i in range(int(body.max()) + 1)]
    inward = [signed_volume(points, part) < 0 for part in parts]
    result = faces.copy()
    outer = len(parts)
    for i, part in enumerate(parts):
        around = [
            j
            for j, other in enumerate(parts)
            if j != i
            and _box_within(points[part], points[other])
            and abs(winding_number(points, other, points[part[0, :1]])[0]) > 0.5
        ]
        if any(inward[i] != inward[j] for j in around):
            raise InputError(
                f"{name}: there is a cavity inside the body, and cavities are not supported; remove the inner surface."
            )
        if around:
            outer -= 1
            warnings.append(f"body {i + 1} of {len(parts)} lies inside another and changes nothing.")
        if inward[i]:
            result[body == i] = part[:, ::-1]
            repairs.append("turned an inside-out surface outward.")
    if outer > 1:
        warnings.append(f"the surface consists of {outer} bodies; light does not pass between those that are apart.")
    return result, outer < len(parts)


def _box_within(inner: FloatArray, outer: FloatArray) -> bool:
    return bool(
        (inner.min(axis=(0, 1)) >= outer.min(axis=(0, 1))).all()
        and (inner.max(axis=(0, 1)) <= outer.max(axis=(0, 1))).all()
    )


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


def count_self_intersections(points: FloatArray, faces: IntArray) -> int:
    """How many triangles are pierced by an edge of a triangle that shares no vertex with that edge.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
        A closed surface, consistently oriented.
    """
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    heights = np.einsum("ij,ij->i", normals, corners[:, 0])
    folded: BoolArray = np.asarray((~_flat_fans(points, faces, normals)[faces]).any(axis=1))
    pierced = np.zeros(len(faces), dtype=bool)
    for i, j in overlapping_boxes(corners.min(axis=1), corners.max(axis=1)):
        shared = np.zeros(len(i), dtype=np.int8)
        for a in faces.T:
            for b in faces.T:
                shared += a[i] == b[j]
        # Neighbours overlap as boxes, and round a flat fan they meet at their vertex only.
        suspect = (shared == 0) | ((shared == 1) & folded[i] & folded[j])
        first, second = i[suspect], j[suspect]
        for face, other in ((first, second), (second, first)):
            side = np.einsum("ij,ikj->ik", normals[face], corners[other]) - heights[face][:, None]
            for a, b in ((0, 1), (1, 2), (2, 0)):
                start, end = faces[other, a], faces[other, b]
                # Of the two triangles at an edge one walks it up the vertex numbers: once is enough.
                crosses = (start < end) & (side[:, a] * side[:, b] < 0)
                target, start, end = face[crosses], start[crosses], end[crosses]
                apart = (faces[target] != start[:, None]).all(axis=1) & (faces[target] != end[:, None]).all(axis=1)
                target, start, end = target[apart], points[start[apart]], points[end[apart]]
                t, _ = cross_segments(start, end - start, corners[target], slack=1e-9)
                # An edge that ends on a triangle touches it; one that passes through its rim crosses the surface.
                pierced[target[(t > TOUCH) & (t < 1.0 - TOUCH)]] = True
    return int(pierced.sum())


def _flat_fans(points: FloatArray, faces: IntArray, normals: FloatArray) -> BoolArray:
    """Whether the triangles round each vertex project onto its tangent plane without overlap, (n,).

    Then no two of them meet elsewhere (Volino & Magnenat-Thalmann 1994). They do if all face the same side of
    the plane and go round the vertex once; `normals` need no length.
    """
    axis = np.empty_like(points)
    for k in range(3):
        axis[:, k] = np.bincount(faces.ravel(), np.repeat(normals[:, k], 3), minlength=len(points))
    length = np.linalg.norm(axis, axis=1)
    axis /= np.where(length > 0, length, 1.0)[:, None]
    turn = np.zeros(len(points))
    flat = length > 0
    for k in range(3):
        vertex = faces[:, k]
        up = axis[vertex]
        u, v = (points[faces[:, (k + i) % 3]] - points[vertex] for i in (1, 2))
        facing = np.einsum("ij,ij->i", normals, up)
        flat[vertex[facing <= 0]] = False
        along = np.einsum("ij,ij->i", u, v) - np.einsum("ij,ij->i", u, up) * np.einsum("ij,ij->i", v, up)
        turn += np.bincount(vertex, np.arctan2(facing, along), minlength=len(points))
    return np.asarray(flat & (np.abs(turn - 2.0 * np.pi) < 1e-6))
