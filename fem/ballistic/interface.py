"""Refraction and reflection at the boundary (Snell, Fresnel for unpolarised light).

Rays meet the flat facets of the mesh. The tilt of facets relative to the curved surface averages out to second order
in their size.
"""

from dataclasses import replace

import numpy as np

from tetlux.fem.ballistic.rays import Rays, join_rays
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.media.fresnel import reflectance
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.triangles import triangle_areas
from tetlux.meshing.tets.mesh import TetMesh


def refract_in(rays: Rays, normals: FloatArray, eta: float) -> tuple[Rays, float]:
    """Refract rays that meet a surface from outside.

    Parameters
    ----------
    rays : Rays
        They start on the surface, with the direction that they have outside.
    normals : (r, 3) ndarray
        Outward unit normals where they start.
    eta : float
        Refractive index of the inside over that of the outside.

    Returns
    -------
    rays : Rays
        Those that pass, without the power that is reflected; below an index of 1 some are totally reflected.
    specular : float
        Reflected power, W.
    """
    cosine = np.clip(-np.einsum("ij,ij->i", rays.directions, normals), 0.0, 1.0)
    reflected = reflectance(cosine, 1.0 / eta)
    cosine_inside = np.sqrt(np.maximum(1.0 - (1.0 - cosine**2) / eta**2, 0.0))
    refracted = rays.directions / eta + (cosine / eta - cosine_inside)[:, None] * normals
    refracted /= np.linalg.norm(refracted, axis=1, keepdims=True)
    passes = reflected < 1.0
    specular = float(rays.powers @ reflected)
    return Rays(rays.starts, refracted, (1.0 - reflected) * rays.powers, rays.cells)[passes], specular


def reflect_and_exit(
    mesh: TetMesh, coefficients: Coefficients, rays: Rays, facets: IntArray
) -> tuple[Rays, float, float]:
    """Split rays that meet the boundary from inside into those reflected there and those that leave.

    Parameters
    ----------
    mesh : TetMesh
    coefficients : Coefficients
        Their refractive index counts.
    rays : Rays
        They start on the boundary, with the direction that they arrive in.
    facets : (r,) ndarray
        Boundary facets on which they start.

    Returns
    -------
    rays : Rays
        Those reflected, and those that leave and enter another part of the body.
    ballistic : float
        Power that leaves for good, W.
    specular : float
        Power that is reflected from outside where rays enter again, W.
    """
    eta = coefficients.outer.eta
    normals, _ = triangle_areas(mesh.points, mesh.boundary_faces[facets])
    reflected, leaving = _split_at_boundary(replace(rays, cells=mesh.boundary_cells[facets]), normals, eta)
    distances, hit = mesh.rays.first(leaving.starts, leaving.directions)
    normals, _ = triangle_areas(mesh.points, mesh.boundary_faces[hit])
    # Index -1 of no hit reads the last facet; the first condition drops it.
    enters = (hit >= 0) & (np.einsum("ij,ij->i", leaving.directions, normals) < 0)
    places = leaving.starts + np.where(enters, distances, 0.0)[:, None] * leaving.directions
    arriving = Rays(places, leaving.directions, leaving.powers, mesh.boundary_cells[hit])[enters]
    entering, specular = refract_in(arriving, normals[enters], eta)
    return join_rays([reflected, entering]), float(leaving.powers[~enters].sum()), specular


def _split_at_boundary(rays: Rays, normals: FloatArray, eta: float) -> tuple[Rays, Rays]:
    """Rays reflected inside, and rays refracted to the outside."""
    cosine = np.clip(np.einsum("ij,ij->i", rays.directions, normals), 0.0, 1.0)
    share = reflectance(cosine, eta)
    mirrored = rays.directions - 2.0 * cosine[:, None] * normals
    reflected = Rays(rays.starts, mirrored, share * rays.powers, rays.cells)[share > 0]
    cosine_outside = np.sqrt(np.maximum(1.0 - eta**2 * (1.0 - cosine**2), 0.0))
    refracted = eta * rays.directions + (cosine_outside - eta * cosine)[:, None] * normals
    refracted /= np.linalg.norm(refracted, axis=1, keepdims=True)
    return reflected, Rays(rays.starts, refracted, (1.0 - share) * rays.powers)[share < 1]
