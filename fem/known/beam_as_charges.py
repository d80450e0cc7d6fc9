"""A beam without width as point charges, so that it can be subtracted in closed form like point sources.

Along a segment the beam carries ``f(l) = f0 e^{-sigma_t* l}`` and leaves ``Q0 = sigma_s* f`` and
``Q1 = g* sigma_s* f s``. The load of the latter, ``(1/sigma_t') ∫ Q1 . grad v``, is by integration by parts along the
segment that of charges: with ``m = g* sigma_s*/sigma_t'``,

    (sigma_s* + m sigma_t*) f(l)  on the line,   -m f(0)  at its start,   +m f(L)  at its end.

The line is cut into panels that double in length from the start, with Gauss points in the share of power that the beam
has lost, so that every panel has its own power exactly. The ends lie on the surface, where the exitance of a charge is
singular (like -1/rho at the entry); they are put a little inside, see `ENDS`. What is left of a beam that has faded
stays a line, for the mesh.

A mean free path from the entry and farther the exitance of all this is that of the line to 5e-4 of itself, and to 8e-4
where the beam slants; half a mean free path from it 4e-3, at 0.3 some parts in a thousand (half-space, indices 1 and
1.4, g .8 and .9, albedos .8 and .99). Nearer it stays finite, while that of the line falls to minus infinity. Without a
first moment it is the line's to 1e-3 from 0.2 on. Fluence inside, at depths to three mean free paths, is that of the
line to 2e-3 a mean free path beside it and to 1.5 % half of one beside it; closer than that it shows the points.
"""

from dataclasses import replace

import numpy as np

from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.hints import MeshHints
from tetlux.fem.sources.segments import Segments
from tetlux.fem.sources.terms import SourceTerms
from tetlux.meshing.arrays import FloatArray

# Length of the first panel in mean free paths, and Gauss points of each: exitance is 2e-4 off half a mean free path
# from the entry and farther. Two points are 3e-3 off; a first panel half as long gains nothing there, and has its
# shallowest point at .02 instead of .04, where the facets of a coarse mesh cut it off.
FIRST = 0.5
PANEL_POINTS = 3
# Points end where the beam has this share of the brightest flux left. On the mesh so little needs no refinement, while
# points close to the other side, where the charges are a poor guess, have all of them dropped: with 1e-4 a sphere of
# radius two takes 24,000 nodes and misses its tolerance, with 1e-2 or 1e-3 it takes 700.
FADED = 1e-2
# A charge on the surface is these four in its place, by distance along the beam in mean free paths: together they have
# its power and none of its first three moments. Half as near, exitance a mean free path away is 1e-4 off instead of
# 5e-4, but the extreme at the entry is three times as large; 1.5 times as far it is 2e-3 off. Three that lack two
# moments are 3e-3 off where the beam slants. Along the normal they would be better still, but at an edge of the body
# they would lie on its surface.
ENDS = ((0.06, 4.0), (0.12, -6.0), (0.18, 4.0), (0.24, -1.0))
# They take up no more than this share of the segment.
SHALLOW = 0.5


def beam_as_charges(deposit: Deposit, medium: Medium) -> tuple[Deposit, Deposit]:
    """The bright parts of a deposit's segments as points, and what is left of it.

    Parameters
    ----------
    deposit : Deposit
    medium : Medium

    Returns
    -------
    bright : Deposit
        Without segments; its points are those of the deposit and those in place of segments. The powers of these, of
        which some are negative, sum to the power that the segments in their place leave, W, to rounding.
    faint : Deposit
        The rest of the segments and nothing else.
    """
    extinction = medium.sigma_a + medium.delta_eddington[0]
    segments = deposit.terms.segments
    strongest = float(segments.fluxes.max(initial=0.0))
    reaches = np.clip(np.log(segments.fluxes / (FADED * strongest)) / extinction, 0.0, segments.lengths)
    left = segments.fluxes * np.exp(-extinction * reaches)
    ends = segments.starts + reaches[:, None] * segments.directions
    points, powers = _bright_points(deposit.terms, medium, reaches, left, ends)
    bright = replace(
        deposit,
        terms=replace(deposit.terms, points=points, powers=powers, point_cells=None, segments=Segments()),
        hints=MeshHints(resolution=medium.mean_free_path),  # the points mark the same places
    )
    beyond = reaches < segments.lengths
    rest = Segments(ends[beyond], segments.directions[beyond], (segments.lengths - reaches)[beyond], left[beyond])
    no_points = deposit.terms.select_points(np.zeros(len(deposit.terms.points), dtype=bool))
    faint = replace(
        deposit,
        terms=replace(no_points, segments=rest),
        hints=MeshHints(resolution=deposit.hints.resolution),
    )
    return bright, faint


def _bright_points(
    terms: SourceTerms, medium: Medium, reaches: FloatArray, left: FloatArray, ends: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points (p, 3) of source terms and in place of their segments, and their powers (p,), W.

    By the lengths of the segments' bright parts, the flux left at the ends of these, and the ends (s, 3) themselves.
    """
    scattering, cosine = medium.delta_eddington
    extinction = medium.sigma_a + scattering
    forward = cosine * scattering / medium.sigma_t_prime
    segments, points, powers = terms.segments, [terms.points], [terms.powers]
    for i in np.flatnonzero(reaches > 0):
        along, lost = _panels(float(reaches[i]), extinction, FIRST * medium.mean_free_path)
        points.append(segments.starts[i] + along[:, None] * segments.directions[i])
        powers.append((scattering / extinction + forward) * segments.fluxes[i] * lost)
        length, direction = float(segments.lengths[i]), segments.directions[i]
        inside, weights = _end(segments.starts[i], direction, length, medium)
        points.append(inside)
        powers.append(-forward * segments.fluxes[i] * weights)
        inside, weights = ends[i][None], np.ones(1)
        if reaches[i] == length:
            inside, weights = _end(ends[i], -direction, length, medium)
        points.append(inside)
        powers.append(forward * left[i] * weights)
    powers_of_all = np.concatenate(powers)
    shining = powers_of_all != 0  # in a medium that counts as isotropic the ends have none
    return np.vstack(points)[shining], powers_of_all[shining]


def _panels(reach: float, extinction: float, first: float) -> tuple[FloatArray, FloatArray]:
    """Gauss points along a beam of unit flux, (p,), and what it loses for each of them, (p,)."""
    edges = [0.0, min(first, reach)]
    while edges[-1] < reach:
        edges.append(min(2.0 * edges[-1], reach))
    lost = -np.expm1(-extinction * np.array(edges))[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(PANEL_POINTS)
    low, size = lost[:-1], np.diff(lost, axis=0)
    return -np.log1p(-(low + 0.5 * size * (1.0 + nodes)).ravel()) / extinction, (0.5 * size * weights).ravel()


def _end(point: FloatArray, inward: FloatArray, length: float, medium: Medium) -> tuple[FloatArray, FloatArray]:
    """Points (4, 3) inside that stand for one on the surface, and their weights (4,)."""
    along, weights = np.array(ENDS).T
    along = along * min(medium.mean_free_path, SHALLOW * length / along[-1])
    return point + along[:, None] * inward, weights
