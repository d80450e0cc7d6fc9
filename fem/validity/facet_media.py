"""What medium light meets first below each facet of a mesh, as far as the tables of validity ask for it."""

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
    """Media at places: what `tetlux.fem.validity.tables` needs of them.

    Attributes
    ----------
    albedo : (q,) ndarray
        Reduced albedo.
    cosine : (q,) ndarray
        Mean cosine of the scattering angle, 0 where it is not known.
    assumed : (q,) ndarray of bool
        Where it is not known.
    mean_free_path : (q,) ndarray
        Unit.
    """

    albedo: FloatArray
    cosine: FloatArray
    assumed: BoolArray
    mean_free_path: FloatArray

    def __getitem__(self, some: IntArray) -> "LocalMedia":
        return LocalMedia(self.albedo[some], self.cosine[some], self.assumed[some], self.mean_free_path[some])


def media_in(coefficients: Coefficients, cells: IntArray) -> LocalMedia:
    """Those of tetrahedra (q,)."""
    total = at_cells(coefficients.sigma_t_prime, cells)
    cosine = at_cells(coefficients.mean_cosine, cells)
    albedo = 1.0 - at_cells(coefficients.sigma_a, cells) / total
    return LocalMedia(albedo, np.nan_to_num(cosine), np.isnan(cosine), 1.0 / total)


def media_under_facets(mesh: TetMesh, coefficients: Coefficients) -> tuple[LocalMedia, FloatArray]:
    """Media below the facets of the boundary, and how thick the body is there.

    Light that goes straight in is lost from its way by ``exp(-tau)``, tau the integral of sigma_t'; each medium counts
    by what is lost in it. In one medium that is the medium; a layer much thinner than its mean free path counts little.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients

    Returns
    -------
    media : LocalMedia
        Of each facet.
    thickness : (f,) ndarray
        `tetlux.meshing.tets.thickness`, as optical depth: in mean free paths of what is on the way.
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
        here = media_in(coefficients, cells)
        step = (part.leave - part.enter) / here.mean_free_path
        lost = np.exp(-optical_depths(part, coefficients.sigma_t_prime, cells)) * -np.expm1(-step)
        each = (np.ones(len(step)), here.albedo, here.cosine, here.assumed, here.mean_free_path)
        sums += [np.bincount(part.paths, lost * value, minlength=count) for value in each]
        depth += np.bincount(part.paths, step, minlength=count)
    some = sums[0] > 0
    albedo, cosine, assumed, free_path = sums[1:] / np.where(some, sums[0], 1.0)
    media = LocalMedia(
        np.where(some, albedo, at_facet.albedo),
        np.where(some, cosine, at_facet.cosine),
        np.where(some, assumed > 0.5, at_facet.assumed),
        np.where(some, free_path, at_facet.mean_free_path),
    )
    return media, depth
