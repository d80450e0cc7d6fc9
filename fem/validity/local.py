"""`Validity`: how far the diffusion approximation itself is expected to be off, place by place on a surface."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.validity.facet_media import LocalMedia, media_in, media_under_facets
from tetlux.fem.validity.tables import FADED, Spread, far_error, near_error, near_rows, thin_error, wide_error
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Validity:
    """What is to be expected of the diffusion approximation on the surface of a body.

    It follows from coefficients, geometry and light alone: the relative error of the exitance by each of several
    causes, as Monte Carlo has them (`tetlux.fem.validity.tables`), of which the largest counts. They were found in one
    medium throughout; in a body of several each facet has that of the media below it
    (`tetlux.fem.validity.facet_media`), and what is near a light that of the place where the light enters.

    Parameters
    ----------
    mesh : TetMesh
        Its boundary is looked at.
    coefficients : Coefficients
        Of its tetrahedra.
    deposits : sequence of Deposit
        What each light leaves in the body.
    """

    mesh: TetMesh
    coefficients: Coefficients
    deposits: Sequence[Deposit]

    def at(self, points: FloatArray) -> FloatArray:
        """1 less the expected relative error of the exitance, not below 0, at points (q, 3) of the surface, (q,)."""
        _, facets, _ = self.mesh.closest_boundary(points)
        return np.asarray(np.maximum(1.0 - self.errors(points, facets), 0.0))

    def errors(self, points: FloatArray, facets: IntArray) -> FloatArray:
        """Expected relative errors of the exitance at points (q, 3) of given facets of the boundary (q,), (q,)."""
        below = self.below[facets]
        causes = [wide_error(below.albedo, self.coefficients.outer.eta), self.thin_errors[facets]]
        causes += [self.far_errors(points, facets), self.near_errors(points)]
        return np.asarray(np.max(causes, axis=0))

    def distances(self, points: FloatArray) -> FloatArray:
        """How far points (q, 3) are from where light enters, or from a source, (q,), mean free paths of that place.

        They are 0 where there is light from everywhere, diffuse or emitted.
        """
        return np.asarray(np.min([entry.distances(points) for entry in self._entries], axis=0))

    def near_errors(self, points: FloatArray) -> FloatArray:
        """Expected errors of the exitance at points (q, 3) that come of being near a light, (q,)."""
        return np.asarray(np.max([entry.errors(points) for entry in self._entries], axis=0))

    def far_errors(self, points: FloatArray, facets: IntArray) -> FloatArray:
        """Expected errors of the exitance at points (q, 3) of given facets (q,) that come of being far from light."""
        below = self.below[facets]
        lengths = np.min([entry.lengths(points) for entry in self._entries], axis=0)
        return far_error(below.albedo, lengths / below.mean_free_path)

    def unknown_cosine(self, points: FloatArray) -> BoolArray:
        """Whether the mean cosine of scattering is not known where the light nearest to points (q, 3) enters, (q,)."""
        lengths = np.array([entry.distances(points) for entry in self._entries])
        unknown = np.array([entry.unknown(points) for entry in self._entries])
        return np.asarray(np.take_along_axis(unknown, lengths.argmin(axis=0)[None], axis=0)[0])

    @cached_property
    def _under(self) -> tuple[LocalMedia, FloatArray]:
        return media_under_facets(self.mesh, self.coefficients)

    @property
    def below(self) -> LocalMedia:
        """The media below each facet of the boundary."""
        return self._under[0]

    @property
    def thickness(self) -> FloatArray:
        """How thick the body is under each facet of the boundary, (f,), mean free paths."""
        return self._under[1]

    @cached_property
    def mean_chord(self) -> float:
        """Mean of the optical depth sigma_t' along straight ways through the body, ``4 ∫ sigma_t' dV / S`` (Cauchy)."""
        mesh, total = self.mesh, self.coefficients.sigma_t_prime
        return float(4.0 * np.sum(total * mesh.volumes) / mesh.area)

    @property
    def albedo(self) -> float:
        """Mean reduced albedo of what is below the surface."""
        return self.mean(self.below.albedo)

    @property
    def steepest(self) -> float:
        """Largest sigma_tr at the surface, 1/unit."""
        cells = self.mesh.boundary_cells
        sigma_a, total = (at_cells(v, cells) for v in (self.coefficients.sigma_a, self.coefficients.sigma_t_prime))
        return float(np.sqrt(3.0 * sigma_a * total).max())

    @cached_property
    def thin_errors(self) -> FloatArray:
        """Expected errors that come of the body's thickness under each facet of the boundary, (f,)."""
        errors = [thin_error(self.below.cosine, self.thickness, entry.spread) for entry in self._entries]
        return np.asarray(np.max(errors, axis=0))

    @cached_property
    def middles(self) -> FloatArray:
        """Middles of the facets, (f, 3)."""
        return np.asarray(self.mesh.points[self.mesh.boundary_faces].mean(axis=1))

    @cached_property
    def of_facets(self) -> FloatArray:
        """Expected errors in the middles of the facets, (f,)."""
        return self.errors(self.middles, np.arange(len(self.middles)))

    def mean(self, values: npt.NDArray[np.float64 | np.bool_]) -> float:
        """Mean over the surface of what facets have, (f,)."""
        return float(self.mesh.boundary_areas @ values) / self.mesh.area

    @cached_property
    def _entries(self) -> "list[_Entry]":
        return [self._entry_of(deposit) for deposit in self.deposits]

    def _entry_of(self, deposit: Deposit) -> "_Entry":
        footprint = deposit.footprint
        sources = len(footprint.entries) == 0
        places = deposit.terms.points if sources else footprint.entries
        if len(places) == 0:
            return _Entry(None, self.below[np.zeros(0, dtype=np.int64)], np.inf, np.zeros((0, 6)))
        if sources:
            cells, _ = self.mesh.locate(places)
            _, facets, _ = self.mesh.closest_boundary(places)
            media = media_in(self.coefficients, np.where(cells >= 0, cells, self.mesh.boundary_cells[facets]))
        else:
            media = self.below[self.mesh.closest_boundary(places)[1]]
        # The deposit of a thin beam in one point is at fault itself where scattering is isotropic; a line is as good
        # there as either is where scattering is forward.
        as_points = footprint.beams_as_points
        rows = near_rows(media.albedo, None if sources else media.cosine if as_points else np.ones(len(places)))
        breadth = footprint.radius
        if breadth is None:
            breadth = float(np.sqrt(2.0 * ((places - places.mean(axis=0)) ** 2).sum(axis=1).mean()))
        return _Entry(cKDTree(places), media, breadth, rows, as_points and not sources)

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class _Entry:
    """Where a light enters, or its points are.

    Attributes
    ----------
    places : cKDTree, optional
        Light from everywhere has none.
    media : LocalMedia
        At each of them.
    breadth : float
        Radius of an even disc that spreads as much, unit.
    near : (p, 6) ndarray
        Errors by distance from each place.
    by_cosine : bool
        Whether these errors depend on the mean cosine of scattering.
    """

    places: cKDTree | None
    media: LocalMedia
    breadth: float
    near: FloatArray
    by_cosine: bool = False

    @property
    def spread(self) -> Spread:
        """Over what it spreads."""
        if self.places is None:
            return "everywhere"
        return "wide" if self.breadth >= FADED * self.media.mean_free_path.mean() else "narrow"

    def lengths(self, points: FloatArray) -> FloatArray:
        """Distances of points (q, 3) from it, (q,), unit."""
        return np.zeros(len(points)) if self.places is None else np.asarray(self.places.query(points)[0])

    def distances(self, points: FloatArray) -> FloatArray:
        """The same in mean free paths of where it enters."""
        if self.places is None:
            return np.zeros(len(points))
        lengths, nearest = self.places.query(points)
        return np.asarray(lengths / self.media.mean_free_path[nearest])

    def unknown(self, points: FloatArray) -> BoolArray:
        """Whether errors near it depend on a mean cosine that is not known, at points (q, 3), (q,)."""
        if self.places is None or not self.by_cosine:
            return np.zeros(len(points), dtype=bool)
        return np.asarray(self.media.assumed[self.places.query(points)[1]])

    def errors(self, points: FloatArray) -> FloatArray:
        """Errors at points (q, 3) that come of being near it, (q,)."""
        if self.places is None or self.spread != "narrow":
            return np.zeros(len(points))
        # Within a wide beam the errors of its thin ones cancel more and more, as they are of either sign: see the last
        # table of `tests.tables.validity`. The rim of a beam wider than that is not seen.
        lengths, nearest = self.places.query(points)
        return near_error(self.near[nearest], np.hypot(lengths, self.breadth) / self.media.mean_free_path[nearest])
