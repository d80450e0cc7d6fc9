"""`BoundaryResidual`: what charges leave of the boundary condition on the true surface."""

from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.charges.samples import Samples
from tetlux.fem.known.charges import Charges
from tetlux.meshing.arrays import IntArray, Number, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.host.by_pair import ByPair

# Points that differ by less than this share of their coordinates are the same, if their normals are.
SAME = 1e-12
# The power that flows out is corrected where less than this share of all is absorbed.
LITTLE = 0.05

# Many runs have the same points on one mesh: which of other points are the same.
_SAME_POINTS: ByPair[Samples, Samples, tuple[IntArray, IntArray, IntArray]] = ByPair()


@dataclass(frozen=True, eq=False)
class BoundaryResidual:
    """The residual of the boundary condition that charges leave on the true surface.

    Attributes
    ----------
    points : Samples
        The q points at which it is integrated; their `spacing` is that of charges, unit.
    exitance, values : (q,) ndarray
        ``G/(2A)`` and the residual ``D dG/dn + G/(2A)``, W/unit².
    missed : float or complex
        What the sum of ``-D dG/dn`` over the points misses of its integral, W; 0 where that hardly matters.
    """

    points: Samples
    exitance: NumberArray
    values: NumberArray
    missed: Number

    __repr__ = one_line


def residual_at(points: Samples, charges: Charges, known: BoundaryResidual | None = None) -> BoundaryResidual:
    """The residual of charges at points of the true surface, some of which may be those where it is known."""
    exitance, values = np.empty((2, len(points)), charges.equation.dtype)
    new = np.arange(len(points))
    if known is not None:
        of_known = known.points
        old, same, new = _SAME_POINTS.get(of_known, points, lambda: _same_points(of_known, points))
        exitance[same], values[same] = known.exitance[old], known.values[old]
    exitance[new], values[new] = charges.exitance_and_residual(points.points[new], points.normals[new])
    outflow = (points.areas @ (exitance - values)).item()
    return BoundaryResidual(points, exitance, values, _missed(charges, points, outflow))


def _same_points(known: Samples, points: Samples) -> tuple[IntArray, IntArray, IntArray]:
    """Numbers of known points that are among some points, theirs among these, and those of all others of these."""
    distance, nearest = (np.asarray(found) for found in known.tree.query(points.points))
    same = distance <= SAME * float(np.abs(points.points).max())
    # Two triangles may have a point in common and not its normal.
    same &= np.abs(known.normals[nearest] - points.normals).max(axis=1) <= SAME
    return nearest[same], np.flatnonzero(same), np.flatnonzero(~same)


def _missed(charges: Charges, points: Samples, outflow: Number) -> Number:
    """What a sum over points misses of the outflow of charges, of which they have that sum, W.

    Without absorption all power of the sources flows out, so the sum for the same charges without absorption says how
    far it is off. That matters where little is absorbed, which is what does not flow out.
    """
    power = charges.strengths[: charges.sources].sum().item()
    if abs(power - outflow) > LITTLE * abs(power):
        return 0.0
    unabsorbed = replace(charges, equation=replace(charges.equation, wave_number=0.0))
    exitance, values = unabsorbed.exitance_and_residual(points.points, points.normals)
    return outflow * (power / (points.areas @ (exitance - values)).item() - 1.0)
