"""How the strengths of fitted charges change with what they are fitted to, without fitting anew.

Strengths x are least-squares solutions of ``A x = b`` with the residual ``r = b - A x``. As A and b change by ``A'``
and ``b'``, x changes by ``A⁺ (b' - A' x) + (A^H A)⁻¹ A'^H r`` (Golub & Pereyra 1973), with the factors of A alone.
"""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.fit import factorise
from tetlux.fem.charges.placement import ChargePlacement
from tetlux.meshing.arrays import NumberArray

# A field near the one that is differentiated, and its weight in a difference.
Weighted = tuple[float, ChargeField]


def differentiate_strengths(
    placement: ChargePlacement, known: ChargeField, differences: Sequence[Sequence[Weighted]]
) -> NumberArray:
    """Derivatives of strengths of fitted charges.

    Parameters
    ----------
    placement : ChargePlacement
        Of c charges.
    known : ChargeField
        Sources and, last, the charges that were fitted to them.
    differences : sequence of sequence of (float, ChargeField)
        For each of k derivatives: weights, and fields of sources and equations nearby; of their charges only the number
        counts. Weights add up to 0.

    Returns
    -------
    (k, c) ndarray
    """
    count = len(placement.charges)
    strengths = known.strengths[-count:]
    matrix, residual = _equations(placement, known, strengths)
    factors = factorise(matrix)
    found = np.empty((len(differences), count), residual.dtype)
    for number, difference in enumerate(differences):
        change, turned = np.zeros_like(residual), np.zeros(count, residual.dtype)
        for weight, each in difference:
            matrix, missing = _equations(placement, each, strengths)
            change += weight * missing
            turned += weight * (matrix.conj().T @ residual)
        found[number] = factors.solve(change[:, None], turned[:, None])[:, 0]
    return found


def _equations(
    placement: ChargePlacement, field: ChargeField, strengths: NumberArray
) -> tuple[NumberArray, NumberArray]:
    """Weighted equations of charges, (m, c), and what these strengths leave of them with a field's sources, (m,)."""
    samples, count = placement.fitted, len(placement.charges)
    equation, points, normals = field.equation, samples.points, samples.normals
    matrix = equation.residual_of_each(points, normals, field.positions)
    matrix *= placement.weights[:, None]
    sources, charges = matrix[:, :-count], np.ascontiguousarray(matrix[:, -count:])
    return charges, -(sources @ field.strengths[:-count] + charges @ strengths)
