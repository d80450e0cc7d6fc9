"""`Entry`: where one light enters a body, and the expected errors of diffusion near there."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.validity.facet_media import LocalMedia, media_in
from tetlux.fem.validity.tables import NEAR_LIMIT, Spread, near_error, near_rows
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Entry:
    """Places where a light enters the body, or its point sources.

    Attributes
    ----------
    places : cKDTree, optional
        None for diffuse or emitted light, which is everywhere.
    media : LocalMedia
        The medium at each of the places (p,).
    radius : float
        Radius of a uniform disc with the same mean square spread, unit.
    near : (p, 6) ndarray
        Expected errors by distance from each place, see `tables.near_rows`.
    by_cosine : bool
        Whether these errors depend on the mean cosine of scattering.
    """

    places: cKDTree | None
    media: LocalMedia
    radius: float
    near: FloatArray
    by_cosine: bool = False

    @property
    def spread(self) -> Spread:
        """How far the light spreads, compared with the range of errors near it."""
        if self.places is None:
            return "everywhere"
        return "wide" if self.radius >= NEAR_LIMIT * self.media.mean_free_path.mean() else "narrow"

    def lengths(self, points: FloatArray) -> FloatArray:
        """Distances of points (q, 3) from the nearest place, (q,), unit; 0 for light everywhere."""
        return np.zeros(len(points)) if self.places is None else np.asarray(self.places.query(points)[0])

    def distances(self, points: FloatArray) -> FloatArray:
        """The same in transport mean free paths at that place."""
        if self.places is None:
            return np.zeros(len(points))
        lengths, nearest = self.places.query(points)
        return np.asarray(lengths / self.media.mean_free_path[nearest])

    def lacks_cosine(self, points: FloatArray) -> BoolArray:
        """Whether the errors at points (q, 3) depend on a mean cosine that is unknown, (q,)."""
        if self.places is None or not self.by_cosine:
            return np.zeros(len(points), dtype=bool)
        return np.asarray(self.media.cosine_assumed[self.places.query(points)[1]])

    def errors(self, points: FloatArray) -> FloatArray:
        """Expected errors at points (q, 3) from being near the light, (q,)."""
        if self.places is None or self.spread != "narrow":
            return np.zeros(len(points))
        # The errors of thin beams have either sign and cancel within a beam of some radius: see the last table of
        # `tests.tables.validity`. The rim of a wide beam is neglected.
        lengths, nearest = self.places.query(points)
        return near_error(self.near[nearest], np.hypot(lengths, self.radius) / self.media.mean_free_path[nearest])


def entry_of(deposit: Deposit, mesh: TetMesh, coefficients: Coefficients, below: LocalMedia) -> Entry:
    """Find where a light enters a body.

    Parameters
    ----------
    deposit : Deposit
        What the light leaves in it.
    mesh : TetMesh
    coefficients : Coefficients
    below : LocalMedia
        The media below each facet of the boundary.

    Returns
    -------
    Entry
    """

    def media_at(places: FloatArray, is_beam: bool) -> LocalMedia:
        _, facets, _ = mesh.closest_boundary(places)
        if is_beam:
            return below[facets]
        cells, _ = mesh.locate(places)
        return media_in(coefficients, np.where(cells >= 0, cells, mesh.boundary_cells[facets]))

    return entry_in(deposit, media_at)


def entry_in(deposit: Deposit, media_at: Callable[[FloatArray, bool], LocalMedia]) -> Entry:
    """Find where a light enters a body of which `media_at` tells the media at places (p, 3), of beams or sources."""
    footprint = deposit.footprint
    is_beam = len(footprint.entries) > 0
    places = footprint.entries if is_beam else deposit.terms.points
    if len(places) == 0:
        return Entry(None, media_at(np.zeros((0, 3)), True), np.inf, np.zeros((0, 6)))
    media = media_at(places, is_beam)
    cosine = None
    if is_beam:
        # A thin beam as one point is itself wrong where scattering is isotropic; with forward scattering a point and a
        # line are equally good, and a line is as good as that whatever the scattering.
        cosine = media.cosine if footprint.beams_as_points else np.ones(len(places))
    radius = footprint.radius
    if radius is None:
        radius = float(np.sqrt(2.0 * ((places - places.mean(axis=0)) ** 2).sum(axis=1).mean()))
    near = near_rows(media.albedo, cosine)
    return Entry(cKDTree(places), media, radius, near, is_beam and footprint.beams_as_points)
