"""Built-in shapes: sphere, box, slab, cylinder, torus."""

import math
from dataclasses import replace

import numpy as np

from tetlux.meshing.arrays import FloatArray, IntArray, Vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.repair.pipeline import LONGEST, surface_from_arrays
from tetlux.meshing.surface.solids import Box, Cylinder, Shape, Slab, Sphere, Torus
from tetlux.meshing.surface.subdivide import number_triangle_edges
from tetlux.meshing.surface.surface import UNITS, Surface
from tetlux.meshing.surface.triangles import longest_sides, triangle_areas

BOX_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
BOX_FACES = np.array(
    [
        [1, 3, 0], [4, 1, 0], [0, 3, 2], [2, 4, 0], [1, 7, 3], [5, 1, 4],
        [5, 7, 1], [3, 7, 2], [6, 4, 2], [2, 7, 6], [6, 5, 4], [7, 5, 6],
    ]
)  # fmt: skip
# Three golden rectangles of unit diagonals, each across the next.
_SHORT, _LONG = np.sqrt((5.0 - np.sqrt(5.0)) / 10.0), np.sqrt((5.0 + np.sqrt(5.0)) / 10.0)
_RECTANGLE = np.array([[x, y, 0.0] for y in (_LONG, -_LONG) for x in (-_SHORT, _SHORT)])
ICOSAHEDRON_CORNERS = np.vstack([np.roll(_RECTANGLE, shift, axis=1) for shift in (0, 1, 2)])
ICOSAHEDRON_FACES = np.array(
    [
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6],
        [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10],
        [8, 6, 7], [9, 8, 1],
    ]
)  # fmt: skip

# A shape is not checked like a surface of unknown origin if its sides are in this range, in any unit, its flattest is
# more than a share of its longest, it is no farther from the origin than so many of its sides, and the area of each of
# its triangles is more than a share of the square of its longest side.
ORDINARY, FLATTEST, FARTHEST, NARROWEST = (1e-9, 1e9), 0.01, 1e3, 0.01


def _check_lengths(**lengths: float) -> None:
    for name, value in lengths.items():
        if not math.isfinite(value) or value <= 0:
            raise InputError(f"{name} is {value:g}; give a length greater than 0.")
        if not 1 / LONGEST <= value <= LONGEST:
            raise InputError(f"{name} is {value:g}, absurdly small or large; check the unit.")


def sphere(radius: float, *, center: Vector = (0.0, 0.0, 0.0), subdivisions: int = 4, unit: str = "mm") -> Surface:
    """Make a sphere: an icosahedron subdivided several times, with its vertices on the sphere.

    Parameters
    ----------
    radius : float
        Radius of the sphere, unit.
    center : (3,) floats
        Coordinates of the centre, unit.
    subdivisions : int
        From 1 to 7; each splits every triangle into four. Four give 5,120 triangles, whose volume is 0.3 % too small.
    unit : str
        Unit of length: nm, um, mm, cm, m or in.

    Returns
    -------
    Surface
        With ``20 * 4**subdivisions`` triangles.

    Raises
    ------
    InputError
        If the radius is not positive, or `subdivisions` is not from 1 to 7.

    Examples
    --------
    >>> sphere(10.0)
    Surface("sphere", 5,120 triangles, 20 x 20 x 20 mm, volume 4.18e+03 mm³)
    """
    _check_lengths(radius=radius)
    if not 1 <= subdivisions <= 7:
        raise InputError(f"subdivisions is {subdivisions}; give 1 to 7.")
    points, faces = _icosphere(subdivisions)
    return _make_surface(Sphere(radius, _to_vector(center)), radius * points + np.asarray(center), faces, unit)


