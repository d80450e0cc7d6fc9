"""`SourceTerms`: what stands on the right-hand side of the diffusion equation and of its boundary condition."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tetlux.fem.sources.arrays import join_cells, no_values, no_vectors
from tetlux.fem.sources.segments import Segments
from tetlux.fem.sources.volume import VolumeSource
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line


@dataclass(frozen=True, eq=False)
class SourceTerms:
    """Sources at points, along segments, on the surface and in the volume.

    Parameters
    ----------
    points, powers : (p, 3), (p,) ndarray
        Isotropic point sources, unit, and their power, W.
    point_cells : (p,) ndarray, optional
        Tetrahedron of a mesh that contains each point, -1 where unknown; None if all are unknown.
    segments : Segments
        Beams before they are scattered.
    irradiance : float or (b,) ndarray
        Diffuse light on the outside of the whole surface, or at each boundary node of a mesh, W/unit².
    transmitted_irradiance : float or (b,) ndarray
        The part of `irradiance` that passes to the inside, W/unit².
    emission : float or (m,) ndarray
        Power that the whole volume emits, or each tetrahedron of a mesh, W/unit³.
    volume_sources : tuple of VolumeSource
        What the volume of one mesh emits beside that.
    """

    points: FloatArray = field(default_factory=no_vectors)
    powers: FloatArray = field(default_factory=no_values)
    point_cells: IntArray | None = None
    segments: Segments = field(default_factory=Segments)
    irradiance: float | FloatArray = 0.0
    transmitted_irradiance: float | FloatArray = 0.0
    emission: float | FloatArray = 0.0
    volume_sources: tuple[VolumeSource, ...] = ()

    @property
    def is_distributed(self) -> bool:
        """Whether all of it is even over the surface or the volume: no points, no segments, no volume sources."""
        return len(self.points) == 0 and len(self.segments) == 0 and not self.volume_sources

    def select_points(self, some: BoolArray) -> "SourceTerms":
        """The same with some (p,) of the points only."""
        cells = None if self.point_cells is None else self.point_cells[some]
        return replace(self, points=self.points[some], powers=self.powers[some], point_cells=cells)

    @classmethod
    def merge(cls, parts: "Sequence[SourceTerms]") -> "SourceTerms":
        """Add up the sources of several parts."""
        return cls(
            points=np.vstack([part.points for part in parts]),
            powers=np.concatenate([part.powers for part in parts]),
            point_cells=join_cells([(part.point_cells, len(part.points)) for part in parts]),
            segments=Segments.merge([part.segments for part in parts]),
            irradiance=sum((part.irradiance for part in parts), 0.0),
            transmitted_irradiance=sum((part.transmitted_irradiance for part in parts), 0.0),
            emission=sum((part.emission for part in parts), 0.0),
            volume_sources=tuple(source for part in parts for source in part.volume_sources),
        )

    __repr__ = one_line
