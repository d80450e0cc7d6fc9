"""The curved surface that triangles approximate: a cubic patch over each triangle of a smooth part.

The triangles of a round body lie inside it by ``h²/8R``, for edges h and radius R, which matters for light that enters
one mean free path deep: on a sphere of 5,120 triangles and a radius of ten mean free paths, the exitance of flat
triangles is off by 0.4 %. Patches through the same vertices with the same normals (PN triangles: Vlachos, Peters, Boyd
& Mitchell 2001) remove this error. Edges that bend by more than the surface's `crease_angle` stay straight and sharp.
"""

from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.host.blocks import run_in_blocks
from tetlux.meshing.host.corners import cross, dot
from tetlux.meshing.surface.subdivide import NEXT_CORNER

# Corner i of a triangle is preceded by corner PREVIOUS_CORNER[i].
PREVIOUS_CORNER = np.array([2, 0, 1])
# How far a flat patch may be off its triangle, relative to a side.
ROUNDING = 1e-13
# Triangles of a surface whose patches are kept, at 240 bytes each.
MOST_KEPT = 100_000


class CurvedPatches:
    """Cubic patches over the triangles of a surface.

    Parameters
    ----------
    points : (n, 3) ndarray
    faces : (m, 3) ndarray
    normals : (m, 3) ndarray
        Outward unit normals of the faces.
    crease_angle : float
        Largest angle, degrees, between two triangles of one smooth surface at their common edge.
    """

    def __init__(self, points: FloatArray, faces: IntArray, normals: FloatArray, crease_angle: float) -> None:
        self._points, self._faces, self._normals = points, faces, normals
        # The tolerance makes all edges of a regular twelve-sided prism (30 degrees) equal despite rounding.
        self._least_cosine = np.cos(np.radians(crease_angle)) + 1e-6

    def __call__(self, faces: IntArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points (q, 3), unit normals (q, 3) and areas (q,) at barycentric weights (q, 3) of faces (q,).

        The area is that of the patch if its metric were the same throughout.
        """
        points, normals, areas = np.empty((len(faces), 3)), np.empty((len(faces), 3)), np.empty(len(faces))
        if len(self._faces) > MOST_KEPT:
            distinct, index = np.unique(faces, return_inverse=True)
            control = self._control_points(distinct)
        else:
            index, control = faces, self._control

        def work(block: slice) -> None:
            own = control[:, :, index[block]]
            position, first, second = (np.einsum("kq,kjq->jq", basis, own) for basis in _bases(weights[block]))
            normal, flat = cross(first, second), self._normals[faces[block]]
            length = np.sqrt(dot(normal, normal))
            # Where a patch folds over its triangle, use the triangle's normal.
            folded = dot(normal, flat.T) <= 0.5 * length
            unit = normal / np.where(length > 0, length, 1.0)
            points[block], normals[block] = position.T, np.where(folded[:, None], flat, unit.T)
            areas[block] = 0.5 * length

        run_in_blocks(work, len(faces))
        return points, normals, areas

    @cached_property
    def _control(self) -> FloatArray:
        """`_control_points` of all faces."""
        return self._control_points(np.arange(len(self._faces)))

    def _control_points(self, faces: IntArray) -> FloatArray:
        """Control points of faces (f,) in the order of `_bases`, (10, 3, f)."""
        corners = self._points[self._faces[faces]]
        normals = self._corner_normals[faces]
        smooth = self._smooth_sides[faces]
        along = np.empty((len(faces), 2, 3, 3))
        for side, (other, edge) in enumerate(((NEXT_CORNER, np.arange(3)), (PREVIOUS_CORNER, PREVIOUS_CORNER))):
            reach = corners[:, other] - corners
            height = np.einsum("fij,fij->fi", reach, normals) * smooth[:, edge]
            along[:, side] = corners + (reach - height[:, :, None] * normals) / 3.0
        edges = along.mean(axis=(1, 2))
        middle = edges + 0.5 * (edges - corners.mean(axis=1))
        every = np.concatenate([corners, along[:, 0], along[:, 1], middle[:, None]], axis=1)
        return np.ascontiguousarray(every.transpose(1, 2, 0))

    @cached_property
    def are_flat(self) -> BoolArray:
        """Whether the patch over each face is the face itself, within rounding, (m,)."""
        sides = np.abs(self._points[self._faces] - self._points[self._faces[:, NEXT_CORNER]]).max(axis=(1, 2))
        return np.asarray(np.abs(self.bends()).max(axis=(1, 2)) <= ROUNDING * sides)

    def bends(self) -> FloatArray:
        """How far the middle of each side of the faces, from a corner to the next, is off the straight one, (m, 3, 3).

        ``-(h n + h' n')/8`` by the normals at its ends and how far each end is above the other's tangential plane.
        """
        corners, normals = self._points[self._faces], self._corner_normals
        reach = (corners[:, NEXT_CORNER] - corners) * self._smooth_sides[:, :, None]
        ends = normals[:, NEXT_CORNER]
        heights, heights_at_ends = (np.einsum("fij,fij->fi", reach, each)[:, :, None] for each in (normals, ends))
        return np.asarray((heights_at_ends * ends - heights * normals) / 8.0)

    @cached_property
    def _corner_normals(self) -> FloatArray:
        """Unit normals at the corners of the faces, (m, 3, 3), common to faces at a vertex that no crease separates.

        Weighted as Max (1999) does, which is exact for vertices on a sphere.
        """
        count = len(self._faces)
        first, second = self._smooth_edges
        # The two sides of an edge run in opposite directions, so the start of one is the end of the other.
        after_first, after_second = (3 * (edge // 3) + NEXT_CORNER[edge % 3] for edge in (first, second))
        ends = np.concatenate([first, after_first]), np.concatenate([after_second, second])
        graph = coo_array((np.ones(len(ends[0]), dtype=bool), ends), shape=(3 * count, 3 * count))
        _, fan = connected_components(graph, directed=False)
        corners = self._points[self._faces]
        a, b = corners[:, NEXT_CORNER] - corners, corners[:, PREVIOUS_CORNER] - corners
        size = np.einsum("fij,fij->fi", a, a) * np.einsum("fij,fij->fi", b, b)
        part = (np.cross(a, b) / np.where(size > 0, size, 1.0)[:, :, None]).reshape(-1, 3)
        total = np.column_stack([np.bincount(fan, part[:, i]) for i in range(3)])[fan]
        length = np.linalg.norm(total, axis=1, keepdims=True)
        flat = np.repeat(self._normals, 3, axis=0)
        return np.where(length > 0, total / np.where(length > 0, length, 1.0), flat).reshape(-1, 3, 3)

    @cached_property
    def _smooth_sides(self) -> BoolArray:
        """Whether the edge from each corner to the next bends less than the crease angle, (m, 3)."""
        smooth = np.zeros(3 * len(self._faces), dtype=bool)
        smooth[np.concatenate(self._smooth_edges)] = True
        return smooth.reshape(-1, 3)

    @cached_property
    def creases(self) -> FloatArray:
        """The ends of the edges that bend by more than the crease angle, (c, 2, 3)."""
        faces, places = np.nonzero(~self._smooth_sides)
        corners = self._faces[faces[:, None], np.column_stack([places, NEXT_CORNER[places]])]
        # Both faces at an edge have it, in opposite directions.
        return np.asarray(self._points[corners[corners[:, 0] < corners[:, 1]]])

    @cached_property
    def _smooth_edges(self) -> tuple[IntArray, IntArray]:
        """Edges that bend less than the crease angle, by the corners (3 face + place) where their two sides start."""
        tail, head = self._faces, self._faces[:, NEXT_CORNER]
        key = (np.minimum(tail, head) * np.int64(len(self._points)) + np.maximum(tail, head)).ravel()
        order = np.argsort(key, kind="stable")
        same = key[order][1:] == key[order][:-1]
        first, second = order[:-1][same], order[1:][same]
        cosine = np.einsum("ij,ij->i", self._normals[first // 3], self._normals[second // 3])
        # Faces that traverse their edge in the same direction are not neighbours on one surface.
        smooth = (cosine >= self._least_cosine) & (tail.ravel()[first] != tail.ravel()[second])
        return first[smooth], second[smooth]


def _bases(weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bernstein polynomials at barycentric weights (q, 3), and their slopes towards corners 1 and 2, three (10, q).

    They are of the corners, of the points a third of the way from each corner to the next and to the previous one, and
    of the middle.
    """
    a, b, c = weights.T
    aa, bb, cc = 3.0 * a * a, 3.0 * b * b, 3.0 * c * c
    ab, bc, ca = 6.0 * a * b, 6.0 * b * c, 6.0 * c * a
    zero = np.zeros_like(a)
    value = np.array([a * aa / 3.0, b * bb / 3.0, c * cc / 3.0, aa * b, bb * c, cc * a, aa * c, bb * a, cc * b, ab * c])
    by_a = np.array([aa, zero, zero, ab, zero, cc, ca, bb, zero, bc])
    by_b = np.array([zero, bb, zero, aa, bc, zero, zero, ab, cc, ca])
    by_c = np.array([zero, zero, cc, zero, bb, ca, aa, zero, bc, ab])
    return value, by_b - by_a, by_c - by_a
