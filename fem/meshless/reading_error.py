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

from tetlux.fem.charges.check import exitance_error
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.placement import EQUATION_REFINEMENT
from tetlux.fem.charges.quadrature import quadrature
from tetlux.fem.charges.samples import Samples
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.surface import Surface

# Points over which the square of errors around a reading is averaged. Bar over error for 110 readings on balls, balls
# in balls and cylinders, with errors from 1e-6 to .9: 1.8 in the median, 1.0 and 27 for the lowest and highest 5 %.
AVERAGED = 12
# Relative error that is always added, for that of the smooth surface that triangles stand for.
LEAST_RELATIVE_ERROR = 1e-5


def reading_errors(
    surface: Surface, field: ChargeField, fitted: Samples, boundary_source: float, points: FloatArray
) -> FloatArray:
    """Estimated errors of the exitance at points of the body's surface.

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

    Returns
    -------
    (d,) ndarray
        W/unit².
    """
    tree, spacing = cKDTree(fitted.points), EQUATION_REFINEMENT * fitted.spacing
    checked = quadrature(surface, lambda places: spacing[tree.query(places)[1]])
    _, residual = field.exitance_and_residual(checked.points, checked.normals)
    apart = spacing[tree.query(checked.points)[1]]
    errors = exitance_error(field.equation, residual - boundary_source, apart)
    around = cKDTree(checked.points).query(points, k=min(AVERAGED, len(checked)))[1]
    return np.asarray(np.sqrt((errors[around.reshape(len(points), -1)] ** 2).mean(axis=1)))
