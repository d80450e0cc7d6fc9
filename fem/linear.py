"""Solving the system: conjugate gradients, preconditioned by algebraic multigrid."""

import numpy as np
from scipy.sparse import csr_array, csr_matrix
from scipy.sparse.linalg import cg

from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import RunError

# The iteration aims here, so that the power ledger closes; a true residual above the second is refused.
AIM = 1e-12
REFUSED = 1e-8
ITERATIONS = 400


class MultigridSolver:
    """Prepared once for a matrix, then solves for as many right-hand sides as wanted.

    Smoothed aggregation (Vaněk, Mandel & Brezina 1996; PyAMG) as preconditioner of conjugate gradients.

    Parameters
    ----------
    matrix : (n, n) csr_array
        Symmetric, positive definite.
    """

    def __init__(self, matrix: csr_array) -> None:
        import pyamg  # noqa: PLC0415

        self.matrix = matrix
        # PyAMG draws its starting vectors from NumPy's global generator: fix them, and put it back.
        state = np.random.get_state()  # noqa: NPY002
        np.random.seed(0)  # noqa: NPY002
        try:
            self._preconditioner = pyamg.smoothed_aggregation_solver(
                csr_matrix(matrix), max_coarse=300, coarse_solver="splu"
            ).aspreconditioner()
        finally:
            np.random.set_state(state)  # noqa: NPY002

    def solve(self, load: FloatArray) -> FloatArray:
        """Solve for one right-hand side.

        Parameters
        ----------
        load : (n,) ndarray

        Returns
        -------
        (n,) ndarray

        Raises
        ------
        RunError
            If the residual, computed anew from the solution, is above 1e-8 of the load.
        """
        size = float(np.linalg.norm(load))
        if size == 0:
            return np.zeros_like(load)
        result, _ = cg(self.matrix, load / size, rtol=AIM, atol=0.0, maxiter=ITERATIONS, M=self._preconditioner)
        # The iteration's own residual drifts from the true one; one more round on what is left mends that.
        rest = load / size - self.matrix @ result
        if np.linalg.norm(rest) > AIM:
            result = result + cg(self.matrix, rest, rtol=0.1, atol=0.0, maxiter=ITERATIONS, M=self._preconditioner)[0]
            rest = load / size - self.matrix @ result
        residual = float(np.linalg.norm(rest))
        if not residual <= REFUSED:
            raise RunError(
                f"the linear solver stopped at a relative residual of {residual:.1e}, above {REFUSED:.0e}; "
                "the mesh is too badly shaped or the coefficients too far apart: try a finer or cleaner mesh."
            )
        return np.asarray(result * size)
