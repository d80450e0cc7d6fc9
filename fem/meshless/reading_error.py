"""The error of what is read of charges, from the residual of their fit around each reading.

A fit by least squares leaves a residual of ripples as long as charges are apart, and nothing smoother. The dual of a
reading, which is the light of a source where it is read, weighs such ripples by what is around it alone: as on a flat
surface, which `tetlux.fem.charges.check` has in closed form. Two other ways were measured: duals that were fitted by
charges, which see the smoother parts of the residual only, gave a twentieth of the error in the median; with the jumps
at the surfaces of regions bars were five times the error there, and without them twice, also below layers that are
thinner than a mean free path.
"""

import numpy as np
from scipy.spatial import cKDTree

from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.placement import EQUATION_REFINEMENT
from tetlux.fem.charges.quadrature import quadrature
from tetlux.fem.charges.readings import ReadingGoal, ripple_errors
from tetlux.fem.charges.samples import Samples
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.surface import Surface

# Relative error that is always added, for that of the smooth surface that triangles stand for.
LEAST_RELATIVE_ERROR = 1e-5


def reading_errors(
    surface: Surface,
    field: ChargeField,
    fitted: Samples,
    boundary_source: float,
    points: FloatArray,
    exitance: FloatArray,
    goal: ReadingGoal | None = None,
) -> FloatArray:
    """Estimated relative errors of the exitance at points of the body's surface.

    Parameters
    ----------
    surface : Surface
    field : ChargeField
        Below the surface, of all lights together.
    fitted : Samples
        Points of the surface at which charges were fitted; others are checked.
    boundary_source : float
        Right-hand side of the boundary condition, W/unit².
    points : (d, 3) ndarray
    exitance : (d,) ndarray
        There, W/unit².
    goal : ReadingGoal, optional
        What charges were fitted for, if it was readings: far from the light the residual then is so small around the
        points that its effect from elsewhere counts.

    Returns
    -------
    (d,) ndarray
    """
    tree, spacing = cKDTree(fitted.points), EQUATION_REFINEMENT * fitted.spacing
    checked = quadrature(surface, lambda places: spacing[tree.query(places)[1]])
    _, residual = field.exitance_and_residual(checked.points, checked.normals)
    violation, apart = residual - boundary_source, spacing[tree.query(checked.points)[1]]
    if goal is not None:
        return goal.at(points).relative_errors(checked, apart, violation, exitance) + LEAST_RELATIVE_ERROR
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = ripple_errors(field.equation, checked, apart, violation, points) / np.abs(exitance)
    return np.asarray(errors + LEAST_RELATIVE_ERROR)
