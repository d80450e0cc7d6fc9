"""`Footprint`: where light enters the body and how far that spreads."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tetlux.fem.sources.arrays import no_vectors
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False)
class Footprint:
    """What the error of the diffusion approximation near a light depends on; see `tetlux.fem.validity`.

    Parameters
    ----------
    entries : (e, 3) ndarray
        Samples of the places where beams enter the body, unit.
    radius : float, optional
        Radius of a uniform disc with the same mean square spread, unit; inf for light on the whole body. If not given,
        it is computed from `entries`, or from the points of `SourceTerms` where there are no entries.
    beams_as_points : bool
        Whether each of these points stands for a thin beam that enters at one of `entries`.
    """

    entries: FloatArray = field(default_factory=no_vectors)
    radius: float | None = None
    beams_as_points: bool = False

    @classmethod
    def merge(cls, parts: "Sequence[Footprint]") -> "Footprint":
        """Join the entries of several parts, with the largest radius."""
        return cls(
            entries=np.vstack([part.entries for part in parts]),
            radius=max((part.radius for part in parts if part.radius is not None), default=None),
            beams_as_points=any(part.beams_as_points for part in parts),
        )

    __repr__ = one_line
