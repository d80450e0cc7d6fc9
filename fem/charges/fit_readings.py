"""Charges fitted for what detectors read: as many as the tolerance of readings needs, where they matter for these."""

import numpy as np

from tetlux.fem.charges.adapt import (
    COUNT_FACTOR,
    FEWEST_CHARGES,
    LEAST_CHANGE,
    MOST_CHANGE,
    FittedCharges,
    LightSources,
    error_of_each,
    fit_placed_charges,
    height_after,
    refine_spacing,
)
from tetlux.fem.charges.kernel import Equation
from tetlux.fem.charges.placement import EQUATION_REFINEMENT, HEIGHT_SMOOTH, place_charges
from tetlux.fem.charges.readings import ReadingGoal
from tetlux.meshing.surface.surface import Surface


def fit_for_readings(
    surface: Surface,
    equation: Equation,
    lights: LightSources,
    goal: ReadingGoal,
    *,
    tolerance: float | None,
    most: int,
) -> FittedCharges:
    """Fit charges until the estimated errors of readings are within their tolerance, or there are `most` charges.

    Parameters
    ----------
    surface : Surface
    equation : Equation
    lights : LightSources
    goal : ReadingGoal
    tolerance : float, optional
        Relative L2 error of the exitance, if it has to be met too.
    most : int
        Approximate number of charges at which fitting ends in any case.

    Returns
    -------
    FittedCharges
        The fit that is nearest to the tolerances.
    """
    spacing, weight, count = goal.spacing(), goal.weight(), FEWEST_CHARGES
    best, least, height = None, np.inf, HEIGHT_SMOOTH
    while True:
        fitted = fit_placed_charges(place_charges(surface, spacing, weight, count, height), equation, lights)
        excess = _excess(fitted, goal, tolerance)
        if best is None or excess < least:
            best, least = fitted, excess
        if excess <= 1.0 or count >= most:
            return best
        count = min(round(COUNT_FACTOR * count), most)
        height = height_after(fitted)
        checked = fitted.placement.checked
        effects = error_of_each(fitted) * weight(checked.points)
        spacing = refine_spacing(checked, effects, LEAST_CHANGE, MOST_CHANGE)


def _excess(fitted: FittedCharges, goal: ReadingGoal, tolerance: float | None) -> float:
    """The largest estimated error over its tolerance."""
    checked = fitted.placement.checked
    exitance = fitted.field.exitance(goal.detectors).sum(axis=1)
    spacing = EQUATION_REFINEMENT * checked.spacing
    errors = goal.relative_errors(checked, spacing, fitted.residual, exitance)
    return goal.excess(errors, fitted.errors.estimate, tolerance)
