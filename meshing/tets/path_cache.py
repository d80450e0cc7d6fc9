"""Paths that were marched through a mesh, kept for those who ask for them again.

Light of one refractive index takes the same paths in every medium, and only fades more or less along them.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.search.cell_tree import PathSegments

# Stretches that are kept of one mesh: two hundred megabytes.
MOST_KEPT = 1 << 21
# And parts, each of which is looked through; the oldest go first.
MOST_PARTS = 64


@dataclass(frozen=True, eq=False)
class TracedPaths:
    """Paths that were marched.

    Parameters
    ----------
    lines : (7, p) ndarray
        Starts, directions, and how far each was marched.
    cells, ends : (p,) ndarray
        The tetrahedra in which they begin and end.
    lost : (p,) ndarray of bool
        Those that could not be marched.
    stretches : PathSegments
        Of the others.
    """

    lines: FloatArray
    cells: IntArray
    ends: IntArray
    lost: BoolArray
    stretches: PathSegments

    @cached_property
    def _by_key(self) -> tuple[FloatArray, IntArray]:
        """The keys of all paths, ascending, and whose they are."""
        keys = keys_of(self.lines)
        order = np.argsort(keys)
        return keys[order], order

    def find(self, keys: FloatArray, lines: FloatArray, cells: IntArray) -> IntArray:
        """The paths that are the same as lines (7, p) from given tetrahedra, however far, (p,); -1 where none is.

        Of lines that are the same, only one is found.
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

    def some(self, places: IntArray) -> "TracedPaths":
        """Some of the paths, in a given order."""
        if np.array_equal(places, np.arange(len(self.cells))):
            return self
        number = np.full(len(self.cells), -1)
        number[places] = np.arange(len(places))
        numbers = number[self.stretches.paths]
        stretches = some_of(replace(self.stretches, paths=numbers), numbers >= 0)
        return TracedPaths(self.lines[:, places], self.cells[places], self.ends[places], self.lost[places], stretches)

    def up_to(self, lengths: FloatArray) -> "TracedPaths":
        """The same no further than some lengths (p,); where they end is not known any more."""
        if (self.lines[6] <= lengths).all():
            return self
        every = self.stretches
        most = lengths[every.paths]
        return replace(self, stretches=some_of(replace(every, leave=np.minimum(every.leave, most)), every.enter < most))

    def on(self, more: "TracedPaths", further: IntArray) -> "TracedPaths":
        """Together with what some of its paths were marched from where they ended."""
        lines, ends, lost = self.lines.copy(), self.ends.copy(), self.lost.copy()
        lines[6, further], ends[further], lost[further] = more.lines[6], more.ends, more.lost
        one, other = self.stretches, more.stretches
        stretches = PathSegments(
            np.concatenate([one.paths, further[other.paths]]),
            np.concatenate([one.cells, other.cells]),
            np.concatenate([one.enter, other.enter]),
            np.concatenate([one.leave, other.leave]),
            np.concatenate([one.weights, other.weights]),
            np.concatenate([one.slopes, other.slopes]),
        )
        return TracedPaths(lines, self.cells, ends, lost, some_of(stretches, ~lost[stretches.paths]))

    __repr__ = one_line


def some_of(every: PathSegments, chosen: BoolArray) -> PathSegments:
    """The chosen stretches."""
    if chosen.all():
        return every
    places = np.flatnonzero(chosen)
    return PathSegments(
        every.paths[places],
        every.cells[places],
        every.enter[places],
        every.leave[places],
        # As they are marched, by corners.
        every.weights.T.take(places, axis=1).T,
        every.slopes.T.take(places, axis=1).T,
    )


# Any numbers of the same size that have nothing to do with each other.
_WEIGHTS = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0])


def keys_of(lines: FloatArray) -> FloatArray:
    """A number for each of lines (7, p), by where they start and go; the same, to the last bit, for the same."""
    return np.asarray(sum(weight * row for weight, row in zip(_WEIGHTS, lines[:6], strict=True)))


@dataclass(frozen=True, eq=False)
class PathCache:
    """What was marched through one mesh."""

    parts: list[TracedPaths] = field(default_factory=list)

    def add(self, part: TracedPaths, instead: TracedPaths | None = None) -> None:
        """Keep paths, in the place of a part that they continue if there is one, unless they are too many."""
        others = [each for each in self.parts if each is not instead]
        if sum(len(each.stretches.paths) for each in [*others, part]) <= MOST_KEPT:
            self.parts[:] = [*others, part][-MOST_PARTS:]
