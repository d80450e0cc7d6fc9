"""`Validity`: how far the diffusion approximation itself is expected to be off, place by place on a surface."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from tetlux.fem.lights.collimated import CollimatedBeam
from tetlux.fem.lights.deposit import Deposit, Light
from tetlux.fem.lights.pencil import PencilBeam
from tetlux.fem.medium import Medium
from tetlux.fem.validity_tables import (
    FADED,
    NearRow,
    Spread,
    far_error,
    near_error,
    near_row,
    thin_error,
    wide_error,
)
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tetmesh import TetMesh
from tetlux.meshing.thickness import thickness


@dataclass(frozen=True, eq=False)
class Validity:
    """What is to be expected of the diffusion approximation on the surface of a body.

    It follows from coefficients, geometry and light alone: the relative error of the exitance by each of several
    causes, as Monte Carlo has them (`tetlux.fem.validity_tables`), of which the largest counts. They are of one medium
    throughout; regions are not looked at.

    Parameters
    ----------
    mesh : TetMesh
        Its boundary is looked at.
    medium : Medium
        Of the body.
    lights : sequence of Light
    deposits : sequence of Deposit
        What each of them leaves in the body.
    """

    mesh: TetMesh
    medium: Medium
    lights: Sequence[Light]
    deposits: Sequence[Deposit]

    def at(self, points: FloatArray) -> FloatArray:
        """1 less the expected relative error of the exitance, not below 0, at points (q, 3) of the surface, (q,)."""
        _, facets, _ = self.mesh.closest_boundary(points)
        return np.asarray(np.maximum(1.0 - self.errors(points, facets), 0.0))

    def errors(self, points: FloatArray, facets: IntArray) -> FloatArray:
        """Expected relative errors of the exitance at points (q, 3) of given facets of the boundary (q,), (q,)."""
        causes = [np.full(len(points), wide_error(self.medium)), self.thin_errors[facets]]
        causes += [far_error(self.medium, self.distances(points)), self.near_errors(points)]
        return np.asarray(np.max(causes, axis=0))

    def distances(self, points: FloatArray) -> FloatArray:
        """How far points (q, 3) are from where light enters, or from a source, (q,), mean free paths.

        They are 0 where there is light from everywhere, diffuse or emitted.
        """
        return np.asarray(np.min([entry.distances(points) for entry in self._entries], axis=0))

    def near_errors(self, points: FloatArray) -> FloatArray:
        """Expected errors of the exitance at points (q, 3) that come of being near a light, (q,)."""
        return np.asarray(np.max([entry.errors(points) for entry in self._entries], axis=0))

    @cached_property
    def thickness(self) -> FloatArray:
        """How thick the body is under each facet of the boundary, (f,), mean free paths."""
        of_mesh = self.mesh.remembered(thickness, lambda: thickness(self.mesh))
        return of_mesh / self.medium.mean_free_path

    @cached_property
    def thin_errors(self) -> FloatArray:
        """Expected errors that come of the body's thickness under each facet of the boundary, (f,)."""
        errors = [thin_error(self.medium, self.thickness, entry.spread) for entry in self._entries]
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
        lights = zip(self.lights, self.deposits, strict=True)
        return [_entry_of(light, deposit, self.medium) for light, deposit in lights]

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class _Entry:
    """Where a light enters, or its points are.

    Attributes
    ----------
    places : cKDTree, optional
        In mean free paths; light from everywhere has none.
    unit : float
        The mean free path.
    breadth : float
        Radius of an even disc that spreads as much, mean free paths.
    near : NearRow
        Errors by distance.
    """

    places: cKDTree | None
    unit: float
    breadth: float
    near: NearRow

    @property
    def spread(self) -> Spread:
        """Over what it spreads."""
        if self.places is None:
            return "everywhere"
        return "wide" if self.breadth >= FADED else "narrow"

    def distances(self, points: FloatArray) -> FloatArray:
        """Distances of points (q, 3) from it, (q,), mean free paths."""
        if self.places is None:
            return np.zeros(len(points))
        return np.asarray(self.places.query(points / self.unit)[0])

    def errors(self, points: FloatArray) -> FloatArray:
        """Errors at points (q, 3) that come of being near it, (q,)."""
        if self.spread != "narrow":
            return np.zeros(len(points))
        # Within a wide beam the errors of its thin ones cancel more and more, as they are of either sign: see the last
        # table of `tests.tables.validity`. The rim of a beam wider than that is not seen.
        return near_error(self.near, np.hypot(self.distances(points), self.breadth))


def _entry_of(light: Light, deposit: Deposit, medium: Medium) -> _Entry:
    unit = medium.mean_free_path
    sources = len(deposit.entries) == 0
    places = deposit.points if sources else deposit.entries
    # The deposit of a thin beam in one point is at fault itself where scattering is isotropic; a line is as good there
    # as either is where scattering is forward.
    in_a_point = isinstance(light, PencilBeam) and light.deposit == "point"
    near = near_row(medium, None if sources else medium.mean_cosine if in_a_point else 1.0)
    if len(places) == 0:
        return _Entry(None, unit, np.inf, near)
    breadth = np.inf
    if not isinstance(light, CollimatedBeam) or light.spot is not None:
        breadth = float(np.sqrt(2.0 * ((places - places.mean(axis=0)) ** 2).sum(axis=1).mean())) / unit
    return _Entry(cKDTree(places / unit), unit, breadth, near)
