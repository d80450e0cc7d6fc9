"""What the media of a body are on each tetrahedron of a mesh."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.medium import Medium
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.tetmesh import TetMesh


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients of the tetrahedra of a mesh; a number where they are all alike.

    Attributes
    ----------
    sigma_a, sigma_t_prime : float or (m,) ndarray
        Absorption and reduced transport coefficient, 1/unit.
    scattering, cosine : float or (m,) ndarray
        Scattering coefficient (1/unit) and mean cosine with the forward peak taken out, see
        `Medium.delta_eddington`.
    outer : Medium
        The medium whose index and boundary the whole body shares.
    """

    sigma_a: float | FloatArray
    sigma_t_prime: float | FloatArray
    scattering: float | FloatArray
    cosine: float | FloatArray
    outer: Medium

    @property
    def uniform(self) -> bool:
        """Whether they are numbers."""
        return np.ndim(self.extinction) == 0

    @property
    def diffusion(self) -> float | FloatArray:
        """D = 1/(3 sigma_t') (CS667 notes, eq. 9), unit."""
        return 1.0 / (3.0 * self.sigma_t_prime)

    @property
    def extinction(self) -> float | FloatArray:
        """Of a beam with the forward peak left in it: sigma_t* = sigma_a + sigma_s*, 1/unit."""
        return self.sigma_a + self.scattering

    @property
    def escape(self) -> float:
        """1/(2A) of the boundary condition."""
        return 0.5 / self.outer.boundary_factor


def coefficients_of(medium: Medium) -> Coefficients:
    """Coefficients of a body of one medium."""
    scattering, cosine = medium.delta_eddington
    return Coefficients(medium.sigma_a, medium.sigma_t_prime, scattering, cosine, medium)


def at_cells(value: float | FloatArray, cells: IntArray) -> FloatArray:
    """A coefficient in given tetrahedra, (q,)."""
    return np.full(len(cells), value) if np.ndim(value) == 0 else np.asarray(value)[cells]


def coefficients_on(mesh: TetMesh, media: Sequence[Medium]) -> Coefficients:
    """Coefficients of a mesh whose region i is of medium i."""
    if len(media) == 1:
        return coefficients_of(media[0])
    each = [coefficients_of(medium) for medium in media]

    def of(name: str) -> FloatArray:
        return np.array([getattr(one, name) for one in each])[mesh.regions]

    return Coefficients(of("sigma_a"), of("sigma_t_prime"), of("scattering"), of("cosine"), media[0])
