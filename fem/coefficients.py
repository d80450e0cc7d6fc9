"""What the media of a body are on each tetrahedron of a mesh."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.medium import Medium
from tetlux.fem.varying import VaryingMedium
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.tetmesh import TetMesh

AnyMedium = Medium | VaryingMedium
# Barycentric coordinates of the points of a rule that is exact for quadratics, each of the same weight.
_WITHIN = np.full((4, 4), 0.1381966011250105) + (0.5854101966249685 - 0.1381966011250105) * np.eye(4)


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

    __repr__ = one_line


def coefficients_of(medium: Medium) -> Coefficients:
    """Coefficients of a body of one medium."""
    scattering, cosine = medium.delta_eddington
    return Coefficients(medium.sigma_a, medium.sigma_t_prime, scattering, cosine, medium)


def apart(one: Coefficients, other: Coefficients) -> float:
    """How far apart the ratios of two sets of coefficients are, the largest over the smallest, on one mesh.

    For any fluence the terms of the one's weak form are within these ratios of the other's, and so is their sum: this
    bounds the condition number of the one's matrix when it is preconditioned by the other's.
    """
    ratios = []
    for name in ("diffusion", "sigma_a", "escape"):
        first, second = np.broadcast_arrays(getattr(one, name), getattr(other, name))
        some = (first > 0) | (second > 0)
        with np.errstate(divide="ignore"):
            ratios.append(np.ravel(first[some] / second[some]))
    every = np.concatenate(ratios)
    return float(every.max() / every.min()) if every.min() > 0 else np.inf


def at_cells(value: float | FloatArray, cells: IntArray) -> FloatArray:
    """A coefficient in given tetrahedra, (q,)."""
    return np.full(len(cells), value) if np.ndim(value) == 0 else np.asarray(value)[cells]


def coefficients_on(mesh: TetMesh, media: Sequence[AnyMedium]) -> Coefficients:
    """Coefficients of a mesh whose region i is of medium i.

    Raises
    ------
    InputError
        If a coefficient that varies is not known, or not sensible, somewhere on the mesh; or if the mesh has other
        regions than there are media. One medium is that of the whole mesh.
    """
    outer = base_of(media[0])
    if len(media) == 1 and isinstance(media[0], Medium):
        return coefficients_of(media[0])
    regions = mesh.regions if len(media) > 1 else np.zeros_like(mesh.regions)
    _check_regions(np.bincount(regions, minlength=len(media)), len(media))
    values = np.empty((4, len(mesh.tetrahedra)))
    for region, medium in enumerate(media):
        inside = np.flatnonzero(regions == region)
        if isinstance(medium, Medium):
            values[:, inside] = np.array([medium.sigma_a, medium.sigma_t_prime, *medium.delta_eddington])[:, None]
            continue
        # The mean of four points in each tetrahedron, which is exact for what changes quadratically.
        points = _WITHIN @ mesh.points[mesh.tetrahedra[inside]]
        at = medium.at(points.reshape(-1, 3))
        absorption, reduced = (value.reshape(-1, 4).mean(axis=1) for value in at)
        peaked, forward = medium.delta_eddington(reduced)
        values[:, inside] = absorption, absorption + reduced, peaked, np.full(len(inside), forward)
    each: list[FloatArray] = list(values)
    return Coefficients(each[0], each[1], each[2], each[3], outer)


def _check_regions(sizes: IntArray, media: int) -> None:
    """Refuse a mesh whose regions, by their numbers of tetrahedra, are not those that media are given for."""
    if len(sizes) > media:
        raise InputError(f"the mesh has {len(sizes) - 1} regions, and {media - 1} have a medium; give one for each.")
    for region in range(1, media):
        if sizes[region] == 0:
            raise InputError(f"the mesh has no region {region}; make one that has, or leave the region out.")


def at_surface(medium: AnyMedium, mesh: TetMesh, coefficients: Coefficients) -> Medium:
    """One medium for what is under the surface: the body's own, or the mean of one that varies."""
    if isinstance(medium, Medium):
        return medium
    cells, areas = mesh.boundary_cells, mesh.boundary_areas / mesh.area
    sigma_a, total = (float(areas @ at_cells(v, cells)) for v in (coefficients.sigma_a, coefficients.sigma_t_prime))
    base, scattering = medium.base, total - sigma_a
    if base.sigma_s is None:
        return replace(base, sigma_a=sigma_a, sigma_s_prime=scattering)
    return replace(base, sigma_a=sigma_a, sigma_s=base.sigma_s * scattering / base.reduced_scattering)


def base_of(medium: AnyMedium) -> Medium:
    """The medium itself, or what stands for one that varies."""
    return medium if isinstance(medium, Medium) else medium.base
