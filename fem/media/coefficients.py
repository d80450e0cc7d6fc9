"""What the media of a body are on each tetrahedron of a mesh."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.media.medium import Medium
from tetlux.fem.media.varying import VaryingMedium
from tetlux.meshing.arrays import FloatArray, IntArray, Number, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.tets.mesh import TetMesh

AnyMedium = Medium | VaryingMedium
# Media by the regions or labels of a mesh that they fill: the body's own, or the outermost, first.
MediaByLabel = Mapping[int, AnyMedium]
# Barycentric coordinates of the points of a rule that is exact for quadratics, each of the same weight.
WITHIN = np.full((4, 4), 0.1381966011250105) + (0.5854101966249685 - 0.1381966011250105) * np.eye(4)


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients of the tetrahedra of a mesh; numbers where the medium is the same throughout.

    Attributes
    ----------
    sigma_a, sigma_t_prime : float or (m,) ndarray
        Absorption and reduced transport coefficient, 1/unit.
    delta_eddington_scattering, delta_eddington_cosine : float or (m,) ndarray
        Scattering coefficient sigma_s* (1/unit) and mean cosine with the forward peak taken out, see
        `Medium.delta_eddington`.
    mean_cosine : float or (m,) ndarray
        Mean cosine of the scattering angle; nan where sigma_s' alone is given.
    outer : Medium
        The medium whose index and boundary the whole body shares.
    shift : complex
        What is added to sigma_a, 1/unit: 0 for steady light, see `tetlux.fem.models.model.Model`.
    """

    sigma_a: float | FloatArray
    sigma_t_prime: float | FloatArray
    delta_eddington_scattering: float | FloatArray
    delta_eddington_cosine: float | FloatArray
    mean_cosine: float | FloatArray
    outer: Medium
    shift: complex = 0.0

    @property
    def sigma(self) -> Number | NumberArray:
        """The coefficient of the fluence in the equation, ``sigma_a + shift``, 1/unit; real for steady light."""
        return self.sigma_a + self.shift if self.shift else self.sigma_a

    @property
    def decay(self) -> float | FloatArray:
        """Modulus of ``k = sqrt(sigma/D)``, over whose inverse the fluence changes, 1/unit."""
        return np.sqrt(np.abs(self.sigma) / self.diffusion)

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
        return self.sigma_a + self.delta_eddington_scattering

    __repr__ = one_line


def coefficients_of(medium: Medium) -> Coefficients:
    """Coefficients of a body of one medium."""
    scattering, cosine = medium.delta_eddington
    return Coefficients(medium.sigma_a, medium.sigma_t_prime, scattering, cosine, known_cosine(medium), medium)


def at_cells(value: float | FloatArray, cells: IntArray) -> FloatArray:
    """A coefficient in given tetrahedra, (q,)."""
    return np.full(len(cells), value) if np.ndim(value) == 0 else np.asarray(value)[cells]


def by_label(media: MediaByLabel | Sequence[AnyMedium]) -> MediaByLabel:
    """Media by label: those of a sequence are of the body, and of its regions 1, 2, ..."""
    return media if isinstance(media, Mapping) else dict(enumerate(media))


def coefficients_on(mesh: TetMesh, media: MediaByLabel | Sequence[AnyMedium]) -> Coefficients:
    """Coefficients of a mesh.

    Parameters
    ----------
    mesh : TetMesh
    media : mapping of int to medium, or sequence of medium
        By label; of a sequence medium i is that of region i. One medium is that of the whole mesh.

    Raises
    ------
    InputError
        If a coefficient that varies is not known, or not sensible, somewhere on the mesh; or if labels and media do not
        go together.
    """
    labelled = by_label(media)
    outer = next(iter(labelled.values()))
    if len(labelled) == 1 and isinstance(outer, Medium):
        return coefficients_of(outer)
    if isinstance(media, Mapping):
        check_labels(mesh, media)
    elif len(media) > 1:
        _check_regions(mesh, len(media))
    values = np.empty((5, len(mesh.tetrahedra)))
    for label, medium in labelled.items():
        inside = np.flatnonzero(mesh.regions == label) if len(labelled) > 1 else np.arange(len(mesh.tetrahedra))
        if isinstance(medium, Medium):
            constants = [medium.sigma_a, medium.sigma_t_prime, *medium.delta_eddington, known_cosine(medium)]
            values[:, inside] = np.array(constants)[:, None]
            continue
        # The mean of four points in each tetrahedron, which is exact for what changes quadratically.
        points = WITHIN @ mesh.points[mesh.tetrahedra[inside]]
        at = medium.at(points.reshape(-1, 3))
        absorption, reduced = (value.reshape(-1, 4).mean(axis=1) for value in at)
        peaked, forward = medium.delta_eddington(reduced)
        values[:4, inside] = absorption, absorption + reduced, peaked, np.full(len(inside), forward)
        values[4, inside] = known_cosine(medium.base)
    each: list[FloatArray] = list(values)
    return Coefficients(each[0], each[1], each[2], each[3], each[4], base_of(outer))


def check_labels(mesh: TetMesh, labels: Iterable[int]) -> None:
    """Refuse labels of a mesh that have no medium, and media of labels that it does not have.

    Raises
    ------
    InputError
    """
    given = dict.fromkeys(labels)
    without = [label for label in mesh.region_volumes if label not in given]
    if without:
        several = len(without) > 1
        raise InputError(
            f"the mesh's {'labels' if several else 'label'} {mesh.label_text(without)} {'have' if several else 'has'} "
            "no medium; give one for each."
        )
    none = [label for label in given if label not in mesh.region_volumes]
    if none:
        raise InputError(
            f"the mesh has no label {' and '.join(map(str, none))}; its labels are "
            f"{mesh.label_text(mesh.region_volumes)}."
        )


def _check_regions(mesh: TetMesh, media: int) -> None:
    """Refuse a mesh whose regions are not those that media are given for."""
    most = max(mesh.region_volumes)
    if most >= media:
        raise InputError(f"the mesh has {most} regions, and {media - 1} have a medium; give one for each.")
    for region in range(1, media):
        if region not in mesh.region_volumes:
            raise InputError(f"the mesh has no region {region}; make one that has, or leave the region out.")


def known_cosine(medium: Medium) -> float:
    """Mean cosine of a medium's scattering angle, nan if sigma_s' alone is given."""
    return medium.mean_cosine if medium.sigma_s is not None else np.nan


def base_of(medium: AnyMedium) -> Medium:
    """The medium itself, or that of the index, the boundary and the shape of scattering of one that varies."""
    return medium if isinstance(medium, Medium) else medium.base
