"""`MeshHints`: where the first mesh has to be fine."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tetlux.fem.sources.arrays import no_vectors
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False)
class MeshHints:
    """The length that a mesh has to resolve near a light, and where.

    Parameters
    ----------
    resolution : float
        Length over which the fluence varies near the light, unit; inf if a mesh may be of any size there.
    places : (p, 3) ndarray
        Places near which the mesh has to be fine, besides the points of `SourceTerms`, unit.
    depth : float
        Where the light covers all of a surface that it meets, the depth over which it decays to 1/e, unit; then layers
        along the surface serve as well. 0 if they do not.
    rims : (r, 3) ndarray
        Places where it varies along the surface as fast as with depth, so that layers do not serve, unit.
    """

    resolution: float = np.inf
    places: FloatArray = field(default_factory=no_vectors)
    depth: float = 0.0
    rims: FloatArray = field(default_factory=no_vectors)

    @classmethod
    def merge(cls, parts: "Sequence[MeshHints]") -> "MeshHints":
        """Join the places of several parts, with the finest resolution."""
        return cls(
            resolution=min(part.resolution for part in parts),
            places=np.vstack([part.places for part in parts]),
            depth=min(part.depth for part in parts),
            rims=np.vstack([part.rims for part in parts]),
        )

    __repr__ = one_line
