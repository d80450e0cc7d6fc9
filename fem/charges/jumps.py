"""What jumps of the fluence and of its flux at the surfaces of regions do to a reading.

A jump J of ``D dphi/dn`` acts like a source of that power on the interface, and a jump S of ``phi/(2A)`` like a pair of
sources, of which the one inside adds light. In a half-space below the detector, a distance d away and a depth z
below its tangent plane, a source far away makes the exitance ``zb/(2 pi) (1 + z/zb) (1 + k d) e^{-k d}/d³`` of its
power (`tetlux.fem.charges.readings` has that of the surface), and the pair ``S (n.n' - k zb (1 + z/zb) n.u)`` of that
without the factor in z, with the normals n of the interface and n' at the detector, and u the direction to it. The
equation is that of the body's outer region all along.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.readings import LESS_SMOOTHED_SHARE, ReadingGoal, squared_errors
from tetlux.fem.charges.samples import Samples
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.surface.surface import Surface


@dataclass(frozen=True, eq=False)
class Jumps:
    """Jumps from outside to inside at points of the surface of a region, of one light or of all together.

    Attributes
    ----------
    samples : Samples
        The n points.
    spacing : (n,) ndarray
        Of charges there, unit.
    fluence, flux : (n,) ndarray
        Jumps of ``phi/(2A)``, with A of the body's surface, and of ``D dphi/dn``, W/unit².
    """

    samples: Samples
    spacing: FloatArray
    fluence: NumberArray
    flux: NumberArray


def jumps_of(inside: ChargeField, outside: ChargeField, samples: Samples, spacing: FloatArray) -> Jumps:
    """The jumps between the fields of the regions inside and outside of a surface."""
    inner, outer = (field.exitance_and_residual(samples.points, samples.normals) for field in (inside, outside))
    # A residual is the sum of the exitance, in which A is that of the body's surface, and the flux.
    fluence = inner[0] - outer[0]
    return Jumps(samples, spacing, fluence, inner[1] - outer[1] - fluence)


def errors_by_jumps(surface: Surface, goal: ReadingGoal, jumps: Iterable[Jumps], exitance: NumberArray) -> FloatArray:
    """Relative errors of the exitance (d,) at the detectors of a goal by jumps at surfaces of regions, (d,).

    They count as residuals of the boundary condition do: the sum over each surface, and what random signs leave.
    """
    squares = np.zeros(len(goal.detectors))
    outward = surface.project(goal.detectors)[1]
    zb, fading = goal.equation.extrapolation_length, goal.fading
    for each in jumps:
        points, normals = each.samples.points, each.samples.normals
        # No nearer than residuals of the boundary condition are taken to be.
        distances = np.hypot(cdist(goal.detectors, points), LESS_SMOOTHED_SHARE * each.spacing)
        depths = np.einsum("di,di->d", goal.detectors, outward)[:, None] - outward @ points.T
        deepened = 1.0 + np.maximum(depths, 0.0) / zb
        along = (goal.detectors @ normals.T - np.einsum("ni,ni->n", points, normals)) / distances
        tilt = outward @ normals.T - fading * zb * deepened * along
        effects = zb / (2.0 * np.pi) * (1.0 + fading * distances) * np.exp(-fading * distances) / distances**3
        parts = effects * (deepened * each.flux + tilt * each.fluence)
        squares += squared_errors(parts, each.samples.areas, each.spacing)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.sqrt(squares) / np.abs(exitance))
