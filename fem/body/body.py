"""`Body`: a surface and the media inside it, as lights need them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tetlux.fem.body.optical_paths import OpticalPaths, paths_of
from tetlux.fem.body.partition import Partition, Pieces, SurfacePartition
from tetlux.fem.media.coefficients import AnyMedium, MediaByLabel, base_of, by_label
from tetlux.fem.media.medium import Medium
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.surface import Surface

# Depth of a place just inside the surface, as a share of the body's diagonal.
JUST_INSIDE = 1e-6


@dataclass(frozen=True, eq=False)
class Body:
    """A surface, and the media of the regions inside it.

    Lights ask for the medium at a place, so that it does not matter which part is called the body and which a region.

    Parameters
    ----------
    surface : Surface
        The outer surface.
    media : sequence of Medium or VaryingMedium, or mapping of int to these
        Of the body outside of its regions, and of each region; or of each label, the outermost first.
    partition : Partition
        Where the regions are.

    Examples
    --------
    >>> import numpy as np
    >>> from tetlux.fem import Medium
    >>> from tetlux.meshing import sphere
    >>> body = Body(sphere(10.0), [Medium(sigma_a=0.01, sigma_s_prime=0.99, eta=1.4)])
    >>> body.mean_free_paths(np.zeros((1, 3))).tolist()
    [1.0]
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
        """A medium with the refractive index and boundary of all media; its coefficients do not hold everywhere."""
        return base_of(self._first)

    @property
    def only_medium(self) -> Medium | None:
        """The medium of the whole body, if there is only one and it does not vary."""
        return self._first if len(self.media) == 1 and isinstance(self._first, Medium) else None

    def region_at(self, points: FloatArray) -> IntArray:
        """Find the regions that points lie in.

        Parameters
        ----------
        points : (q, 3) ndarray
            unit.

        Returns
        -------
        (q,) ndarray
            Numbers or labels of the regions.
        """
        if len(self.media) == 1:
            return np.full(len(points), next(iter(self.by_label)), dtype=np.int64)
        return self.partition.region_at(points)

    def just_inside(self, points: FloatArray) -> FloatArray:
        """Find places just below the surface.

        Parameters
        ----------
        points : (q, 3) ndarray
            unit.

        Returns
        -------
        (q, 3) ndarray
            The nearest point of the surface to each, moved inwards by a small share of the body's diagonal, unit.
        """
        nearest, faces = self.surface.closest(points)
        return np.asarray(nearest - JUST_INSIDE * self.surface.diagonal * self.surface.normals[faces])

    def mean_free_paths(self, points: FloatArray) -> FloatArray:
        """Compute transport mean free paths 1/sigma_t'.

        Parameters
        ----------
        points : (q, 3) ndarray
            Inside the body, unit.

        Returns
        -------
        (q,) ndarray
            unit.
        """
        regions, found = self.region_at(points), np.empty(len(points))
        for region in np.unique(regions).tolist():
            inside = regions == region
            sigma_a, reduced, _ = self._local(region, points[inside])
            found[inside] = 1.0 / (sigma_a + reduced)
        return found

    @cached_property
    def shortest_mean_free_path(self) -> float:
        """The least of all media, unit; see `ranges_of_mean_free_path`."""
        return min(least for least, _ in self.ranges_of_mean_free_path)

    @cached_property
    def ranges_of_mean_free_path(self) -> list[tuple[float, float]]:
        """Least and greatest transport mean free path of each medium, unit.

        A medium that varies is sampled at the surface of its region, or at the nodes of a mesh.
        """
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

    def extents_along(self, starts: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distances from places on the surface at which the body begins and ends.

        Parameters
        ----------
        starts : (r, 3) ndarray
            Places on the surface.
        directions : (r, 3) ndarray
            Unit vectors inwards.

        Returns
        -------
        begins : (r,) ndarray
            0, but where a ray starts on a curved surface above the triangle that it enters, unit.
        ends : (r,) ndarray
            Distance at which the ray leaves, unit; 0 where it meets no triangle.
        """
        surface = self.surface
        ends, faces = surface.rays.first(starts, directions)
        begins = np.zeros(len(starts))
        above = np.flatnonzero(np.einsum("ij,ij->i", directions, surface.normals[faces]) < 0)
        above = above[faces[above] >= 0]
        begins[above] = ends[above]
        places = starts[above] + begins[above, None] * directions[above]
        ends[above] += surface.rays.first(places, directions[above])[0]
        missed = ~np.isfinite(ends)
        begins[missed], ends[missed] = 0.0, 0.0
        return begins, ends

    def paths(
        self, starts: FloatArray, directions: FloatArray, lengths: FloatArray, begins: FloatArray | None = None
    ) -> OpticalPaths:
        """Compute the coefficients along straight paths.

        Parameters
        ----------
        starts, directions : (r, 3) ndarray
            Directions are unit vectors.
        lengths : (r,) ndarray
            unit.
        begins : (r,) ndarray, optional
            See `extents_along`; 0 if not given.

        Returns
        -------
        OpticalPaths
        """
        medium, zeros = self.only_medium, np.zeros(len(starts))
        if medium is not None:
            sigma_a, reduced, scattering = (np.full(len(starts), value) for value in _coefficients_of(medium))
            every = np.arange(len(starts))
            return OpticalPaths(Pieces(every, zeros, lengths, 0 * every), sigma_a, reduced, scattering)
        varying = [region for region, medium in self.by_label.items() if not isinstance(medium, Medium)]
        partition = self.partition
        if len(self.media) == 1:
            # One medium fills the whole body, whatever regions its mesh has.
            partition, varying = SurfacePartition(), [0]
        pieces = partition.pieces(starts, directions, zeros if begins is None else begins, lengths)
        return paths_of(pieces, starts, directions, varying, self._local)

    def _local(self, region: int, points: FloatArray) -> FloatArray:
        """Coefficients (3, q) of a region at points (q, 3), see `optical_paths.LocalCoefficients`."""
        medium = self.by_label[region] if len(self.media) > 1 else self._first
        if isinstance(medium, Medium):
            return np.repeat(np.array(_coefficients_of(medium))[:, None], len(points), axis=1)
        sigma_a, reduced = medium.at(points)
        return np.stack([sigma_a, reduced, medium.delta_eddington(reduced)[0]])


def _coefficients_of(medium: Medium) -> tuple[float, float, float]:
    return medium.sigma_a, medium.reduced_scattering, medium.delta_eddington[0]
