"""Straight paths through a mesh, all at once from tetrahedron to tetrahedron: many times quicker than `CellTree.cut`.

It has to be known in which tetrahedron each of them begins. Paths that were marched before are not marched again.
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
from tetlux.meshing.tets.path_cache import TracedPaths, keys_of

# How far outside a tetrahedron, in barycentric coordinates, a stretch in it may begin. Where a path passes an edge
# within `SLACK`, the next tetrahedron has it some times as far outside.
ASIDE = 10.0 * SLACK
# A path that ends within this share of its length behind the boundary ends at it.
ROUNDING = 1e-12
# A path that passes so many tetrahedra in a row without getting on is lost among those around a node.
MOST_STALLS = 64
# Paths that are on their way at once: their stretches take some tens of megabytes.
PORTION = 1 << 12


def march(
    mesh: TetMesh,
    starts: FloatArray,
    directions: FloatArray,
    lengths: FloatArray,
    cells: IntArray | None = None,
    *,
    keep: bool = True,
) -> Iterator[PathSegments]:
    """Cut paths where they pass from tetrahedron to tetrahedron, each from where it begins.

    In a tetrahedron the path goes on until a coordinate is less than -`SLACK`, as in `CellTree.cut`, and then passes
    the face of that coordinate. Paths that this does not bring to their end, or that begin elsewhere than they
    should, are left to the tree, so that the stretches are always right.

    Parameters
    ----------
    mesh : TetMesh
    starts, directions, lengths : (p, 3), (p, 3), (p,) ndarray
        Directions are unit vectors.
    cells : (p,) ndarray, optional
        The tetrahedron in which each begins, -1 if not known.
    keep : bool
        Whether they may be asked for again.

    Yields
    ------
    PathSegments
        Of some paths, all that each has.
    """
    left = [np.arange(len(starts))]
    if cells is not None:
        known, left = np.flatnonzero(cells >= 0), [np.flatnonzero(cells < 0)]
        lines = np.vstack([starts[known].T, directions[known].T, lengths[known]])
        for some, part in _kept(mesh, lines, cells[known]) if keep else _anew(mesh, lines, cells[known]):
            yield replace(part.stretches, paths=known[some[part.stretches.paths]])
            left.append(known[some[part.lost]])
    others = np.concatenate(left)
    if len(others):
        for stretches in mesh.tree.cut(starts[others], directions[others], lengths[others]):
            yield replace(stretches, paths=others[stretches.paths])


def _kept(mesh: TetMesh, lines: FloatArray, cells: IntArray) -> Iterator[tuple[IntArray, TracedPaths]]:
    """Lines (7, p), their starts, directions and lengths, marched if they are not known: some of them at a time."""
    keys, unknown = keys_of(lines), np.arange(len(cells))
    for part in list(mesh.cache.paths.parts):
        places = part.find(keys[unknown], lines[:, unknown], cells[unknown])
        found = places >= 0
        if not found.any():
            continue
        some, places, unknown = unknown[found], places[found], unknown[~found]
        wanted = lines[6, some]
        short = (wanted > part.lines[6, places]) & ~part.lost[places]
        whole = part
        if short.any():
            further = places[short]
            whole = part.on(_trace(mesh, lines[:, some[short]], part.ends[further], part.lines[6, further]), further)
            mesh.cache.paths.add(whole, instead=part)
        yield some, whole.some(places).up_to(wanted)
    for some, part in _anew(mesh, lines[:, unknown], cells[unknown]):
        mesh.cache.paths.add(part)
        yield unknown[some], part


def _anew(mesh: TetMesh, lines: FloatArray, cells: IntArray) -> Iterator[tuple[IntArray, TracedPaths]]:
    """Lines (7, p) marched, some of them at a time."""
    for start in range(0, len(cells), PORTION):
        some = np.arange(start, min(start + PORTION, len(cells)))
        yield some, _trace(mesh, lines[:, some], cells[some], np.zeros(len(some)))


def _trace(mesh: TetMesh, lines: FloatArray, cells: IntArray, reached: FloatArray) -> TracedPaths:
    """March lines (7, p) from where they are, by how far that is along them and the tetrahedron there, (p,) each."""
    coordinates, whole, ends = np.ascontiguousarray(mesh.points.T), lines, cells.copy()
    lost = np.zeros(len(cells), dtype=bool)
    # Of each path that is still on its way: its number, how far it has come, and for how many steps it has not.
    paths, stalls = np.arange(len(lost)), np.zeros(len(lost), dtype=np.int64)
    begin, parts = cells, [[paths[:0], cells[:0], reached[:0], reached[:0], np.zeros((4, 0)), np.zeros((4, 0))]]
    for _ in range(len(mesh.tetrahedra) + MOST_STALLS):
        base, slopes = _coordinates(coordinates, mesh.tetrahedra[cells].T, lines, reached)
        # Nothing leaves through a face that it runs along or away from.
        ways = np.where(slopes < 0, (base + SLACK) / np.where(slopes < 0, -slopes, 1.0), np.inf)
        face, lengths = ways.argmin(axis=0), lines[6]
        way = ways.min(axis=0)
        beyond = mesh.neighbours[cells, face].astype(np.int64)
        outside = beyond < 0
        leave = reached + np.maximum(way, 0.0)
        done = leave >= np.where(outside, (1.0 - ROUNDING) * lengths, lengths)
        leave[done] = lengths[done]
        got_on = leave > reached
        stalls = np.where(leave > reached + ROUNDING * lengths, 0, stalls + 1)
        failed = (got_on & (base.min(axis=0) < -ASIDE)) | ((outside | (stalls > MOST_STALLS)) & ~done)
        failed |= ~np.isfinite(base[0] + slopes[0])
        parts.append(_some(got_on, paths, cells, reached, leave, base, slopes))
        lost[paths[failed]] = True
        ends[paths[done]] = cells[done]
        paths, stalls, cells, reached, lines = _some(~(done | failed), paths, stalls, beyond, leave, lines)
        if len(paths) == 0:
            break
    lost[paths] = True
    every = [np.concatenate(column, axis=-1) for column in zip(*parts, strict=True)]
    owners, passed, enter, leave, weights, changes = _some(~lost[every[0]], *every)
    stretches = PathSegments(owners, passed, enter, leave, weights.T, changes.T)
    return TracedPaths(whole, begin, ends, lost, stretches)


def _some(chosen: BoolArray, *arrays: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
    """The chosen ones along the last axis of arrays; as they are where all are chosen."""
    if chosen.all():
        return list(arrays)
    places = np.flatnonzero(chosen)
    return [array.take(places, axis=-1) for array in arrays]


def _coordinates(
    coordinates: FloatArray, nodes: IntArray, lines: FloatArray, reached: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Barycentric coordinates at places along lines, and their derivatives along them.

    Parameters
    ----------
    coordinates : (3, n) ndarray
        Of all nodes.
    nodes : (4, p) ndarray
        The corners of a tetrahedron for each line.
    lines : (7, p) ndarray
        Starts and directions, and what else.
    reached : (p,) ndarray
        How far along the line.

    Returns
    -------
    base, slopes : (4, p) ndarray
        nan, or infinite, where a tetrahedron is flat.
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
