"""Thin beams as isotropic points, one on each: the dipole's source (Farrell 1992; Jensen 2001, sec. 2.1)."""

import numpy as np

from tetlux.fem.ballistic.rays import Rays
from tetlux.fem.body.body import Body
from tetlux.fem.body.optical_paths import OpticalPaths
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.hints import MeshHints
from tetlux.fem.sources.ledger import Ledger
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.notes import Note

# Optical depth of the point on each beam; in a body of less than twice this it lies half-way.
DEPTH = 1.0


def points_of(rays: Rays, body: Body) -> Deposit:
    """Deposit each beam at one point.

    Parameters
    ----------
    rays : Rays
        On the surface, refracted.
    body : Body

    Returns
    -------
    Deposit
        Each point at an optical depth (of sigma_t') of 1, with the power times the mean reduced albedo of the path.
    """
    if len(rays) == 0:
        return Deposit()
    paths = _paths_inside(rays, body)
    depths, albedo = paths.distances_at(_optical_depths(paths)), paths.albedo
    points = rays.starts + depths[:, None] * rays.directions
    warnings: tuple[str, ...] = ()
    if (paths.total_depths < 2.0 * DEPTH).any():
        warnings = (
            Note(
                "too-thin-for-point",
                "the beam crosses less than two mean free paths of the body, too little for one point of deposit; "
                'use deposit: "line".',
            ),
        )
    return Deposit(
        Ledger(absorbed=float((1.0 - albedo) @ rays.powers)),
        SourceTerms(points=points, powers=albedo * rays.powers),
        MeshHints(resolution=float(depths.min())),
        warnings=warnings,
    )


def shallowest_depth(rays: Rays, body: Body) -> float:
    """Least distance along the beams at which the optical depth is 1, unit."""
    if len(rays) == 0:
        return body.shortest_mean_free_path
    return float(_paths_inside(rays, body).distances_at(np.full(len(rays), DEPTH)).min())


def _optical_depths(paths: OpticalPaths) -> FloatArray:
    return np.minimum(DEPTH, 0.5 * paths.total_depths)


def _paths_inside(rays: Rays, body: Body) -> OpticalPaths:
    """Optical paths from the surface to where the beams leave the body."""
    begins, lengths = body.extents_along(rays.starts, rays.directions)
    paths = body.paths(rays.starts, rays.directions, lengths, begins)
    short = np.flatnonzero(body.surface.overlaps & (paths.total_depths < 2.0 * DEPTH)).tolist()
    if not short:
        return paths
    # Where the surface overlaps itself, the first triangle may lie inside the body.
    for ray in short:
        way_out = body.surface.exit(rays.starts[ray], rays.directions[ray])
        lengths[ray] = way_out[0] if way_out else 0.0
    return body.paths(rays.starts, rays.directions, lengths, begins)
