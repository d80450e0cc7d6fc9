"""Charges fitted to the true surface, subtracted from the light of point sources throughout an even body.

Charges G that are fitted to the true surface (`tetlux.fem.charges`) violate the boundary condition there by
``r = D dG/dn + G/(2A)``. What is missing, ``u = phi - G``, obeys the equation without light, and

    ∫ D grad u . grad v + sigma_a u v  +  ∮ u v/(2A)  =  -∮ r v

Nothing else of G enters, so that flat facets do no harm: r is that of the true surface, and is carried to the facets of
a mesh by nearest points. u is some hundredths of the light or less, and smooth but for ripples as long as charges are
apart: a coarse mesh will do, and is refined where u asks for it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.charges.adapt import FittedCharges, LightSources, fit_at_places, fit_for_remainder
from tetlux.fem.charges.kernel import equation_of
from tetlux.fem.charges.places import EQUATION_REFINEMENT, Places
from tetlux.fem.charges.quadrature import quadrature
from tetlux.fem.charges.samples import Samples
from tetlux.fem.known.charges import Charges
from tetlux.fem.known.images import CLOSEST
from tetlux.fem.media.medium import Medium
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.surface.surface import Surface

# Points at which the residual is integrated lie so many times the spacing of charges apart, as which it ripples.
INTEGRATED = 1.0
# A source nearer to the surface than this share of a mean free path is not fitted: it would take many charges.
SHALLOWEST = 1e-3
# More sources than this are not fitted: charges would be needed near each of them.
MOST_SOURCES = 30
# Values near a charge are taken no nearer than this share of the least distance of charges from fitted points.
CLEAR = 0.25


@dataclass(frozen=True, eq=False)
class Violation:
    """What charges violate on the true surface.

    Attributes
    ----------
    points : Samples
        The q points at which it is integrated; their `spacing` is that of charges, unit.
    exitance, residual : (q,) ndarray
        ``G/(2A)`` and ``D dG/dn + G/(2A)``, W/unit².
    """

    points: Samples
    exitance: FloatArray
    residual: FloatArray

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class FittedLight:
    """One light's sources and the charges fitted to them.

    Attributes
    ----------
    charges : Charges
    violation : Violation
    places : Places
        Where charges were put and fitted; for the same light in other coefficients.
    """

    charges: Charges
    violation: Violation
    places: Places

    __repr__ = one_line


def fit_light(
    deposit: Deposit, surface: Surface, medium: Medium, *, tolerance: float, places: Places | None = None
) -> FittedLight | None:
    """Fit charges to the points of a deposit.

    Parameters
    ----------
    deposit : Deposit
    surface : Surface
    medium : Medium
    tolerance : float
        Relative L2 error of the exitance, of charges and finite elements together.
    places : Places, optional
        Where to put charges; chosen if not given.

    Returns
    -------
    FittedLight or None
        None if charges would not do: the light has lines or too many points, some of these lie on the surface, or a
        fit leaves too much.
    """
    if not _is_fit(deposit, surface, medium):
        return None
    lights = LightSources(deposit.terms.points, deposit.terms.powers[:, None], np.zeros(1))
    equation = equation_of(medium)
    if places is None:
        fitted = fit_for_remainder(surface, equation, lights, tolerance=tolerance)
        if fitted is None:
            return None
    else:
        fitted = fit_at_places(places, equation, lights)
    return FittedLight(_charges(fitted, surface, medium), violation_of(fitted, surface), fitted.places)


def _is_fit(deposit: Deposit, surface: Surface, medium: Medium) -> bool:
    """Whether the light is a few points well inside a simple body."""
    terms = deposit.terms
    if not 0 < len(terms.points) <= MOST_SOURCES or len(terms.segments) > 0 or surface.overlaps:
        return False
    if np.any(terms.irradiance) or np.any(terms.emission) or deposit.on_mesh is not None:
        return False
    depths = np.linalg.norm(surface.project(terms.points)[0] - terms.points, axis=1)
    return bool((depths > SHALLOWEST * medium.mean_free_path).all() and surface.contains(terms.points).all())


def _charges(fitted: FittedCharges, surface: Surface, medium: Medium) -> Charges:
    """Sources and charges as one sum."""
    field, sources = fitted.field, fitted.lights.points
    depths = np.linalg.norm(surface.project(sources)[0] - sources, axis=1)
    heights = np.asarray(cKDTree(fitted.places.fitted.points).query(fitted.places.charges)[0])
    closest = min(CLOSEST * min(medium.mean_free_path, float(depths.min())), CLEAR * float(heights.min()))
    return Charges(field.positions, field.strengths[:, 0], len(sources), closest, medium)


def violation_of(fitted: FittedCharges, surface: Surface) -> Violation:
    """What the first light's charges violate on the true surface."""
    samples = fitted.places.fitted
    tree = cKDTree(samples.points)
    points = quadrature(
        surface, lambda queries: INTEGRATED * EQUATION_REFINEMENT * samples.spacing[tree.query(queries)[1]]
    )
    exitance, residual = fitted.field.exitance_and_residual(points.points, points.normals)
    apart = Samples(points.points, points.normals, points.areas, points.spacing / INTEGRATED)
    return Violation(apart, exitance[:, 0], residual[:, 0])
