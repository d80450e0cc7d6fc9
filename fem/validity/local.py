"""`Validity`: expected errors of the diffusion approximation itself, place by place on a surface."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.validity.entry import Entry, entry_of
from tetlux.fem.validity.facet_media import LocalMedia, media_under_facets
from tetlux.fem.validity.tables import far_error, thin_error, wide_error
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh

# What is below the facets, by the coefficients of a mesh.
_UNDER_FACETS: WeakKeyDictionary[Coefficients, tuple[LocalMedia, FloatArray]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Validity:
    """Expected relative error of the exitance by the diffusion approximation, compared with radiative transfer.

    It follows from coefficients, geometry and light alone: of the errors by several causes, as Monte Carlo gives them
    (`tetlux.fem.validity.tables`), the largest counts. The tables are of one medium. In a body of several media, each
    facet has the medium below it (`tetlux.fem.validity.facet_media`), and places near a light the medium where that
    light enters.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients
        Of its tetrahedra.
    deposits : sequence of Deposit
        What each light leaves in the body.
    """

    mesh: TetMesh
    coefficients: Coefficients
    deposits: Sequence[Deposit]

    def at(self, points: FloatArray) -> FloatArray:
        """Compute the validity of the diffusion approximation.

        Parameters
        ----------
        points : (q, 3) ndarray
            On the surface, unit.

        Returns
        -------
        (q,) ndarray
            1 minus the expected relative error of the exitance, not below 0.
        """
        _, facets, _ = self.mesh.closest_boundary(points)
        return np.asarray(np.maximum(1.0 - self.errors(points, facets), 0.0))

    def errors(self, points: FloatArray, facets: IntArray) -> FloatArray:
        """Compute the expected relative errors of the exitance.

        Parameters
        ----------
        points : (q, 3) ndarray
            On the surface, unit.
        facets : (q,) ndarray
            The boundary facets that they lie on.

        Returns
        -------
        (q,) ndarray
            The largest of the errors by each cause.
        """
        return self._largest(facets, self.far_errors(points, facets), self.near_errors(points))

    def distances(self, points: FloatArray) -> FloatArray:
        """Distances of points (q, 3) from the nearest light, (q,), in transport mean free paths where it enters.

        They are 0 if there is diffuse or emitted light.
        """
        return np.asarray(np.min([entry.distances(points) for entry in self._entries], axis=0))

    def near_errors(self, points: FloatArray) -> FloatArray:
        """Expected errors at points (q, 3) from being near a light, (q,)."""
        return np.asarray(np.max([entry.errors(points) for entry in self._entries], axis=0))

    def far_errors(self, points: FloatArray, facets: IntArray) -> FloatArray:
        """Expected errors at points (q, 3) on given boundary facets (q,) from being far from all light, (q,)."""
        below = self.below[facets]
        lengths = np.min([entry.lengths(points) for entry in self._entries], axis=0)
        return far_error(below.albedo, lengths / below.mean_free_path)

    def lacks_cosine(self, points: FloatArray) -> BoolArray:
        """Whether the mean cosine of scattering is unknown where the light nearest to points (q, 3) enters, (q,)."""
        distances = np.array([entry.distances(points) for entry in self._entries])
        lacks = np.array([entry.lacks_cosine(points) for entry in self._entries])
        return np.asarray(np.take_along_axis(lacks, distances.argmin(axis=0)[None], axis=0)[0])

    @cached_property
    def _under_facets(self) -> tuple[LocalMedia, FloatArray]:
        if self.coefficients.uniform:
            return media_under_facets(self.mesh, self.coefficients)
        # Scenes of one system share its coefficients, which are arrays of its mesh.
        if self.coefficients not in _UNDER_FACETS:
            _UNDER_FACETS[self.coefficients] = media_under_facets(self.mesh, self.coefficients)
        return _UNDER_FACETS[self.coefficients]

    @property
    def below(self) -> LocalMedia:
        """The media below each boundary facet."""
        return self._under_facets[0]

    @property
    def thickness(self) -> FloatArray:
        """Thickness of the body below each boundary facet, (f,), in transport mean free paths."""
        return self._under_facets[1]

    @cached_property
    def mean_chord(self) -> float:
        """Mean optical depth sigma_t' of chords of the body, ``4 ∫ sigma_t' dV / S`` (Cauchy)."""
        mesh, total = self.mesh, self.coefficients.sigma_t_prime
        return float(4.0 * np.sum(total * mesh.volumes) / mesh.area)

    @property
    def albedo(self) -> float:
        """Mean reduced albedo of the media below the surface."""
        return self.mean(self.below.albedo)

    @property
    def steepest(self) -> float:
        """Largest effective attenuation sigma_tr of the boundary tetrahedra, 1/unit."""
        cells = self.mesh.boundary_cells
        sigma_a, total = (at_cells(v, cells) for v in (self.coefficients.sigma_a, self.coefficients.sigma_t_prime))
        return float(np.sqrt(3.0 * sigma_a * total).max())

    @cached_property
    def thin_errors(self) -> FloatArray:
        """Expected errors from the thickness of the body below each boundary facet, (f,)."""
        errors = [thin_error(self.below.cosine, self.thickness, entry.spread) for entry in self._entries]
        return np.asarray(np.max(errors, axis=0))

    @cached_property
    def wide_errors(self) -> FloatArray:
        """Expected errors in wide light by the albedo below each boundary facet, (f,)."""
        return wide_error(self.below.albedo, self.coefficients.outer.eta)

    @cached_property
    def middles(self) -> FloatArray:
        """Centroids of the boundary facets, (f, 3)."""
        return np.asarray(self.mesh.points[self.mesh.boundary_faces].mean(axis=1))

    @cached_property
    def facet_distances(self) -> FloatArray:
        """`distances` of the centroids of the boundary facets, (f,)."""
        return self.distances(self.middles)

    @cached_property
    def facet_near_errors(self) -> FloatArray:
        """`near_errors` at the centroids of the boundary facets, (f,)."""
        return self.near_errors(self.middles)

    @cached_property
    def facet_far_errors(self) -> FloatArray:
        """`far_errors` at the centroids of the boundary facets, (f,)."""
        return self.far_errors(self.middles, np.arange(len(self.middles)))

    @cached_property
    def facet_errors(self) -> FloatArray:
        """`errors` at the centroids of the boundary facets, (f,)."""
        return self._largest(slice(None), self.facet_far_errors, self.facet_near_errors)

    def _largest(self, facets: IntArray | slice, far: FloatArray, near: FloatArray) -> FloatArray:
        """The largest errors of all causes, with those far from and near light at places on given facets."""
        return np.asarray(np.max([self.wide_errors[facets], self.thin_errors[facets], far, near], axis=0))

    def mean(self, values: npt.NDArray[np.float64 | np.bool_]) -> float:
        """Mean over the surface of values of the boundary facets (f,)."""
        return float(self.mesh.boundary_areas @ values) / self.mesh.area

    @cached_property
    def _entries(self) -> list[Entry]:
        return [entry_of(deposit, self.mesh, self.coefficients, self.below) for deposit in self.deposits]

    __repr__ = one_line
