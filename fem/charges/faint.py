"""Charges fitted for faint light too: equations count by how little light is left where they are.

The exitance may be below zero where it is smaller than the error of charges, although the relative L2 error, which the
bright spot dominates, is within the tolerance. The residual is the smaller beside the light there, the more its
equations count: with weights ``e^{k d}``, d the distance from the light, as the light fades. Further powers of d would
count the light's own surroundings too little, which scale all light: by ``1/M`` in place of ``e^{k d}`` a ball of
radius 20 is off by 7 % everywhere with 300 charges.
"""

import numpy as np

from tetlux.fem.charges.adapt import (
    COUNT_FACTOR,
    FEWEST_CHARGES,
    LEAST_CHANGE,
    MOST_CHANGE,
    NEGLIGIBLE_DIP,
    SMOOTH_ESTIMATE,
    FittedCharges,
    LightSources,
    error_of_each,
    fit_charges,
    fit_placed_charges,
    height_after,
    refine_spacing,
)
from tetlux.fem.charges.kernel import Equation
from tetlux.fem.charges.placement import (
    distance_from,
    place_charges,
    spacing_by_fading,
    weight_by_distance,
    weight_by_fading,
)
from tetlux.meshing.surface.surface import Surface

# Where the exitance is below zero on at most this share of the surface, no more charges are fitted.
LARGEST_NEGATIVE_SHARE = 1e-3
# Number of charges of the last fit for faint light, which takes .8 s. Share of a hare below zero, and median error
# where the exitance is 1e-4 to 1e-3 of its maximum, lit from the side and the back, by 300 / 520 charges: 2 to 3 %, .05
# and .03 / .2 to .9 %, .022 and .015; by as many charges weighted by distance alone 6 to 8 % and .1 / 6 % and .05.
MOST_FOR_FAINT = 900


def fit_with_faint(
    surface: Surface, equation: Equation, lights: LightSources, *, tolerance: float, most: int
) -> FittedCharges:
    """Fit charges as `fit_charges`, and some more for faint light where the exitance is below zero.

    Parameters
    ----------
    surface : Surface
    equation : Equation
    lights : LightSources
    tolerance : float
        Relative L2 error of the exitance.
    most : int
        Approximate number of charges at which fitting ends in any case.

    Returns
    -------
    FittedCharges
        Of those within the tolerance, the fit that is below zero on the least share of the surface. Modulated light has
        either sign: no share of it counts as below zero.
    """
    best = fit_charges(surface, equation, lights, tolerance=tolerance, most=most)
    if best.errors.estimate > tolerance or len(lights.points) == 0 or np.any(lights.boundary_source):
        return best
    distance = distance_from(surface, lights.points)
    fading = float(np.real(equation.wave_number))
    share, most = _share_below_zero(best), min(most, MOST_FOR_FAINT)
    if share > 0.0 and best.errors.estimate <= SMOOTH_ESTIMATE:
        count = COUNT_FACTOR * len(best.placement.charges)
        if count <= most:
            spacing = refine_spacing(best.placement.checked, error_of_each(best))
            weight = weight_by_distance(distance)
            placement = place_charges(surface, spacing, weight, round(count), height_after(best))
            best, share = _better(best, share, fit_placed_charges(placement, equation, lights), tolerance)
    spacing, weight = spacing_by_fading(distance, fading), weight_by_fading(distance, fading)
    count, fitted = COUNT_FACTOR * FEWEST_CHARGES, best
    while share > LARGEST_NEGATIVE_SHARE and count <= most:
        placement = place_charges(surface, spacing, weight, round(count), height_after(fitted))
        fitted = fit_placed_charges(placement, equation, lights)
        best, share = _better(best, share, fitted, tolerance)
        checked = placement.checked
        errors = error_of_each(fitted) * weight(checked.points)
        spacing, count = refine_spacing(checked, errors, LEAST_CHANGE, MOST_CHANGE), COUNT_FACTOR * count
    return best


def _better(best: FittedCharges, share: float, fitted: FittedCharges, tolerance: float) -> tuple[FittedCharges, float]:
    """Of two fits, of which the first is below zero on a share, the better one and its share."""
    if fitted.errors.estimate > tolerance or (other := _share_below_zero(fitted)) >= share:
        return best, share
    return fitted, other


def _share_below_zero(fitted: FittedCharges) -> float:
    """The largest share of the surface where the exitance is below zero, by points that are fitted and by others."""
    samples = fitted.placement.fitted
    exitance = fitted.field.exitance(samples.points).sum(axis=1)
    if np.iscomplexobj(exitance):
        return fitted.negative_share
    below = exitance < -NEGLIGIBLE_DIP * exitance.max(initial=0.0)
    return max(fitted.negative_share, float(samples.areas[below].sum() / samples.areas.sum()))
