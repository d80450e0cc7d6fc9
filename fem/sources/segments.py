"""`Segments`: straight pieces of beams, which are scattered and absorbed along their way."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tetlux.fem.sources.arrays import join_cells, no_values, no_vectors
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False)
class Segments:
    """Beam segments, whose power decays as ``exp(-sigma_t* l)`` along each.

    Parameters
    ----------
    starts, directions : (s, 3) ndarray
        Start points, unit, and unit vectors.
    lengths : (s,) ndarray
        unit.
    fluxes : (s,) ndarray
        Power carried at the start, W.
    cells : (s,) ndarray, optional
        Tetrahedron of a mesh in which each segment starts, -1 where unknown; None if all are unknown.
    """

    starts: FloatArray = field(default_factory=no_vectors)
    directions: FloatArray = field(default_factory=no_vectors)
    lengths: FloatArray = field(default_factory=no_values)
    fluxes: FloatArray = field(default_factory=no_values)
    cells: IntArray | None = None

    def __len__(self) -> int:
        return len(self.starts)

    @classmethod
    def merge(cls, parts: "Sequence[Segments]") -> "Segments":
        """Join the segments of several parts."""
        return cls(
            starts=np.vstack([part.starts for part in parts]),
            directions=np.vstack([part.directions for part in parts]),
            lengths=np.concatenate([part.lengths for part in parts]),
            fluxes=np.concatenate([part.fluxes for part in parts]),
            cells=join_cells([(part.cells, len(part)) for part in parts]),
        )

    __repr__ = one_line
