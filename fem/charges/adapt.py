"""Charges fitted to a body and its light: as many as the tolerance needs, closest together at large residuals."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.charges.check import ErrorEstimates, estimate_errors
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.fit import LeastSquaresFactors, factorise
from tetlux.fem.charges.kernel import Equation
from tetlux.fem.charges.placement import (
    EQUATION_REFINEMENT,
    HEIGHT_ROUGH,
    HEIGHT_SMOOTH,
    ChargePlacement,
    distance_from,
    place_charges,
    weight_by_distance,
)
from tetlux.fem.charges.samples import InterpolatedSpacing, Samples, Spacing
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.surface.surface import Surface

# Number of charges of the first fit.
FEWEST_CHARGES = 100
# Charges of a fit, over those of the fit before. Estimate in % by 300 charges after a fit with 100, and after fits with
# 100 and 170, which take .08 s longer: hare .47 / .42, its ear 1.6 / .94, spot 1.8 / 1.5.
COUNT_FACTOR = 1.73
# Number of charges of the last fit, which takes some 5 s.
MOST_CHARGES = 1600
# Negative exitance of less than this share of its maximum does not count, nor gives a warning.
NEGLIGIBLE_DIP = 1e-6
# A fit with an estimated error below this shows that the body is smooth; the next fit has charges at `HEIGHT_SMOOTH`.
# Estimate in % by 300 charges 2 / 3 spacings high: ball .024 / .017, box .045 / .012, cylinder .031 / .014, torus .037
# / .050, hare .43 / .46, rocker-arm .63 / .93. With .003 some fits of a torus have 1.5 spacings: .06 % in place of .01.
SMOOTH_ESTIMATE = 0.006
# The spacing is multiplied by the share of each charge in the error to minus this power: see `error_of_each`. Error in
# %, and median relative error where the exitance is below 1 % of its maximum, geometric means of fourteen scenes and
# three draws, for this power and a NOISE_FACTOR: .5 and 1.5: .089, .82; .5 and 2: .094, .77; .5 and 1.25: .108, 1.0; .4
# and 1.5: .092, .77. By errors of each area in place of each charge .116, 1.25.
REFINEMENT_EXPONENT = 0.5
# Shares within this factor of their geometric mean do not change the spacing.
NOISE_FACTOR = 1.5
# Factors between which the spacing changes from fit to fit where equations are weighted by more than the distance.
# Largest error of ten fibres on a ball of radius 80, by 100, 190, 320, 540 charges, without / with them: 25e-3, .33e-3,
# .39e-3, .30e-3 / 1.3e-3, .31e-3, .30e-3, .30e-3; estimate of the exitance .088, .0017, .0062, .0001 / .017, .0008,
# .0001, .00003.
LEAST_CHANGE, MOST_CHANGE = 0.5, 1.4
# Factors between which it changes where equations are weighted by the distance alone. Where light fades to nothing,
# errors do too, and a spacing that follows them would have no bounds. Seen without limits: .35 to 4, and 70 in the dark
# of a strong absorber.
LEAST_BY_ERRORS, MOST_BY_ERRORS = 0.1, 10.0
# Number of nearest points over which the residual and the spacing are averaged.
AVERAGED_NEIGHBOURS = 12
# Where finite elements solve for the remainder, fitting ends when the estimated error of the charges alone is this
# multiple of the tolerance: of their residual a third to a half is left then. Processor seconds (hare's side, its ear)
# at a tolerance of .02 for .6 / 1: .34, .68 / .24, .35.
FIT_TOLERANCE_SHARE = 1.0
# It also ends when the estimate falls by less than this power of the number of charges, as on rough scans.
LEAST_RATE = 0.5
# Where finite elements solve for the remainder, fitting ends at this number of charges, which takes .2 s.
MOST_CHARGES_WITH_FEM = 600
# The estimate is assumed to fall with this power of the number of charges, which gives the number of the next fit.
ASSUMED_RATE = 2.0
# The number of charges grows by at least this factor from fit to fit.
LEAST_GROWTH = 1.4
# The number of charges grows by at most this factor from fit to fit.
MOST_GROWTH = 2.2
# A fit with a larger estimated error does not help finite elements, and is not used.
LARGEST_USEFUL_ESTIMATE = 0.2


@dataclass(frozen=True, eq=False)
class LightSources:
    """Point sources and boundary sources, in one column for each of s lights.

    Attributes
    ----------
    points : (p, 3) ndarray
        Sources inside the body.
    powers : (p, s) ndarray
        W.
    boundary_source : (s,) ndarray
        Right-hand side of the boundary condition ``D dphi/dn + phi/(2A)`` on the whole surface, W/unit²: 0 except under
        diffuse light.
    unscattered : float
        Exitance in addition to ``phi/(2A)`` of all lights together, W/unit²: 0 except under diffuse light.
    """

    points: FloatArray
    powers: NumberArray
    boundary_source: NumberArray
    unscattered: float = 0.0


@dataclass(frozen=True, eq=False)
class FittedCharges:
    """Charges outside a body, fitted to its lights.

    Attributes
    ----------
    field : ChargeField
        The sources, then the fitted charges; a column of strengths for each light.
    lights : LightSources
    placement : ChargePlacement
    factors : LeastSquaresFactors
        Of the matrix of the weighted equations; they serve other lights with the same charges.
    errors : ErrorEstimates
        Of the sum of all lights.
    residual : (n,) ndarray
        Of the sum of all lights at the checked points, W/unit².
    negative_share : float
        Share of the surface where ``phi/(2A)`` of the sum of all lights is below zero.
    """

    field: ChargeField
    lights: LightSources
    placement: ChargePlacement
    factors: LeastSquaresFactors
    errors: ErrorEstimates
    residual: NumberArray
    negative_share: float


def fit_charges(
    surface: Surface, equation: Equation, lights: LightSources, *, tolerance: float, most: int = MOST_CHARGES
) -> FittedCharges:
    """Fit charges until the estimated error of the exitance is within the tolerance, or there are `most` charges.

    Parameters
    ----------
    surface : Surface
    equation : Equation
    lights : LightSources
    tolerance : float
        Relative L2 error of the exitance.
    most : int
        Approximate number of charges at which fitting ends in any case.
    """
    best = None
    for fitted in fit_sequence(surface, equation, lights, most=most):
        if best is None or fitted.errors.estimate < best.errors.estimate:
            best = fitted
        if best.errors.estimate <= tolerance:
            break
    assert best is not None
    return best


def fit_sequence(
    surface: Surface, equation: Equation, lights: LightSources, *, most: int = MOST_CHARGES
) -> Iterator[FittedCharges]:
    """Fit growing numbers of charges, the last of about `most`."""
    spacing = distance_from(surface, lights.points)
    weight = weight_by_distance(spacing)
    # All steps grow by one factor, chosen so that the last step ends at `most`.
    steps = max(0, round(np.log(most / FEWEST_CHARGES) / np.log(COUNT_FACTOR)))
    height = HEIGHT_ROUGH
    for step in range(steps + 1):
        count = round(most * (FEWEST_CHARGES / most) ** ((steps - step) / max(steps, 1)))
        placement = place_charges(surface, spacing, weight, count, height)
        fitted = fit_placed_charges(placement, equation, lights)
        yield fitted
        height = height_after(fitted)
        spacing = refine_spacing(placement.checked, error_of_each(fitted))


def fit_for_remainder(
    surface: Surface, equation: Equation, lights: LightSources, *, tolerance: float
) -> FittedCharges | None:
    """Fit charges of which finite elements solve for the remainder.

    Parameters
    ----------
    surface : Surface
    equation : Equation
    lights : LightSources
    tolerance : float
        Relative L2 error of the exitance, of charges and finite elements together.

    Returns
    -------
    FittedCharges or None
        None if the estimated error of the best fit is above `LARGEST_USEFUL_ESTIMATE`.
    """
    spacing = distance_from(surface, lights.points)
    weight = weight_by_distance(spacing)
    best, count, height = None, FEWEST_CHARGES, HEIGHT_ROUGH
    while True:
        fitted = fit_placed_charges(place_charges(surface, spacing, weight, count, height), equation, lights)
        estimate, slow = fitted.errors.estimate, False
        if best is not None:
            growth = len(fitted.placement.charges) / len(best.placement.charges)
            slow = estimate * growth**LEAST_RATE > best.errors.estimate
        if best is None or estimate < best.errors.estimate:
            best = fitted
        excess = best.errors.estimate / (FIT_TOLERANCE_SHARE * tolerance)
        if excess <= 1.0 or slow or LEAST_GROWTH * count > MOST_CHARGES_WITH_FEM:
            return best if best.errors.estimate <= LARGEST_USEFUL_ESTIMATE else None
        count = min(
            round(count * np.clip(excess ** (1.0 / ASSUMED_RATE), LEAST_GROWTH, MOST_GROWTH)), MOST_CHARGES_WITH_FEM
        )
        height = height_after(fitted)
        spacing = refine_spacing(fitted.placement.checked, error_of_each(fitted))


def fit_strengths(
    placement: ChargePlacement, equation: Equation, lights: LightSources
) -> tuple[ChargeField, LeastSquaresFactors]:
    """Fit the strengths of charges at given positions: the sources with the charges, and the factors."""
    samples, weights = placement.fitted, placement.weights[:, None]
    factors = factorise(weights * equation.residual_of_each(samples.points, samples.normals, placement.charges))
    right = (
        lights.boundary_source
        - equation.residual_of_each(samples.points, samples.normals, lights.points) @ lights.powers
    )
    strengths = factors.solve(weights * right)
    positions = np.vstack([lights.points, placement.charges])
    return ChargeField(equation, positions, np.vstack([lights.powers, strengths])), factors


def fit_placed_charges(placement: ChargePlacement, equation: Equation, lights: LightSources) -> FittedCharges:
    """Fit the strengths of charges at given positions, and estimate their errors."""
    checked = placement.checked
    field, factors = fit_strengths(placement, equation, lights)
    exitance, residual = field.exitance_and_residual(checked.points, checked.normals)
    violation = (residual - lights.boundary_source).sum(axis=1)
    total, spacing = exitance.sum(axis=1), EQUATION_REFINEMENT * checked.spacing
    errors = estimate_errors(equation, checked, spacing, total + lights.unscattered, violation)
    # Amplitudes of modulated light may be below zero.
    below = np.zeros(len(total), bool) if np.iscomplexobj(total) else total < -NEGLIGIBLE_DIP * total.max(initial=0.0)
    negative_share = float(checked.areas[below].sum() / checked.areas.sum())
    return FittedCharges(field, lights, placement, factors, errors, violation, negative_share)


def height_after(fitted: FittedCharges) -> float:
    """Height of charges above the surface, in spacings, in the fit after another."""
    return HEIGHT_SMOOTH if fitted.errors.estimate <= SMOOTH_ESTIMATE else HEIGHT_ROUGH


def error_of_each(fitted: FittedCharges) -> FloatArray:
    """The L2 error of the exitance around each checked point, over the area of one charge, up to a factor, (n,).

    The residual times the spacing is the error that it causes if the spacing is below the extrapolation length (see
    `tetlux.fem.charges.check`); another factor is the root of the area.
    """
    return np.asarray(np.abs(fitted.residual) * fitted.placement.checked.spacing**2)


def refine_spacing(
    samples: Samples,
    errors: FloatArray,
    least_change: float = LEAST_BY_ERRORS,
    most_change: float = MOST_BY_ERRORS,
) -> Spacing:
    """Spacing, up to a factor, that is finer where charges cause large errors (n,), which refinement makes equal.

    It is changed by factors from the least to the most change.
    """
    tree = cKDTree(samples.points)
    count = min(AVERAGED_NEIGHBOURS, len(samples))
    apart, near = (np.asarray(found) for found in tree.query(samples.points, k=count))
    local = np.sqrt(np.square(errors)[near].mean(axis=1))
    deviation = np.log(np.maximum(local, np.finfo(float).tiny))
    deviation -= deviation.mean()
    deviation = np.sign(deviation) * np.maximum(np.abs(deviation) - np.log(NOISE_FACTOR), 0.0)
    change = np.clip(-REFINEMENT_EXPONENT * deviation, np.log(least_change), np.log(most_change))
    logarithm = (np.log(samples.spacing) + change)[near].mean(axis=1)
    return InterpolatedSpacing(tree, logarithm, near, apart)
