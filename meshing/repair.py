"""What is wrong with a triangle mesh, what can be mended safely, and words for both."""

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.proximity import ClosestPoint, cross_segments, winding_number
from tetlux.meshing.surface import UNITS, Surface, signed_volume, triangle_areas

# Vertices nearer than this share of the diagonal are one: text formats round at about 1e-7.
MERGE_TOLERANCE = 1e-7
# A hole wider than this share of the diagonal is a missing part, and closing it would invent a shape.
LARGEST_HOLE = 0.05
# A body whose thickness, 2 V/A, is below this share of its diagonal has no inside.
FLAT = 1e-7
# In whatever unit.
LONGEST = 1e30


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
    used, triangles = np.unique(triangles, return_inverse=True)
    vertices, triangles = vertices[used], triangles.reshape(-1, 3)
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
    _, first, inverse = np.unique(
        np.round((points - points.min(axis=0)) / cell), axis=0, return_index=True, return_inverse=True
    )
    if len(first) < len(points):
        # Formats that give every triangle vertices of its own are no flaw of the surface.
        if len(points) != 3 * len(faces):
            repairs.append(f"merged {len(points) - len(first)} vertices that coincide with another.")
        points, faces = points[first], inverse.reshape(-1)[faces]

    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    if not distinct.all():
        repairs.append(f"removed {int((~distinct).sum())} triangles without area.")
    faces = _single(faces[distinct], repairs)
    used, compact = np.unique(faces, return_inverse=True)
    return points[used], compact.reshape(faces.shape)


def _single(faces: IntArray, repairs: list[str]) -> IntArray:
    """One of triangles given twice; none of a pair back to back, which is a wall inside the body."""
    if len(faces) == 0:
        return faces
    order = np.argsort(faces, axis=1)
    ordered = np.take_along_axis(faces, order, axis=1)
    # A permutation of three is even if it is a rotation.
    even = (order[:, 1] - order[:, 0]) % 3 == 1
    _, first, inverse = np.unique(ordered, axis=0, return_index=True, return_inverse=True)
    facing = np.bincount(inverse.reshape(-1), np.where(even, 1, -1))
    keep = np.sort(first[facing != 0])
    if len(keep) < len(faces):
        repairs.append(f"removed {len(faces) - len(keep)} triangles given twice.")
    return np.asarray(faces[keep])


def _closed(
    points: FloatArray, faces: IntArray, name: str, repairs: list[str], warnings: list[str]
) -> tuple[FloatArray, IntArray]:
    """Small holes closed by a fan about their middle."""
    loops = boundary_loops(faces)
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
    _, counts = np.unique(np.sort(_directed_edges(faces), axis=1), axis=0, return_counts=True)
    if (counts % 2).any():
        raise InputError(
            f"{name}: the surface is open: {int((counts % 2).sum())} edges belong to an odd number of triangles; "
            "repair it in a mesh editor."
        )
    if (counts > 2).any():
        warnings.append(f"{int((counts > 2).sum())} edges are shared by more than two triangles (touching parts).")
    return points, faces


def _directed_edges(faces: IntArray) -> IntArray:
    return np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def boundary_loops(faces: IntArray) -> list[IntArray]:
    """The rims of holes: closed chains of vertices along edges that belong to one triangle only."""
    edges = _directed_edges(faces)
    _, inverse, counts = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    rim = [(a, b) for a, b in edges[counts[inverse.reshape(-1)] == 1].tolist()]
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
    if not _consistent(faces):
        import trimesh  # noqa: PLC0415

        mesh = trimesh.Trimesh(points, faces, process=False)
        trimesh.repair.fix_winding(mesh)
        faces = np.asarray(mesh.faces, dtype=np.int64)
        if not _consistent(faces):
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


def _consistent(faces: IntArray) -> bool:
    """Whether each edge between two triangles is walked once each way."""
    edges = _directed_edges(faces)
    _, inverse, counts = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    pairs = edges[counts[inverse.reshape(-1)] == 2]
    return len(np.unique(pairs, axis=0)) == len(pairs)


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
    """How many triangles are pierced by an edge of a triangle that shares no vertex with them."""
    edges = np.unique(np.sort(_directed_edges(faces), axis=1), axis=0)
    near = ClosestPoint(points, faces)
    candidates = [
        near.faces_near_segment(start, end)
        for start, end in zip(points[edges[:, 0]].tolist(), points[edges[:, 1]].tolist(), strict=True)
    ]
    edge = np.repeat(np.arange(len(edges)), [len(c) for c in candidates])
    face = np.fromiter((f for c in candidates for f in c), dtype=np.int64, count=len(edge))
    apart = (faces[face][:, :, None] != edges[edge][:, None, :]).all(axis=(1, 2))
    edge, face = edge[apart], face[apart]
    start = points[edges[edge, 0]]
    # An edge that ends on a triangle touches it; one that passes through its rim crosses the surface.
    margin = 1e-6
    t, _ = cross_segments(start, points[edges[edge, 1]] - start, points[faces[face]], slack=1e-9)
    return len(np.unique(face[(t > margin) & (t < 1.0 - margin)]))
