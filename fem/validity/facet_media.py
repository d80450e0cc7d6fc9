"""The medium below each boundary facet of a mesh, as the tables of validity need it."""

from dataclasses import dataclass

import numpy as np

from tetlux.fem.ballistic.extinction import optical_depths
from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.tets.march import march
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.thickness import thickness


@dataclass(frozen=True, eq=False)
class LocalMedia:
    """Media at places (q,), by what `tetlux.fem.validity.tables` depends on.

    Attributes
    ----------
    albedo : (q,) ndarray
        Reduced albedo.
    cosine : (q,) ndarray
        Mean cosine of the scattering angle, 0 where it is unknown.
    cosine_assumed : (q,) ndarray of bool
        Where it is unknown.
    mean_free_path : (q,) ndarray
        Transport mean free path, unit.
    """

    albedo: FloatArray
    cosine: FloatArray
    cosine_assumed: BoolArray
    mean_free_path: FloatArray

    def __getitem__(self, some: IntArray) -> "LocalMedia":
        return LocalMedia(self.albedo[some], self.cosine[some], self.cosine_assumed[some], self.mean_free_path[some])


def media_in(coefficients: Coefficients, cells: IntArray) -> LocalMedia:
    """The media of tetrahedra (q,)."""
    total = at_cells(coefficients.sigma_t_prime, cells)
    cosine = at_cells(coefficients.mean_cosine, cells)
    albedo = 1.0 - at_cells(coefficients.sigma_a, cells) / total
    return LocalMedia(albedo, np.nan_to_num(cosine), np.isnan(cosine), 1.0 / total)


def media_under_facets(mesh: TetMesh, coefficients: Coefficients) -> tuple[LocalMedia, FloatArray]:
    """Average the media below the boundary facets, and compute the thickness of the body there.

    Each medium on the way straight in from a facet is weighted by the share of a beam, ``exp(-tau)`` with tau the
    integral of sigma_t', that is lost in it. A layer much thinner than its mean free path thus counts little.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients

    Returns
    -------
    media : LocalMedia
        Of each facet.
    thickness : (f,) ndarray
        Optical depth of sigma_t' through the body, see `tetlux.meshing.tets.thickness`.
    """
    lengths = mesh.cache.get(thickness, lambda: thickness(mesh))
    at_facet = media_in(coefficients, mesh.boundary_cells)
    if coefficients.uniform:
        return at_facet, lengths / at_facet.mean_free_path
    count = len(lengths)
    middles = mesh.points[mesh.boundary_faces].mean(axis=1)
    sums, depth = np.zeros((5, count)), np.zeros(count)
    for part in march(mesh, middles, -mesh.surface.normals, lengths, mesh.boundary_cells, keep=False):
        cells = np.where(part.cells >= 0, part.cells, mesh.boundary_cells[part.paths])
        local = media_in(coefficients, cells)
        step = (part.leave - part.enter) / local.mean_free_path
        lost = np.exp(-optical_depths(part, coefficients.sigma_t_prime, cells)) * -np.expm1(-step)
        values = (np.ones(len(step)), local.albedo, local.cosine, local.cosine_assumed, local.mean_free_path)
        sums += [np.bincount(part.paths, lost * value, minlength=count) for value in values]
        depth += np.bincount(part.paths, step, minlength=count)
    crossed = sums[0] > 0
    albedo, cosine, assumed, free_path = sums[1:] / np.where(crossed, sums[0], 1.0)
    media = LocalMedia(
        np.where(crossed, albedo, at_facet.albedo),
        np.where(crossed, cosine, at_facet.cosine),
        np.where(crossed, assumed > 0.5, at_facet.cosine_assumed),
        np.where(crossed, free_path, at_facet.mean_free_path),
    )
    return media, depth
