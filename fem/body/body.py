"""`Body`: what light falls on. It knows which medium is where, and what light meets on its way through."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tetlux.fem.body.optical_paths import OpticalPaths, paths_of
from tetlux.fem.body.partition import Partition, SurfacePartition
from tetlux.fem.media.coefficients import AnyMedium, MediaByLabel, base_of, by_label
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.surface import Surface

# What is just inside the surface is looked at this share of the body's diagonal below it.
BELOW = 1e-6


@dataclass(frozen=True, eq=False)
class Body:
    """A surface, and the media of what it holds.

    Which region is called the body and which a region of it makes no difference: whoever asks, asks for a place.

    Parameters
    ----------
    surface : Surface
        Where the body ends.
    media : sequence of Medium or VaryingMedium, or mapping of int to these
        That of the body outside of its regions, and of each region; or that of each label, the outermost first.
    partition : Partition
        Where the regions are.
    """

    surface: Surface
    media: MediaByLabel | Sequence[AnyMedium]
    partition: Partition = field(default_factory=SurfacePartition)

    @cached_property
    def by_label(self) -> MediaByLabel:
        """The medium of each region by its number or label, the outermost first."""
        return by_label(self.media)

    @property
    def _first(self) -> AnyMedium:
        return next(iter(self.by_label.values()))

    @property
    def outer(self) -> Medium:
        """A medium of the index and the boundary that all media share; nothing else of it holds everywhere."""
        return base_of(self._first)

    @property
    def only_medium(self) -> Medium | None:
        """The medium that the whole body is of, if there is one."""
        return self._first if len(self.media) == 1 and isinstance(self._first, Medium) else None

    def region_at(self, points: FloatArray) -> IntArray:
        """The region that each of the points (q, 3) lies in, (q,)."""
        if len(self.media) == 1:
            return np.full(len(points), next(iter(self.by_label)), dtype=np.int64)
        return self.partition.region_at(points)

    def just_inside(self, points: FloatArray) -> FloatArray:
        """Places just below the points of the surface that are nearest to given points, (q, 3)."""
        nearest, faces = self.surface.closest(points)
        return np.asarray(nearest - BELOW * self.surface.diagonal * self.surface.normals[faces])

    def mean_free_paths(self, points: FloatArray) -> FloatArray:
        """Transport mean free path 1/sigma_t' at points (q, 3) inside, (q,), unit."""
        regions, found = self.region_at(points), np.empty(len(points))
        for region in np.unique(regions).tolist():
            mine = regions == region
            sigma_a, reduced, _ = self._local(region, points[mine])
            found[mine] = 1.0 / (sigma_a + reduced)
        return found

    @cached_property
    def shortest_mean_free_path(self) -> float:
        """Of all its media; of those that vary, on the body's surface, unit."""
        return min(least for least, _ in self.ranges_of_mean_free_path)

    @cached_property
    def ranges_of_mean_free_path(self) -> list[tuple[float, float]]:
        """The least and the greatest of each medium, unit; of one that varies, on the surface where it is."""
        found = []
        for region, medium in self.by_label.items():
            if isinstance(medium, Medium):
                found.append((medium.mean_free_path, medium.mean_free_path))
                continue
            points = self.partition.samples(region)
            if points is None:
                points = self.surface.points
            sigma_a, reduced = medium.at(points)
            lengths = 1.0 / (sigma_a + reduced)
            found.append((float(lengths.min()), float(lengths.max())))
        return found

    def ways_out(self, starts: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How far from places on the surface, along unit vectors (r, 3), the body begins and ends.

        Returns
        -------
        begins : (r,) ndarray
            0 but where a beam starts on a curved surface, above the triangle that it enters, unit.
        ends : (r,) ndarray
            0 where nothing is met, unit.
        """
        surface = self.surface
        ends, faces = surface.rays.first(starts, directions)
        begins = np.zeros(len(starts))
        again = np.flatnonzero(np.einsum("ij,ij->i", directions, surface.normals[faces]) < 0)
        again = again[faces[again] >= 0]
        begins[again] = ends[again]
        places = starts[again] + begins[again, None] * directions[again]
        ends[again] += surface.rays.first(places, directions[again])[0]
        missed = ~np.isfinite(ends)
        begins[missed], ends[missed] = 0.0, 0.0
        return begins, ends

    def paths(
        self, starts: FloatArray, directions: FloatArray, lengths: FloatArray, begins: FloatArray | None = None
    ) -> OpticalPaths:
        """What light meets on straight paths.

        Parameters
        ----------
        starts, directions : (r, 3) ndarray
            Directions are unit vectors.
        lengths : (r,) ndarray
            Unit.
        begins : (r,) ndarray, optional
            See `ways_out`.
        """
        medium, none = self.only_medium, np.zeros(len(starts))
        if medium is not None:
            sigma_a, reduced, scattering = (np.full(len(starts), value) for value in _constants(medium))
            return OpticalPaths(np.arange(len(starts)), none, lengths, sigma_a, reduced, scattering)
        varying = [region for region, medium in self.by_label.items() if not isinstance(medium, Medium)]
        partition = self.partition
        if len(self.media) == 1:
            # One medium is that of the whole body, whatever regions its mesh has.
            partition, varying = SurfacePartition(), [0]
        pieces = partition.pieces(starts, directions, none if begins is None else begins, lengths)
        return paths_of(pieces, starts, directions, varying, self._local)

    def _local(self, region: int, points: FloatArray) -> FloatArray:
        """Coefficients (3, q) of a region's medium at points (q, 3), see `optical_paths.Local`."""
        medium = self.by_label[region] if len(self.media) > 1 else self._first
        if isinstance(medium, Medium):
            return np.repeat(np.array(_constants(medium))[:, None], len(points), axis=1)
        sigma_a, reduced = medium.at(points)
        return np.stack([sigma_a, reduced, medium.delta_eddington(reduced)[0]])


def _constants(medium: Medium) -> tuple[float, float, float]:
    return medium.sigma_a, medium.reduced_scattering, medium.delta_eddington[0]
