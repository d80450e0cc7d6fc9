"""Strengths of charges by least squares on what they violate at the surface."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg

from tetlux.fem.charges.kernel import NumberArray
from tetlux.meshing.arrays import FloatArray

# Combinations of charges that the equations see less of than this share are left out.
RCOND = 1e-12


@dataclass(frozen=True, eq=False)
class Factors:
    """A weighted table of equations (m, c), factorised: ``Q1 Q2 R`` of its independent columns.

    Attributes
    ----------
    reflectors, factors : (m, k), (k,) ndarray
        Q1 as a product of reflections, as LAPACK keeps it: forming it takes as long as finding it.
    turn : (c, r) ndarray
        Q2.
    triangle : (r, r) ndarray
        R.
    columns : (r,) ndarray
        Which columns they are.
    scales : (c,) ndarray
        Lengths that columns were divided by.
    """

    reflectors: NumberArray
    factors: NumberArray
    turn: NumberArray
    triangle: NumberArray
    columns: np.ndarray[tuple[int], np.dtype[np.int64]]
    scales: FloatArray

    def solve(self, right: NumberArray) -> NumberArray:
        """Least-squares solutions (c, s) for right sides (m, s)."""
        found = np.zeros((len(self.scales), right.shape[1]), dtype=np.result_type(self.reflectors, right))
        projected = self.turn.conj().T @ self._project(right)
        found[self.columns] = scipy.linalg.solve_triangular(self.triangle, projected, check_finite=False)
        return found / self.scales[:, None]

    def _project(self, right: NumberArray) -> NumberArray:
        """The conjugate transpose of Q1 times right sides (m, s), (k, s)."""
        values = np.asarray(right, dtype=np.result_type(self.reflectors, right), order="F")
        functions: Any = scipy.linalg.get_lapack_funcs(("ormqr",), (self.reflectors, values))
        multiply = functions[0]
        way = "C" if np.iscomplexobj(self.reflectors) else "T"
        lengths = multiply("L", way, self.reflectors, self.factors, values, -1)[1]
        product = multiply("L", way, self.reflectors, self.factors, values, int(lengths[0].real))[0]
        return np.asarray(product[: len(self.factors)])


def factorise(table: NumberArray) -> Factors:
    """Factorise a table, which is overwritten.

    Pivoted QR of its columns at equal lengths: without pivots first, which is done in large blocks, and with them of
    the small triangle that this leaves (a third quicker). The table is nearly singular by nature, and the more so the
    higher charges are above the surface: strengths grow, and what they add up to does not suffer as long as
    small pivots are left out (Barnett & Betcke 2008).
    """
    scales = np.linalg.norm(table, axis=0)
    scales[scales == 0.0] = 1.0
    table /= scales
    (reflectors, factors), first = scipy.linalg.qr(table, mode="raw", overwrite_a=True, check_finite=False)
    turn, triangle, order = scipy.linalg.qr(first, mode="economic", pivoting=True, check_finite=False)
    pivots = np.abs(np.diag(triangle))
    rank = int((pivots > RCOND * pivots[0]).sum())
    reflectors, columns = reflectors[:, : len(factors)], order[:rank].astype(np.int64)
    return Factors(reflectors, factors, turn[:, :rank], triangle[:rank, :rank], columns, scales)
