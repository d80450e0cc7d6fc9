"""Trace straight paths through a mesh from neighbour to neighbour, many times faster than `CellTree.cut`.

The tetrahedron in which a path begins must be known. Traced paths are cached.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.host.corners import dot, face_normals
from tetlux.meshing.search.cell_tree import SLACK, PathSegments
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.path_cache import TracedPaths, hash_lines

# A segment may begin outside its tetrahedron by at most this much, in barycentric coordinates. A path within SLACK of
# an edge may be several times SLACK outside the next tetrahedron.
START_SLACK = 10.0 * SLACK
# A path that leaves the mesh less than this share of its length before its end has reached its end.
END_TOLERANCE = 1e-12
# A path without progress in more than this many successive tetrahedra circles around a node; the tree cuts it instead.
MOST_STALLS = 64
# Paths traced at once: their segments take some tens of megabytes.
PATHS_AT_ONCE = 1 << 12


def march(
    mesh: TetMesh,
    starts: FloatArray,
    directions: FloatArray,
    lengths: FloatArray,
    cells: IntArray | None = None,
    *,
    keep: bool = True,
) -> Iterator[PathSegments]:
    """Cut paths into segments, one per tetrahedron, by walking from each tetrahedron to its neighbour.

    In a tetrahedron the path continues until a barycentric coordinate is less than -`SLACK`, as in `CellTree.cut`, and
    then passes the face of that coordinate. Paths that do not reach their end in this way, or that begin outside
    the given tetrahedron, are cut by the tree, so that the segments are always correct.

    Parameters
    ----------
    mesh : TetMesh
    starts, directions, lengths : (p, 3), (p, 3), (p,) ndarray
        Directions are unit vectors.
    cells : (p,) ndarray, optional
        The tetrahedron in which each begins, -1 if not known.
    keep : bool
        Whether to cache the paths.

    Yields
    ------
    PathSegments
        All segments of some of the paths.
    """
    remaining = [np.arange(len(starts))]
    if cells is not None:
        known, remaining = np.flatnonzero(cells >= 0), [np.flatnonzero(cells < 0)]
        lines = np.vstack([starts[known].T, directions[known].T, lengths[known]])
        for some, part in (
            _trace_cached(mesh, lines, cells[known]) if keep else _trace_portions(mesh, lines, cells[known])
        ):
            yield replace(part.segments, paths=known[some[part.segments.paths]])
            remaining.append(known[some[part.lost]])
    others = np.concatenate(remaining)
    if len(others):
        for segments in mesh.tree.cut(starts[others], directions[others], lengths[others]):
            yield replace(segments, paths=others[segments.paths])


def _trace_cached(mesh: TetMesh, lines: FloatArray, cells: IntArray) -> Iterator[tuple[IntArray, TracedPaths]]:
    """Trace the lines (7, p) that are not cached; yield indices of lines with their paths."""
    keys, unknown = hash_lines(lines), np.arange(len(cells))
    for part in list(mesh.cache.paths.parts):
        cached = part.find(keys[unknown], lines[:, unknown], cells[unknown])
        found = cached >= 0
        if not found.any():
            continue
        some, cached, unknown = unknown[found], cached[found], unknown[~found]
        lengths = lines[6, some]
        too_short = (lengths > part.lines[6, cached]) & ~part.lost[cached]
        traced = part
        if too_short.any():
            further = cached[too_short]
            traced = part.extend(
                _trace(mesh, lines[:, some[too_short]], part.ends[further], part.lines[6, further]), further
            )
            mesh.cache.paths.add(traced, instead=part)
        yield some, traced.select(cached).shorten(lengths)
    for some, part in _trace_portions(mesh, lines[:, unknown], cells[unknown]):
        mesh.cache.paths.add(part)
        yield unknown[some], part


def _trace_portions(mesh: TetMesh, lines: FloatArray, cells: IntArray) -> Iterator[tuple[IntArray, TracedPaths]]:
    """Trace lines (7, p) in portions; yield indices of lines with their paths."""
    for start in range(0, len(cells), PATHS_AT_ONCE):
        some = np.arange(start, min(start + PATHS_AT_ONCE, len(cells)))
        yield some, _trace(mesh, lines[:, some], cells[some], np.zeros(len(some)))


def _trace(mesh: TetMesh, lines: FloatArray, cells: IntArray, reached: FloatArray) -> TracedPaths:
    """Trace lines (7, p), each from a distance `reached` along it, in the tetrahedron of `cells`, (p,) each."""
    coordinates, all_lines, ends = np.ascontiguousarray(mesh.points.T), lines, cells.copy()
    lost = np.zeros(len(cells), dtype=bool)
    # For each unfinished path: its index and its number of steps without progress.
    paths, stalls = np.arange(len(lost)), np.zeros(len(lost), dtype=np.int64)
    begin, parts = cells, [[paths[:0], cells[:0], reached[:0], reached[:0], np.zeros((4, 0)), np.zeros((4, 0))]]
    for _ in range(len(mesh.tetrahedra) + MOST_STALLS):
        base, slopes = _coordinates(coordinates, mesh.tetrahedra[cells].T, lines, reached)
        # A path never leaves through a face that it runs parallel to or away from.
        distances = np.where(slopes < 0, (base + SLACK) / np.where(slopes < 0, -slopes, 1.0), np.inf)
        face, lengths = distances.argmin(axis=0), lines[6]
        nearest = distances.min(axis=0)
        beyond = mesh.neighbours[cells, face].astype(np.int64)
        outside = beyond < 0
        leave = reached + np.maximum(nearest, 0.0)
        done = leave >= np.where(outside, (1.0 - END_TOLERANCE) * lengths, lengths)
        leave[done] = lengths[done]
        advanced = leave > reached
        stalls = np.where(leave > reached + END_TOLERANCE * lengths, 0, stalls + 1)
        failed = (advanced & (base.min(axis=0) < -START_SLACK)) | ((outside | (stalls > MOST_STALLS)) & ~done)
        failed |= ~np.isfinite(base[0] + slopes[0])
        parts.append(_select(advanced, paths, cells, reached, leave, base, slopes))
        lost[paths[failed]] = True
        ends[paths[done]] = cells[done]
        paths, stalls, cells, reached, lines = _select(~(done | failed), paths, stalls, beyond, leave, lines)
        if len(paths) == 0:
            break
    lost[paths] = True
    every = [np.concatenate(column, axis=-1) for column in zip(*parts, strict=True)]
    owners, passed, enter, leave, weights, changes = _select(~lost[every[0]], *every)
    segments = PathSegments(owners, passed, enter, leave, weights.T, changes.T)
    return TracedPaths(all_lines, begin, ends, lost, segments)


def _select(chosen: BoolArray, *arrays: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
    """The chosen entries of each array along its last axis."""
    if chosen.all():
        return list(arrays)
    indices = np.flatnonzero(chosen)
    return [array.take(indices, axis=-1) for array in arrays]


def _coordinates(
    coordinates: FloatArray, nodes: IntArray, lines: FloatArray, reached: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Barycentric coordinates at points on lines, and their derivatives along the lines.

    Parameters
    ----------
    coordinates : (3, n) ndarray
        Coordinates of all nodes.
    nodes : (4, p) ndarray
        The corners of a tetrahedron for each line.
    lines : (7, p) ndarray
        Starts and directions in the first six rows.
    reached : (p,) ndarray
        Distance of the point along the line.

    Returns
    -------
    base, slopes : (4, p) ndarray
        nan or infinite where a tetrahedron is flat.
    """
    corners = coordinates.take(nodes, axis=1)
    origin, directions = corners[:, 0], lines[3:6]
    u, v, w = corners[:, 1] - origin, corners[:, 2] - origin, corners[:, 3] - origin
    offsets = lines[:3] + reached * directions - origin
    base, slopes = np.empty((2, 4, len(reached)))
    with np.errstate(all="ignore"):
        normals = face_normals(u, v, w)
        inverse = 1.0 / dot(u, normals[0])
        for corner, normal in enumerate(normals, 1):
            base[corner] = dot(offsets, normal) * inverse
            slopes[corner] = dot(directions, normal) * inverse
        base[0] = 1.0 - (base[1] + base[2] + base[3])
        slopes[0] = -(slopes[1] + slopes[2] + slopes[3])
    return base, slopes
