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
from tetlux.fem.charges.kernel import Equation
from tetlux.fem.charges.placement import EQUATION_REFINEMENT
from tetlux.fem.charges.quadrature import quadrature
from tetlux.fem.charges.readings import ReadingGoal, ripple_errors
from tetlux.fem.charges.samples import Samples
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.surface import Surface

# Relative error that is always added: rounding of large strengths of charges.
LEAST_RELATIVE_ERROR = 1e-6


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
        errors = goal.at(points).relative_errors(checked, apart, violation, exitance)
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            errors = ripple_errors(field.equation, checked, apart, violation, points) / np.abs(exitance)
    return np.asarray(
        np.hypot(errors, _errors_of_smooth_surface(surface, field.equation, points)) + LEAST_RELATIVE_ERROR
    )


def _errors_of_smooth_surface(surface: Surface, equation: Equation, points: FloatArray) -> FloatArray:
    """Relative errors of the exitance at points (d, 3), as the smooth surface lies beside the true one, (d,).

    Over a triangle of side h on a ball of radius R the smooth surface rises by s = h²/(6R), and lies about s²/R, which
    is 6s³/h², off the ball: 2.6e-5 with 5,120 triangles and a radius of 28.8, where the root mean square is 2.6e-5.
    """
    faces = surface.closest(points)[1]
    corners = surface.points[surface.faces[faces]]
    middles = corners.mean(axis=1)
    rise = np.linalg.norm(surface.on_curve(faces, middles)[0] - middles, axis=1)
    sides = np.square(corners - np.roll(corners, 1, axis=1)).sum(axis=2).mean(axis=1)
    fading = 1.0 / equation.extrapolation_length + abs(equation.wave_number)
    return np.asarray(6.0 * rise**3 / sides * fading)
