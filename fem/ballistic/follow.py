"""Beams followed through the tetrahedra of a mesh: faded, reflected at the inside, let out, and met again.

Rays refract and reflect at the mesh's own flat facets, whose tilt is right on average to second order in their size.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tetlux.fem.media.coefficients import Coefficients, at_cells
from tetlux.fem.media.fresnel import reflectance
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.search.cell_tree import PathSegments
from tetlux.meshing.search.rays import OFFSET
from tetlux.meshing.surface.triangles import triangle_areas
from tetlux.meshing.tets.march import march
from tetlux.meshing.tets.mesh import TetMesh

# What a ray still carries when it has faded to this share of the average ray's power stays where the rest of it did.
FAINTEST = 1e-10
# What is reflected, or comes in again, with less than this share of what would be lost on its way stays at its facet:
# tolerances end at 1e-4.
FAINTEST_AGAIN = 1e-6
# And through so many reflections and crossings of gaps.
MOST_MEETINGS = 64

_UNKNOWN = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Rays:
    """Thin beams.

    Parameters
    ----------
    starts, directions : (r, 3) ndarray
        Directions are unit vectors.
    powers : (r,) ndarray
        W.
    cells : (r,) ndarray, optional
        The tetrahedra of a mesh in which they begin; -1, as when not given, where not known.
    """

    starts: FloatArray
    directions: FloatArray
    powers: FloatArray
    cells: IntArray = field(default_factory=lambda: _UNKNOWN)

    def __post_init__(self) -> None:
        if self.cells is _UNKNOWN:
            object.__setattr__(self, "cells", np.full(len(self.powers), -1))

    def __getitem__(self, some: BoolArray) -> "Rays":
        return Rays(self.starts[some], self.directions[some], self.powers[some], self.cells[some])

    __repr__ = one_line


def join_rays(parts: list[Rays]) -> Rays:
    """All rays of several parts."""
    return Rays(
        np.vstack([np.zeros((0, 3)), *(part.starts for part in parts)]),
        np.vstack([np.zeros((0, 3)), *(part.directions for part in parts)]),
        np.concatenate([np.zeros(0), *(part.powers for part in parts)]),
        np.concatenate([_UNKNOWN, *(part.cells for part in parts)]),
    )


def entered(rays: Rays, normals: FloatArray, eta: float) -> tuple[Rays, float]:
    """Rays that met facets from outside, refracted by Snell's law, and the power that was reflected (Fresnel), W."""
    cosine = np.clip(-np.einsum("ij,ij->i", rays.directions, normals), 0.0, 1.0)
    lost = reflectance(cosine, 1.0 / eta)
    inside = np.sqrt(np.maximum(1.0 - (1.0 - cosine**2) / eta**2, 0.0))
    refracted = rays.directions / eta + (cosine / eta - inside)[:, None] * normals
    refracted /= np.linalg.norm(refracted, axis=1, keepdims=True)
    # From a denser medium into a thinner one nothing passes beyond the critical angle.
    passed = lost < 1.0
    specular = float(rays.powers @ lost)
    return Rays(rays.starts, refracted, (1.0 - lost) * rays.powers, rays.cells)[passed], specular


def optical_depths(part: PathSegments, extinction: float | FloatArray, cells: IntArray) -> FloatArray:
    """Optical depth at which each segment begins, on its own path, (s,)."""
    if np.ndim(extinction) == 0:
        return np.asarray(extinction * part.enter)
    depth = at_cells(extinction, cells) * (part.leave - part.enter)
    order = np.lexsort((part.enter, part.paths))
    total = np.cumsum(depth[order])
    before = total - depth[order]
    first = np.diff(part.paths[order], prepend=-1) > 0
    before -= before[first][np.cumsum(first) - 1]
    result = np.empty(len(before))
    result[order] = before
    return result


def cells_of(
    mesh: TetMesh, coefficients: Coefficients, part: PathSegments, starts: FloatArray, directions: FloatArray
) -> IntArray:
    """The tetrahedron whose coefficients each segment has: the nearest one where the segment is outside the mesh."""
    if coefficients.uniform:
        return part.cells
    cells = part.cells.copy()
    lost = np.flatnonzero(cells < 0)
    if len(lost):
        paths, middle = part.paths[lost], 0.5 * (part.enter + part.leave)[lost]
        places = starts[paths] + middle[:, None] * directions[paths]
        cells[lost] = mesh.boundary_cells[mesh.closest_boundary(places)[1]]
    return cells


