"""`Surface`: the closed triangle mesh that bounds a body."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import count, size
from tetlux.meshing.html import surface_html
from tetlux.meshing.search.closest import ClosestPoint
from tetlux.meshing.search.proximity import cross_segments, winding_number
from tetlux.meshing.search.rays import RayCaster
from tetlux.meshing.surface.creases import Creases
from tetlux.meshing.surface.curved import CurvedPatches
from tetlux.meshing.surface.groups import TriangleGroups, cut_long_triangles, group_triangles
from tetlux.meshing.surface.solids import Shape, lies_on
from tetlux.meshing.surface.triangles import barycentric_on_triangles, signed_volume, triangle_areas

# The bulge of a surface of more triangles is taken as 0, since it falls with their number.
MOST_TRIANGLES_THAT_BULGE = 20_000
# Of a surface of more triangles, the smooth area is computed for about so many of them, and the others are taken to be
# stretched as these are on average: on a scan of 100,000 triangles single ones differ by .8 %, the total by .001 %.
MOST_STRETCHED = 30_000
MILLIMETRES = {"nm": 1e-6, "um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
UNITS = tuple(MILLIMETRES)


@dataclass(frozen=True, eq=False)
class Surface:
    """A closed, outward oriented triangle mesh.

    `read_surface`, the built-in shapes and `surface_from_arrays` make and check surfaces.

    Parameters
    ----------
    points : (n, 3) ndarray
        Vertices, in `unit`.
    faces : (m, 3) ndarray
        Corners of the triangles, anticlockwise seen from outside.
    unit : str
        The unit of length; coefficients are in 1/unit.
    name : str
        For messages.
    repairs, warnings : tuple of str
        Sentences: what was repaired when the surface was read, and what the user should know about it.
    overlaps : bool
        Whether it crosses itself or contains one body inside another, so that `volume` and `area` count parts of
        the body more than once.
    crease_angle : float
        Triangles that bend by less than this at their common edge, in degrees, belong to one smooth surface, which
        `on_curve` evaluates; 0 means flat triangles.
    shape : Sphere, Box, Slab, Cylinder or Torus, optional
        The built-in shape that the triangles were made from, if any. Copies (``replace``) keep it while all vertices
        lie on it.

    Examples
    --------
    >>> import numpy as np
    >>> from tetlux.meshing import box
    >>> cube = box((2.0, 2.0, 2.0))
    >>> round(cube.area, 6), round(cube.volume, 6)
    (24.0, 8.0)
    >>> cube.contains(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]])).tolist()
    [True, False]
    >>> points, faces = cube.closest(np.array([[0.5, 0.0, 3.0]]))
    >>> points.tolist()
    [[0.5, 0.0, 1.0]]
    """

    points: FloatArray
    faces: IntArray
    unit: str = "mm"
    name: str = "surface"
    repairs: tuple[str, ...] = field(default=())
    warnings: tuple[str, ...] = field(default=())
    overlaps: bool = False
    crease_angle: float = 30.0
    shape: Shape | None = None

    def __post_init__(self) -> None:
        # A copy with moved vertices no longer has the shape.
        if self.shape is not None and not lies_on(self.points, self.shape):
            object.__setattr__(self, "shape", None)

    @cached_property
    def normals(self) -> FloatArray:
        """Outward unit normals of the faces, (m, 3)."""
        return triangle_areas(self.points, self.faces)[0]

    @cached_property
    def area(self) -> float:
        """Area, unit²."""
        return float(triangle_areas(self.points, self.faces)[1].sum())

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, unit³."""
        return signed_volume(self.points, self.faces)

    @cached_property
    def diagonal(self) -> float:
        """Diagonal of the bounding box, unit."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @property
    def extent(self) -> str:
        """The ranges of the coordinates with their unit, as text."""
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        return ", ".join(f"{axis} {a:.4g}..{b:.4g}" for axis, a, b in zip("xyz", low, high, strict=True)) + (
            f" {self.unit}"
        )

    @cached_property
    def _closest(self) -> ClosestPoint:
        return ClosestPoint(self.points, self.faces)

    def closest(self, queries: FloatArray) -> tuple[FloatArray, IntArray]:
        """Closest points of the triangles to query points.

        Parameters
        ----------
        queries : (q, 3) ndarray
            Unit.

        Returns
        -------
        points : (q, 3) ndarray
            Unit.
        faces : (q,) ndarray
            The triangle of each closest point.
        """
        return self._closest(queries)

    def near(self, queries: FloatArray, distance: float) -> BoolArray:
        """Whether each query point (q, 3) lies within a distance, unit, of the triangles, (q,)."""
        return self._closest.within(queries, distance)

    @cached_property
    def _patches(self) -> CurvedPatches:
        return CurvedPatches(self.points, self.faces, self.normals, self.crease_angle)

    def on_curve(self, faces: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The smooth surface over points of the triangles.

        Parameters
        ----------
        faces : (q,) ndarray
            Triangles.
        points : (q, 3) ndarray
            A point on each of these triangles, unit.

        Returns
        -------
        points : (q, 3) ndarray
            Points of the smooth surface with the same barycentric coordinates, unit.
        normals : (q, 3) ndarray
            Outward unit normals of the smooth surface there.
        """
        if self.crease_angle <= 0 or len(faces) == 0:
            return points, self.normals[faces]
        curved, normals, _ = self._patches(faces, barycentric_on_triangles(points, self.points[self.faces[faces]]))
        # Exact where there is nothing to bend.
        flat = self._patches.are_flat[faces]
        curved[flat], normals[flat] = points[flat], self.normals[faces[flat]]
        return curved, normals

    @cached_property
    def creases(self) -> Creases | None:
        """The edges that bend by more than `crease_angle`, all if it is 0; None if there are none."""
        ends = self._patches.creases
        return Creases(ends, self.crease_angle) if len(ends) else None

    @cached_property
    def groups(self) -> TriangleGroups:
        """Groups of neighbouring triangles."""
        faces, corners = cut_long_triangles(self.points[self.faces])
        sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return group_triangles(faces, corners, 0.5 * np.linalg.norm(sides, axis=1) * self._stretch[faces])

    @cached_property
    def _stretch(self) -> FloatArray:
        """The area of the smooth surface over each triangle, divided by that of the triangle, (m,)."""
        if self.crease_angle <= 0:
            return np.ones(len(self.faces))
        some = np.arange(0, len(self.faces), -(-len(self.faces) // MOST_STRETCHED))
        flat = triangle_areas(self.points, self.faces[some])[1]
        # The middles of the sides integrate quadratics exactly.
        middles = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])
        curved = np.sum([self._patches(some, np.tile(middle, (len(some), 1)))[2] for middle in middles], axis=0) / 3.0
        if len(some) < len(self.faces):
            return np.full(len(self.faces), float(curved.sum() / flat.sum()))
        return np.asarray(np.divide(curved, flat, out=np.ones(len(flat)), where=flat > 0))

    @cached_property
    def bulge(self) -> float:
        """Approximate excess of the smooth surface's volume over that of the triangles, as a share.

        It is taken as 0 for surfaces of many triangles.
        """
        if self.crease_angle <= 0 or len(self.faces) > MOST_TRIANGLES_THAT_BULGE:
            return 0.0
        heights = np.einsum("fij,fj->f", self._patches.bends(), self.normals) / 3.0
        return float(heights @ triangle_areas(self.points, self.faces)[1]) / self.volume

    def project(self, queries: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Project query points on the smooth surface.

        Parameters
        ----------
        queries : (q, 3) ndarray
            Unit.

        Returns
        -------
        points : (q, 3) ndarray
            Points of the smooth surface over the closest points of the triangles, unit.
        normals : (q, 3) ndarray
            Outward unit normals of the smooth surface there.
        """
        nearest, faces = self.closest(queries)
        return self.on_curve(faces, nearest)

    def distances(self, queries: FloatArray) -> FloatArray:
        """Distances of query points (q, 3) from their projections on the smooth surface, (q,), unit."""
        return np.asarray(np.linalg.norm(self.project(queries)[0] - queries, axis=1))

    def contains(self, queries: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Whether each query point (q, 3) lies inside, (q,), by the winding number."""
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        inside = np.asarray(((queries >= low) & (queries <= high)).all(axis=1))
        inside[inside] = winding_number(self.points, self.faces, queries[inside]) > 0.5
        return inside

    def crossings(self, origin: FloatArray, direction: FloatArray) -> tuple[FloatArray, IntArray]:
        """Intersections of a ray with the surface.

        Parameters
        ----------
        origin : (3,) ndarray
            Unit.
        direction : (3,) ndarray
            Unit vector.

        Returns
        -------
        distances : (k,) ndarray
            Along `direction`, ascending, all positive, unit.
        faces : (k,) ndarray
            The triangle at each.
        """
        starts, ways = (np.broadcast_to(each, (len(self.faces), 3)) for each in (origin, direction))
        # The slack keeps a ray through an edge from passing between two triangles.
        distances, _ = cross_segments(starts, ways, self.points[self.faces], slack=1e-10)
        faces = np.flatnonzero(distances > 1e-9 * self.diagonal)
        order = np.argsort(distances[faces], kind="stable")
        return distances[faces[order]], faces[order]

    @cached_property
    def rays(self) -> RayCaster:
        """A ray caster for the triangles."""
        return RayCaster(self.points, self.faces)

    def exit(self, origin: FloatArray, direction: FloatArray) -> tuple[float, int] | None:
        """The point where a ray from inside leaves the body.

        Parts of the surface inside the body (overlaps, inner shells) do not count.

        Parameters
        ----------
        origin : (3,) ndarray
            A point inside, unit.
        direction : (3,) ndarray
            Unit vector.

        Returns
        -------
        tuple of float and int, or None
            Distance along `direction`, unit, and the triangle; None if the ray meets no surface.
        """
        distances, faces = self.crossings(origin, direction)
        outward = np.sign(self.normals[faces] @ direction)
        # A ray through an edge meets two triangles at one distance; they count once.
        same = np.zeros(len(faces), dtype=bool)
        same[1:] = (np.diff(distances) < 1e-9 * self.diagonal) & (outward[1:] == outward[:-1])
        distances, faces, outward = distances[~same], faces[~same], outward[~same]
        # Nesting depth after each crossing; it is 0 after the last.
        depth_after = outward[::-1].cumsum()[::-1] - outward
        leaves = np.flatnonzero((outward > 0) & (depth_after <= 0))
        if len(leaves) == 0:
            return None
        return float(distances[leaves[0]]), int(faces[leaves[0]])

    def __repr__(self) -> str:
        return (
            f'Surface("{self.name}", {count(len(self.faces), "triangle")}, {size(self.points, self.unit)}, '
            f"volume {self.volume:.3g} {self.unit}³)"
        )

    _repr_html_ = surface_html