def _icosphere(subdivisions: int) -> tuple[FloatArray, IntArray]:
    """An icosahedron whose triangles are split into four several times, with its points on the unit sphere."""
    points, faces = ICOSAHEDRON_CORNERS, ICOSAHEDRON_FACES
    for _ in range(subdivisions):
        ends, edge = number_triangle_edges(faces)
        (a, b, c), (ab, bc, ca) = faces.T, edge.T + len(points)
        faces = np.vstack([np.column_stack(part) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        points = np.vstack([points, points[ends].sum(axis=1)])
        points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points, faces


def box(size: Vector, *, center: Vector = (0.0, 0.0, 0.0), unit: str = "mm") -> Surface:
    """Make a box with edges along the axes.

    Parameters
    ----------
    size : (3,) floats
        Edge lengths along x, y and z, unit.
    center : (3,) floats
        Coordinates of the centre, unit.
    unit : str
        Unit of length: nm, um, mm, cm, m or in.

    Returns
    -------
    Surface
        With 12 triangles.

    Raises
    ------
    InputError
        If a length is not positive.

    Examples
    --------
    >>> box((10.0, 20.0, 5.0))
    Surface("box", 12 triangles, 10 x 20 x 5 mm, volume 1e+03 mm³)
    """
    for axis, length in zip("xyz", size, strict=True):
        _check_lengths(**{f"size along {axis}": length})
    points = BOX_CORNERS * size + np.asarray(center)
    return _make_surface(Box(_to_vector(size), _to_vector(center)), points, BOX_FACES, unit)


def slab(width: float, depth: float, *, unit: str = "mm") -> Surface:
    """Make a square plate whose upper face is z = 0 and whose lower face is z = -depth, centred on the z axis.

    Parameters
    ----------
    width : float
        Edge length of both faces, unit.
    depth : float
        Distance between the faces, unit.
    unit : str
        Unit of length: nm, um, mm, cm, m or in.

    Returns
    -------
    Surface
        With 12 triangles.

    Raises
    ------
    InputError
        If a length is not positive.

    Examples
    --------
    >>> slab(60.0, 10.0).extent
    'x -30..30, y -30..30, z -10..0 mm'
    """
    _check_lengths(width=width, depth=depth)
    plate = box((width, width, depth), center=(0.0, 0.0, -0.5 * depth), unit=unit)
    return replace(plate, name="slab", shape=Slab(width, depth))


def cylinder(
    radius: float, height: float, *, center: Vector = (0.0, 0.0, 0.0), segments: int = 64, unit: str = "mm"
) -> Surface:
    """Make a cylinder along z with flat ends.

    Parameters
    ----------
    radius, height : float
        Radius, and length along z, unit.
    center : (3,) floats
        Coordinates of the centre, unit.
    segments : int
        Edges around each end, at least 8; the number of rows along z makes the faces nearly square.
    unit : str
        Unit of length: nm, um, mm, cm, m or in.

    Returns
    -------
    Surface

    Raises
    ------
    InputError
        If a length is not positive, or `segments` is below 8.

    Examples
    --------
    >>> cylinder(5.0, 20.0)
    Surface("cylinder", 5,376 triangles, 10 x 10 x 20 mm, volume 1.57e+03 mm³)
    """
    _check_lengths(radius=radius, height=height)
    if segments < 8:
        raise InputError(f"segments is {segments}; give 8 or more.")
    angle = 2.0 * np.pi * np.arange(segments) / segments
    ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    # Rows are about as tall as segments are wide, since fTetWild is slow on elongated triangles.
    rows = max(1, round(height / (2.0 * np.pi * radius / segments)))
    levels = np.linspace(-0.5 * height, 0.5 * height, rows + 1)
    points = np.vstack(
        [np.column_stack([ring, np.full(segments, z)]) for z in levels]
        + [np.array([[0.0, 0.0, levels[0]], [0.0, 0.0, levels[-1]]])]
    )
    faces = [_grid_faces(rows, segments, closed_rows=False)]
    start = np.arange(segments)
    end = (start + 1) % segments
    bottom, top = len(points) - 2, len(points) - 1
    last = rows * segments
    faces.append(np.column_stack([end, start, np.full(segments, bottom)]))
    faces.append(np.column_stack([start + last, end + last, np.full(segments, top)]))
    shape = Cylinder(radius, height, _to_vector(center))
    return _make_surface(shape, points + np.asarray(center), np.vstack(faces), unit)


def torus(
    major: float, minor: float, *, center: Vector = (0.0, 0.0, 0.0), segments: int = 96, unit: str = "mm"
) -> Surface:
    """Make a torus around a line along z.

    Parameters
    ----------
    major : float
        Distance from the axis to the centre of the tube, unit.
    minor : float
        Radius of the tube, less than `major`, unit.
    center : (3,) floats
        Coordinates of the centre, unit.
    segments : int
        Edges along the ring, at least 12; the number of rows around the tube makes the faces nearly square.
    unit : str
        Unit of length: nm, um, mm, cm, m or in.

    Returns
    -------
    Surface

    Raises
    ------
    InputError
        If a length is not positive, `minor` is not less than `major`, or `segments` is below 12.

    Examples
    --------
    >>> torus(10.0, 3.0)
    Surface("torus", 5,568 triangles, 26 x 26 x 5.99 mm, volume 1.76e+03 mm³)
    """
    _check_lengths(major=major, minor=minor)
    if minor >= major:
        raise InputError(f"minor is {minor:g} and major {major:g}; the tube's radius must be the smaller one.")
    if segments < 12:
        raise InputError(f"segments is {segments}; give 12 or more.")
    rows = max(12, round(segments * minor / major))
    u = 2.0 * np.pi * np.arange(segments) / segments
    v = 2.0 * np.pi * np.arange(rows) / rows
    uu, vv = np.meshgrid(u, v, indexing="xy")
    distance = major + minor * np.cos(vv)
    points = np.column_stack(
        [(distance * np.cos(uu)).ravel(), (distance * np.sin(uu)).ravel(), (minor * np.sin(vv)).ravel()]
    )
    faces = _grid_faces(rows, segments, closed_rows=True)
    return _make_surface(Torus(major, minor, _to_vector(center)), points + np.asarray(center), faces, unit)


def _make_surface(shape: Shape, points: FloatArray, faces: IntArray, unit: str) -> Surface:
    """Make a checked surface from a shape's triangles; its `shape` is that shape."""
    name = type(shape).__name__.lower()
    if unit in UNITS and _is_regular(points, faces):
        return Surface(np.array(points, dtype=np.float64), np.array(faces, dtype=np.int64), unit, name, shape=shape)
    return replace(surface_from_arrays(points, faces, unit=unit, name=name), shape=shape)


def _is_regular(points: FloatArray, faces: IntArray) -> bool:
    """Whether triangles of a shape are so even, and so near to the origin, that a check of them finds nothing."""
    sides, far = np.ptp(points, axis=0), np.abs(points).max()
    if sides.min() < max(ORDINARY[0], FLATTEST * sides.max(), far / FARTHEST) or far > ORDINARY[1]:
        return False
    longest = longest_sides(points[faces])
    return bool((triangle_areas(points, faces)[1] > NARROWEST * longest**2).all())


def _to_vector(values: Vector) -> Vector:
    """Convert three numbers to floats."""
    x, y, z = map(float, values)
    return x, y, z


def _grid_faces(rows: int, columns: int, *, closed_rows: bool) -> IntArray:
    """Split each cell of a grid into two triangles; its columns are periodic, its rows only if `closed_rows`."""
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    up = (i + 1) % rows if closed_rows else i + 1
    right = (j + 1) % columns
    a, b = i * columns + j, i * columns + right
    c, d = up * columns + right, up * columns + j
    return np.vstack(
        [
            np.column_stack([a.ravel(), b.ravel(), c.ravel()]),
            np.column_stack([a.ravel(), c.ravel(), d.ravel()]),
        ]
    ).astype(np.int64)