def _fade(mesh: TetMesh, coefficients: Coefficients, rays: Rays, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Power at the end of each path, and what is absorbed along it, (r,), W."""
    extinction, sigma_a = coefficients.extinction, coefficients.sigma_a
    if coefficients.uniform:
        ends = rays.powers * np.exp(-extinction * lengths)
        return ends, (rays.powers - ends) * sigma_a / extinction
    depth, absorbed = np.zeros((2, len(lengths)))
    for part in march(mesh, rays.starts, rays.directions, lengths, rays.cells):
        cells = cells_of(mesh, coefficients, part, rays.starts, rays.directions)
        here, step = at_cells(extinction, cells), part.leave - part.enter
        carried = rays.powers[part.paths] * np.exp(-optical_depths(part, extinction, cells))
        lost = carried * -np.expm1(-here * step) * at_cells(sigma_a, cells) / here
        absorbed += np.bincount(part.paths, lost, minlength=len(depth))
        depth += np.bincount(part.paths, here * step, minlength=len(depth))
    return rays.powers * np.exp(-depth), absorbed


def follow(mesh: TetMesh, coefficients: Coefficients, rays: Rays) -> Deposit:
    """Follow beams that start just inside the boundary of a mesh.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients
    rays : Rays

    Returns
    -------
    Deposit
        Their segments, and what of their power was absorbed, left the body, or was reflected at it from outside.
    """
    rays = _placed(mesh, rays)
    average = float(rays.powers.sum()) / max(len(rays.powers), 1)
    # Nothing is left after so long a way.
    longest = -np.log(FAINTEST) / float(np.min(coefficients.extinction))
    segments, lengths_of, stopped, absorbed, ballistic, specular = [], [], [], 0.0, 0.0, 0.0
    for _ in range(MOST_MEETINGS):
        if len(rays.powers) == 0:
            break
        distances, met = mesh.rays.first(rays.starts, rays.directions)
        # At the very rim of a facet a ray may be out before it was in, and one that grazes a facet meets it for ever.
        slipped = (met < 0) | (distances < OFFSET * mesh.diagonal)
        ballistic += float(rays.powers[slipped].sum())
        rays, distances, met = rays[~slipped], distances[~slipped], met[~slipped]
        if len(rays.powers) == 0:
            break
        lengths = np.minimum(distances, longest)
        ends, lost = _fade(mesh, coefficients, rays, lengths)
        faded = rays.powers - ends
        share = 1.0 - float(ends.sum()) / float(rays.powers.sum())
        stays = (faded > 0) & ((ends <= FAINTEST * average) | (lengths < distances))
        # Of these all is spread on their way as what faded there is.
        whole = np.where(stays, rays.powers / np.where(stays, faded, 1.0), 1.0)
        absorbed += float(lost @ whole)
        segments.append(replace(rays, powers=whole * rays.powers))
        lengths_of.append(lengths)
        arrived = Rays(rays.starts + lengths[:, None] * rays.directions, rays.directions, ends)
        rays, gone, reflected = beyond(mesh, coefficients, arrived[~stays], met[~stays])
        ballistic += gone
        specular += reflected
        faint = rays.powers <= FAINTEST_AGAIN * average * share
        stopped.append(rays[faint])
        rays = rays[~faint]
    every, left = join_rays(segments), join_rays([*stopped, rays])
    # What is stopped at a facet is in the tetrahedron behind it.
    scattered = at_cells(coefficients.scattering / coefficients.extinction, left.cells) * left.powers
    absorbed += float((left.powers - scattered).sum())
    return Deposit(
        points=left.starts,
        powers=scattered,
        homes=left.cells,
        specular=specular,
        absorbed=absorbed,
        ballistic=ballistic,
        starts=every.starts,
        directions=every.directions,
        lengths=np.concatenate([np.zeros(0), *lengths_of]),
        fluxes=every.powers,
        cells=every.cells,
    )


def _placed(mesh: TetMesh, rays: Rays) -> Rays:
    """The same rays, and behind which facets they begin where that was not known.

    A guess, which `march` does not rely on: the first facet that is met from a little before the start.
    """
    unknown = np.flatnonzero(rays.cells < 0)
    before = rays.starts[unknown] - 2.0 * OFFSET * mesh.diagonal * rays.directions[unknown]
    _, facets = mesh.rays.first(before, rays.directions[unknown])
    cells = rays.cells.copy()
    cells[unknown] = np.where(facets >= 0, mesh.boundary_cells[facets], -1)
    return replace(rays, cells=cells)


def beyond(mesh: TetMesh, coefficients: Coefficients, arrived: Rays, met: IntArray) -> tuple[Rays, float, float]:
    """What becomes of rays that meet boundary facets from inside.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients
    arrived : Rays
        They end on facets.
    met : (r,) ndarray
        These facets.

    Returns
    -------
    rays : Rays
        Reflected there, or let out and in again where they meet another part of the body.
    ballistic, specular : float
        Power that is gone, and that was reflected where rays came in again, W.
    """
    eta = coefficients.outer.eta
    normals, _ = triangle_areas(mesh.points, mesh.boundary_faces[met])
    inner, outer = _at_boundary(replace(arrived, cells=mesh.boundary_cells[met]), normals, eta)
    distances, hit = mesh.rays.first(outer.starts, outer.directions)
    normals, _ = triangle_areas(mesh.points, mesh.boundary_faces[hit])
    again = (hit >= 0) & (np.einsum("ij,ij->i", outer.directions, normals) < 0)
    places = outer.starts + np.where(again, distances, 0.0)[:, None] * outer.directions
    met_again = Rays(places, outer.directions, outer.powers, mesh.boundary_cells[hit])[again]
    coming, specular = entered(met_again, normals[again], eta)
    return join_rays([inner, coming]), float(outer.powers[~again].sum()), specular


def _at_boundary(rays: Rays, normals: FloatArray, eta: float) -> tuple[Rays, Rays]:
    """What of rays that meet the boundary from inside stays in, and what goes out."""
    cosine = np.clip(np.einsum("ij,ij->i", rays.directions, normals), 0.0, 1.0)
    reflected = reflectance(cosine, eta)
    back = rays.directions - 2.0 * cosine[:, None] * normals
    inner = Rays(rays.starts, back, reflected * rays.powers, rays.cells)[reflected > 0]
    outside = np.sqrt(np.maximum(1.0 - eta**2 * (1.0 - cosine**2), 0.0))
    out = eta * rays.directions + (outside - eta * cosine)[:, None] * normals
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    return inner, Rays(rays.starts, out, (1.0 - reflected) * rays.powers)[reflected < 1]
