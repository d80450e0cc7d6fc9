"""Paths that were marched through a mesh, kept for those who ask for them again.

Light of one refractive index takes the same paths in every medium, and only fades more or less along them.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.cell_tree import Stretches

# Stretches that are kept of one mesh: a hundred megabytes.
MOST_KEPT = 1 << 20


@dataclass(frozen=True, eq=False)
class Marched:
    """Paths that were marched.

    Parameters
    ----------
    lines : (7, p) ndarray
        Starts, directions, and how far each was marched.
    cells, ends : (p,) ndarray
        The tetrahedra in which they begin and end.
    lost : (p,) ndarray of bool
        Those that could not be marched.
    stretches : Stretches
        Of the others.
    """

    lines: FloatArray
    cells: IntArray
    ends: IntArray
    lost: BoolArray
    stretches: Stretches

    def first(self, count: int) -> "Marched":
        """The first paths only."""
        if count == len(self.cells):
            return self
        stretches = some_of(self.stretches, self.stretches.paths < count)
        return Marched(self.lines[:, :count], self.cells[:count], self.ends[:count], self.lost[:count], stretches)

    def up_to(self, lengths: FloatArray) -> "Marched":
        """The same no further than some lengths (p,); where they end is not known any more."""
        if (self.lines[6] <= lengths).all():
            return self
        every = self.stretches
        most = lengths[every.paths]
        return replace(self, stretches=some_of(replace(every, leave=np.minimum(every.leave, most)), every.enter < most))

    def on(self, more: "Marched", further: IntArray) -> "Marched":
        """Together with what some of its paths were marched from where they ended."""
        lines, ends, lost = self.lines.copy(), self.ends.copy(), self.lost.copy()
        lines[6, further], ends[further], lost[further] = more.lines[6], more.ends, more.lost
        one, other = self.stretches, more.stretches
        stretches = Stretches(
            np.concatenate([one.paths, further[other.paths]]),
            np.concatenate([one.cells, other.cells]),
            np.concatenate([one.enter, other.enter]),
            np.concatenate([one.leave, other.leave]),
            np.concatenate([one.weights, other.weights]),
            np.concatenate([one.slopes, other.slopes]),
        )
        return Marched(lines, self.cells, ends, lost, some_of(stretches, ~lost[stretches.paths]))


def some_of(every: Stretches, chosen: BoolArray) -> Stretches:
    """The chosen stretches."""
    if chosen.all():
        return every
    return Stretches(
        every.paths[chosen],
        every.cells[chosen],
        every.enter[chosen],
        every.leave[chosen],
        every.weights[chosen],
        every.slopes[chosen],
    )


@dataclass(frozen=True, eq=False)
class Kept:
    """What was marched through one mesh, found again by where its first path begins."""

    parts: dict[bytes, Marched] = field(default_factory=dict)

    def find(self, lines: FloatArray, cells: IntArray) -> Marched | None:
        """As many of the first lines (7, p) as were marched before, in this order, however far."""
        part = self.parts.get(lines[:6, 0].tobytes())
        if part is None:
            return None
        count = min(len(cells), len(part.cells))
        same = (lines[:6, :count] == part.lines[:6, :count]).all(axis=0) & (cells[:count] == part.cells[:count])
        count = count if same.all() else int(same.argmin())
        return part.first(count) if count > 0 else None

    def add(self, part: Marched) -> None:
        """Keep paths in the place of those that begin alike, if they are not too many."""
        key = part.lines[:6, 0].tobytes()
        others = sum(len(each.stretches.paths) for known, each in self.parts.items() if known != key)
        if others + len(part.stretches.paths) <= MOST_KEPT:
            self.parts[key] = part
