"""Traced paths through a mesh, cached for later requests.

At equal refractive index, light takes the same paths in every medium; only its attenuation along them differs.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.search.cell_tree import PathSegments

# Segments cached per mesh: two hundred megabytes.
MOST_CACHED_SEGMENTS = 1 << 21
# Parts cached per mesh, since each is searched; the oldest are dropped first.
MOST_CACHED_PARTS = 64


@dataclass(frozen=True, eq=False)
class TracedPaths:
    """Traced paths with their segments.

    Parameters
    ----------
    lines : (7, p) ndarray
        Start, direction and traced length of each path, unit.
    cells, ends : (p,) ndarray
        The tetrahedra in which the paths begin and end.
    lost : (p,) ndarray of bool
        Whether tracing failed.
    segments : PathSegments
        Segments of the paths that are not lost.
    """

    lines: FloatArray
    cells: IntArray
    ends: IntArray
    lost: BoolArray
    segments: PathSegments

    @cached_property
    def _by_key(self) -> tuple[FloatArray, IntArray]:
        """The keys of all paths, ascending, and the path of each."""
        keys = hash_lines(self.lines)
        order = np.argsort(keys)
        return keys[order], order

    def find(self, keys: FloatArray, lines: FloatArray, cells: IntArray) -> IntArray:
        """The cached path, (p,), with the start, direction and tetrahedron of each line (7, p); -1 if none.

        Lengths may differ. Of several equal lines, only one is found.
        """
        ascending, order = self._by_key
        candidates = np.minimum(np.searchsorted(ascending, keys), len(order) - 1)
        queries = np.flatnonzero(ascending[candidates] == keys)
        found = np.full(len(keys), -1)
        if len(queries) == 0:
            return found
        candidates = order[candidates[queries]]
        same = (self.lines[:6, candidates] == lines[:6, queries]).all(axis=0) & (
            self.cells[candidates] == cells[queries]
        )
        candidates, queries = candidates[same], queries[same]
        query_of = np.empty(len(order), dtype=np.int64)
        query_of[candidates] = queries
        unique = query_of[candidates] == queries
        found[queries[unique]] = candidates[unique]
        return found

    def select(self, indices: IntArray) -> "TracedPaths":
        """The paths of given indices, in that order."""
        if np.array_equal(indices, np.arange(len(self.cells))):
            return self
        number = np.full(len(self.cells), -1)
        number[indices] = np.arange(len(indices))
        numbers = number[self.segments.paths]
        segments = select_segments(replace(self.segments, paths=numbers), numbers >= 0)
        return TracedPaths(
            self.lines[:, indices], self.cells[indices], self.ends[indices], self.lost[indices], segments
        )

    def shorten(self, lengths: FloatArray) -> "TracedPaths":
        """The paths cut off at lengths (p,); `ends` is not valid for the shortened paths."""
        if (self.lines[6] <= lengths).all():
            return self
        segments = self.segments
        limits = lengths[segments.paths]
        return replace(
            self,
            segments=select_segments(
                replace(segments, leave=np.minimum(segments.leave, limits)), segments.enter < limits
            ),
        )

    def extend(self, more: "TracedPaths", further: IntArray) -> "TracedPaths":
        """Append to the paths of indices `further` their continuations `more`, which begin where these paths end."""
        lines, ends, lost = self.lines.copy(), self.ends.copy(), self.lost.copy()
        lines[6, further], ends[further], lost[further] = more.lines[6], more.ends, more.lost
        one, other = self.segments, more.segments
        segments = PathSegments(
            np.concatenate([one.paths, further[other.paths]]),
            np.concatenate([one.cells, other.cells]),
            np.concatenate([one.enter, other.enter]),
            np.concatenate([one.leave, other.leave]),
            np.concatenate([one.weights, other.weights]),
            np.concatenate([one.slopes, other.slopes]),
        )
        return TracedPaths(lines, self.cells, ends, lost, select_segments(segments, ~lost[segments.paths]))

    __repr__ = one_line


def select_segments(segments: PathSegments, chosen: BoolArray) -> PathSegments:
    """The chosen segments."""
    if chosen.all():
        return segments
    indices = np.flatnonzero(chosen)
    return PathSegments(
        segments.paths[indices],
        segments.cells[indices],
        segments.enter[indices],
        segments.leave[indices],
        # Selected corner by corner, the memory order in which paths are traced.
        segments.weights.T.take(indices, axis=1).T,
        segments.slopes.T.take(indices, axis=1).T,
    )


# Hash weights, linearly independent over the rationals.
_WEIGHTS = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0])


def hash_lines(lines: FloatArray) -> FloatArray:
    """Hash the start and direction of each line (7, p), (p,); bitwise equal lines have equal hashes."""
    return np.asarray(sum(weight * row for weight, row in zip(_WEIGHTS, lines[:6], strict=True)))


@dataclass(frozen=True, eq=False)
class PathCache:
    """The traced paths of one mesh, in parts."""

    parts: list[TracedPaths] = field(default_factory=list)

    def add(self, part: TracedPaths, instead: TracedPaths | None = None) -> None:
        """Cache traced paths, in place of `instead` if given, unless the cache would exceed its size limit."""
        others = [each for each in self.parts if each is not instead]
        if sum(len(each.segments.paths) for each in [*others, part]) <= MOST_CACHED_SEGMENTS:
            self.parts[:] = [*others, part][-MOST_CACHED_PARTS:]
