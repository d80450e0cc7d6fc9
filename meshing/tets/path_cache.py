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
        known, order = self._by_key
        places = np.minimum(np.searchsorted(known, keys), len(order) - 1)
        alike = np.flatnonzero(known[places] == keys)
        found = np.full(len(keys), -1)
        if len(alike) == 0:
            return found
        places = order[places[alike]]
        same = (self.lines[:6, places] == lines[:6, alike]).all(axis=0) & (self.cells[places] == cells[alike])
        places, alike = places[same], alike[same]
        one = np.empty(len(order), dtype=np.int64)
        one[places] = alike
        first = one[places] == alike
        found[alike[first]] = places[first]
        return found

    def select(self, places: IntArray) -> "TracedPaths":
        """The paths of given indices, in that order."""
        if np.array_equal(places, np.arange(len(self.cells))):
            return self
        number = np.full(len(self.cells), -1)
        number[places] = np.arange(len(places))
        numbers = number[self.segments.paths]
        segments = select_segments(replace(self.segments, paths=numbers), numbers >= 0)
        return TracedPaths(self.lines[:, places], self.cells[places], self.ends[places], self.lost[places], segments)

    def shorten(self, lengths: FloatArray) -> "TracedPaths":
        """The paths cut off at lengths (p,); `ends` is not valid for the shortened paths."""
        if (self.lines[6] <= lengths).all():
            return self
        every = self.segments
        longest = lengths[every.paths]
        return replace(
            self,
            segments=select_segments(replace(every, leave=np.minimum(every.leave, longest)), every.enter < longest),
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


def select_segments(every: PathSegments, chosen: BoolArray) -> PathSegments:
    """The chosen segments."""
    if chosen.all():
        return every
    places = np.flatnonzero(chosen)
    return PathSegments(
        every.paths[places],
        every.cells[places],
        every.enter[places],
        every.leave[places],
        # Selected corner by corner, the memory order in which paths are traced.
        every.weights.T.take(places, axis=1).T,
        every.slopes.T.take(places, axis=1).T,
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
