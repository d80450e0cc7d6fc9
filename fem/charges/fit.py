"""Strengths of charges by least squares on the residual of the boundary condition."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg

from tetlux.meshing.arrays import FloatArray, NumberArray

# Pivots below this share of the largest pivot are left out, with the columns that they belong to.
LEAST_PIVOT = 1e-12


@dataclass(frozen=True, eq=False)
class LeastSquaresFactors:
    """Factors ``Q1 Q2 R`` of the independent columns of a weighted matrix of equations (m, c).

    Attributes
    ----------
    reflectors, tau : (m, k), (k,) ndarray
        Q1 as a product of Householder reflections, as LAPACK stores it: forming Q1 takes as long as the factorisation.
    q2 : (c, r) ndarray
        Q2.
    r : (r, r) ndarray
        R.
    columns : (r,) ndarray
        Numbers of the independent columns.
    scales : (c,) ndarray
        Lengths by which the columns were divided.
    """

    reflectors: NumberArray
    tau: NumberArray
    q2: NumberArray
    r: NumberArray
    columns: np.ndarray[tuple[int], np.dtype[np.int64]]
    scales: FloatArray

    def solve(self, right: NumberArray, normal: NumberArray | None = None) -> NumberArray:
        """Least-squares solutions (c, s) for right sides (m, s), and for more (c, s) of the normal equations."""
        found = np.zeros((len(self.scales), right.shape[1]), dtype=np.result_type(self.reflectors, right))
        projected = self.q2.conj().T @ self._project(right)
        if normal is not None:
            scaled = (normal / self.scales[:, None])[self.columns]
            projected = projected + scipy.linalg.solve_triangular(self.r, scaled, trans="C", check_finite=False)
        found[self.columns] = scipy.linalg.solve_triangular(self.r, projected, check_finite=False)
        return found / self.scales[:, None]

    def _project(self, right: NumberArray) -> NumberArray:
        """The conjugate transpose of Q1 times right sides (m, s), (k, s)."""
        values = np.asarray(right, dtype=np.result_type(self.reflectors, right), order="F")
        functions: Any = scipy.linalg.get_lapack_funcs(("ormqr",), (self.reflectors, values))
        multiply = functions[0]
        way = "C" if np.iscomplexobj(self.reflectors) else "T"
        lengths = multiply("L", way, self.reflectors, self.tau, values, -1)[1]
        product = multiply("L", way, self.reflectors, self.tau, values, int(lengths[0].real))[0]
        return np.asarray(product[: len(self.tau)])


def factorise(matrix: NumberArray) -> LeastSquaresFactors:
    """Factorise a matrix, which is overwritten.

    The columns are scaled to unit length. A QR factorisation without pivots, which LAPACK does in large blocks, is
    followed by one with pivots of its triangular factor; this takes two thirds of the time of one with pivots. The
    matrix is the more nearly singular the higher the charges are above the surface. Strengths are large then, but their
    sum stays accurate as long as small pivots are left out (Barnett & Betcke 2008).
    """
    scales = np.linalg.norm(matrix, axis=0)
    scales[scales == 0.0] = 1.0
    matrix /= scales
    (reflectors, tau), first = scipy.linalg.qr(matrix, mode="raw", overwrite_a=True, check_finite=False)
    q2, r, order = scipy.linalg.qr(first, mode="economic", pivoting=True, check_finite=False)
    pivots = np.abs(np.diag(r))
    rank = int((pivots > LEAST_PIVOT * pivots[0]).sum())
    reflectors, columns = reflectors[:, : len(tau)], order[:rank].astype(np.int64)
    return LeastSquaresFactors(reflectors, tau, q2[:, :rank], r[:rank, :rank], columns, scales)
