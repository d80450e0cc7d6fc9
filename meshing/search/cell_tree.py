"""Find the tetrahedra that straight paths cross, and those that contain points, for thousands at once."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.corners import dot, face_normals, run_on_corners
from tetlux.meshing.search.box_tree import BoxTree

# A path whose barycentric coordinates are above minus this lies inside the tetrahedron.
SLACK = 1e-9
# The same for single points: rounding in thin tetrahedra is of this size.
POINT_SLACK = 1e-6


@dataclass(frozen=True, eq=False)
class PathSegments:
    """Paths cut into segments, one per tetrahedron.

    The segments of a path cover it without overlap. Along a face or an edge, the segment belongs to the tetrahedron
    that the path enters first.

    Parameters
    ----------
    paths : (s,) ndarray
        The path of each segment.
    cells : (s,) ndarray
        The tetrahedron of each segment; -1 outside the mesh.
    enter, leave : (s,) ndarray
        Distances along the path at which the segment begins and ends, unit.
    weights, slopes : (s, 4) ndarray
        Barycentric coordinates at the beginning of the segment, and their derivatives along the path, 1/unit; 0 outside
        the mesh.
    """

    paths: IntArray
    cells: IntArray
    enter: FloatArray
    leave: FloatArray
    weights: FloatArray
    slopes: FloatArray

    __repr__ = one_line


class CellTree:
    """The tetrahedra of a mesh in a tree of boxes.

    Parameters
    ----------
    points : (n, 3) ndarray
    tetrahedra : (m, 4) ndarray
    """

    def __init__(self, points: FloatArray, tetrahedra: IntArray) -> None:
        self._coordinates = np.ascontiguousarray(points.T)
        self._tetrahedra = tetrahedra
        low, high = np.empty((2, 3, len(tetrahedra)))

        def fill(block: slice, corners: FloatArray) -> None:
            low[:, block], high[:, block] = corners.min(axis=0), corners.max(axis=0)

        run_on_corners(fill, points, tetrahedra)
        # Covers rounding of box centres and of intersections.
        margin = 16.0 * np.finfo(float).eps * np.abs(points).max()
        self._boxes = BoxTree(low - margin, high + margin)

    def cut(self, starts: FloatArray, directions: FloatArray, lengths: FloatArray) -> Iterator[PathSegments]:
        """Cut paths into segments, one per tetrahedron.

        Parameters
        ----------
        starts, directions, lengths : (p, 3), (p, 3), (p,) ndarray
            Directions are unit vectors.

        Yields
        ------
        PathSegments
            All segments of some of the paths.
        """
        for some, near, cells in self._near(starts, directions, lengths):
            base, slopes = self._lines(cells, starts[near], directions[near])
            # A path parallel to a face is on its inner side everywhere or nowhere.
            change = np.where(np.abs(slopes) < 1e-200, 1e-200, slopes)
            roots = -(base + SLACK) / change
            enter = np.where(change > 0, roots, -np.inf).max(axis=0).clip(min=0.0)
            leave = np.where(change < 0, roots, np.inf).min(axis=0).clip(max=lengths[near])
            hit = np.flatnonzero(leave > enter)
            # A segment of no length ends each path; gaps before it are outside the mesh.
            paths = np.concatenate([near[hit], np.arange(some.start, some.stop)])
            enter = np.concatenate([enter[hit], lengths[some]])
            leave = np.concatenate([leave[hit], lengths[some]])
            order, covered = _cover_paths(paths, enter, leave)
            paths, enter, leave = paths[order], enter[order], leave[order]
            inside, outside = np.flatnonzero(leave > np.maximum(enter, covered)), np.flatnonzero(enter > covered)
            chosen = hit[order[inside]]
            begin = np.maximum(enter, covered)[inside]
            weights = base[:, chosen] + begin * slopes[:, chosen]
            # Coordinates are huge at a start far from a small tetrahedron, and their sum has lost digits.
            weights[0] = 1.0 - weights[1:].sum(axis=0)
            none = np.zeros((len(outside), 4))
            yield PathSegments(
                np.concatenate([paths[inside], paths[outside]]),
                np.concatenate([cells[chosen], np.full(len(outside), -1)]),
                np.concatenate([begin, covered[outside]]),
                np.concatenate([leave[inside], enter[outside]]),
                np.concatenate([weights.T, none]),
                np.concatenate([slopes[:, chosen].T, none]),
            )

    def locate(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """The tetrahedron that contains each point.

        Parameters
        ----------
        points : (p, 3) ndarray

        Returns
        -------
        cells : (p,) ndarray
            The tetrahedron that the point is deepest in; -1 for points outside.
        weights : (p, 4) ndarray
            Barycentric coordinates; nan for points outside.
        """
        found, weights = np.full(len(points), -1), np.full((len(points), 4), np.nan)
        still = np.zeros_like(points)
        # A point is a path of no length.
        for _, paths, cells in self._near(points, still, np.zeros(len(points))):
            base, _ = self._lines(cells, points[paths], still[paths])
            inside = np.flatnonzero((base >= -POINT_SLACK).all(axis=0))
            # The deepest comes last and overwrites the others.
            inside = inside[np.argsort(base[:, inside].min(axis=0))]
            found[paths[inside]], weights[paths[inside]] = cells[inside], base[:, inside].T
        return found, weights

    def _near(
        self, starts: FloatArray, directions: FloatArray, lengths: FloatArray
    ) -> Iterator[tuple[slice, IntArray, IntArray]]:
        """Slices of paths, with the pairs (paths, cells) whose boxes intersect, in ascending order of paths."""
        # A path perpendicular to an axis is inside a box's interval on that axis everywhere or nowhere.
        per_length = 1.0 / np.where(np.abs(directions) < 1e-20, 1e-20, directions)

        def meets(paths: IntArray, boxes: FloatArray) -> BoolArray:
            start, inverse = starts[paths], per_length[paths]
            enter, leave = np.zeros((len(paths), 1)), lengths[paths, None]
            for axis in range(3):
                centre = (boxes[:, axis] - start[:, axis, None]) * inverse[:, axis, None]
                reach = boxes[:, 3 + axis] * np.abs(inverse[:, axis, None])
                enter, leave = np.maximum(enter, centre - reach), np.minimum(leave, centre + reach)
            return np.asarray(enter <= leave)

        return self._boxes.pairs(len(starts), meets)

    def _lines(self, cells: IntArray, starts: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Barycentric coordinates at the start of lines, and their derivatives along the lines.

        Parameters
        ----------
        cells : (c,) ndarray
        starts, directions : (c, 3) ndarray
            One line per tetrahedron.

        Returns
        -------
        base, slopes : (4, c) ndarray
        """
        corners = self._coordinates[:, self._tetrahedra[cells].T]
        u, v, w = (corners[:, i] - corners[:, 0] for i in (1, 2, 3))
        gradients = np.stack(face_normals(u, v, w), axis=1)
        gradients /= dot(u, gradients[:, 0])
        base, slopes = np.empty((2, 4, len(cells)))
        base[1:] = dot((starts.T - corners[:, 0])[:, None], gradients)
        slopes[1:] = dot(np.ascontiguousarray(directions.T)[:, None], gradients)
        base[0], slopes[0] = 1.0 - base[1:].sum(axis=0), -slopes[1:].sum(axis=0)
        return base, slopes


def _cover_paths(paths: IntArray, enter: FloatArray, leave: FloatArray) -> tuple[IntArray, FloatArray]:
    """The order of intervals by path and entry, and how far the earlier intervals of the path reach."""
    order = np.lexsort((enter, paths))
    # NumPy orders complex numbers by their real part first, so the running maximum restarts with each path.
    reached = np.maximum.accumulate(paths[order] + 1j * leave[order]).imag
    return order, np.where(np.diff(paths[order], prepend=-1) > 0, 0.0, np.roll(reached, 1))
