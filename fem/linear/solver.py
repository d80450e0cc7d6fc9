"""Solve the system with the method that is quickest for its size, and check the residual."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from tetlux.fem.linear import krylov
from tetlux.fem.linear.direct import direct
from tetlux.fem.linear.krylov import GROUP, Method, Preconditioner, Product, jacobi, join_complex, norms, split_complex
from tetlux.fem.linear.multigrid import HAS_PYAMG, Cycle, Multigrid, multigrid
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.errors import RunError
from tetlux.meshing.host.blocks import THREADS
from tetlux.meshing.notes import Note

# A solution whose true relative residual is above this is refused.
REFUSED = 1e-8
# A solution to low accuracy iterates to this relative residual; if its residual is ten times as large, it is solved for
# in full.
LOW_ACCURACY_RESIDUAL = 1e-4
# Matrices of more unknowns are not factorised, since their factors fill gigabytes,
MOST_FOR_DIRECT = 20_000
# unless all other methods have failed.
MOST_TO_FALL_BACK = 100_000
# What messages call the methods, by the name of their function.
DISPLAY_NAMES = {
    "jacobi": "conjugate gradients with a diagonal preconditioner",
    "shared_multigrid": "the multigrid of a similar matrix",
    "direct": "a direct solution",
}


@dataclass(frozen=True, eq=False)
class LinearResult:
    """Solutions of a linear system for one right-hand side or several.

    Attributes
    ----------
    x : (n,) or (n, k) ndarray
        Complex if the matrix or a right-hand side is.
    residual : float
        Largest relative residual of a right-hand side, computed anew from its solution.
    iterations : int
        Most that one right-hand side took, of all methods together; 0 of the direct method.
    method : str
        The last method that was needed.
    """

    x: NumberArray
    residual: float
    iterations: int
    method: str


class Solver:
    """Prepared once for a matrix, then solves for as many right-hand sides as wanted.

    Parameters
    ----------
    matrix : (n, n) csr_array
        Real, symmetric, positive definite; or complex and symmetric, with a real part that is positive definite:
        ``A + i beta M``.
    methods : sequence of callables
        `jacobi`, `multigrid`, `direct`. The first is prepared at once, the next ones only when those before leave
        too large a residual.

    Attributes
    ----------
    note : str
        A `Note` for the user where the first method was not enough; else empty.
    """

    def __init__(self, matrix: csr_array, methods: Sequence[Callable[[Product], Method]]) -> None:
        self.matrix = matrix
        self._product = Product(matrix)
        self._methods = list(methods)
        self._prepared = [methods[0](self._product)]
        self._row_sums = np.asarray(matrix.sum(axis=1))[:, None]
        self.note = ""

    @property
    def cycle(self) -> Cycle | None:
        """The multigrid cycle that preconditions it, if there is one."""
        first = self._prepared[0]
        return first.cycle if isinstance(first, Multigrid) else None

    @property
    def preconditioner(self) -> Preconditioner:
        """What preconditions larger matrices that hold this one: its cycle, its factors, or its diagonal.

        It takes residuals in single precision.
        """
        first = self._prepared[0]
        if isinstance(first, Multigrid):
            return first.cycle.single
        if self._methods[0] is direct:
            return lambda rest: np.asarray(first(rest.astype(np.float64))[0].astype(np.float32))
        inverse: FloatArray = (1.0 / self.matrix.diagonal()[:, None]).astype(np.float32)
        return lambda rest: inverse * rest

    def solve(self, load: NumberArray) -> LinearResult:
        """Solve for one right-hand side or for several.

        Parameters
        ----------
        load : (n,) or (n, k) ndarray
            Real or complex. With a real matrix, real and imaginary parts are solved for as columns of their own.

        Returns
        -------
        LinearResult
            Residuals of each right-hand side sum to zero, so that no power is lost.

        Raises
        ------
        RunError
            If a residual, computed anew from the solution, is above 1e-8 of its load.
        """
        loads = load.reshape(len(load), -1)
        if self._needs_parts(loads):
            result = self.solve(split_complex(loads))
            return replace(result, x=join_complex(result.x).reshape(load.shape))
        dtype = np.complex128 if self._product.is_complex else np.float64
        solutions, results = np.empty(loads.shape, dtype), []
        portion = GROUP * THREADS
        for start in range(0, loads.shape[1], portion):
            columns = slice(start, start + portion)
            results.append(self._solve_portion(np.asarray(loads[:, columns], dtype=dtype)))
            solutions[:, columns] = results[-1].x
        names = [method.__name__ for method in self._methods]
        return LinearResult(
            solutions.reshape(load.shape),
            max((result.residual for result in results), default=0.0),
            max((result.iterations for result in results), default=0),
            max((result.method for result in results), key=names.index, default=names[0]),
        )

    def solve_to_low_accuracy(self, loads: NumberArray) -> LinearResult:
        """Solve for (n, k) right-hand sides to residuals of 1e-3 at most, in less than half of the iterations."""
        if self._needs_parts(loads):
            result = self.solve_to_low_accuracy(split_complex(loads))
            return replace(result, x=join_complex(result.x))
        # The iteration stops at STOP_RESIDUAL: with these scales that is LOW_ACCURACY_RESIDUAL of the load.
        sizes = norms(loads) * LOW_ACCURACY_RESIDUAL / krylov.STOP_RESIDUAL
        sizes[sizes == 0] = 1.0
        x, iterations = self._prepared[0](loads / sizes)
        residual = float(norms(loads / sizes - self._product(x)).max()) * LOW_ACCURACY_RESIDUAL / krylov.STOP_RESIDUAL
        if not residual <= 10.0 * LOW_ACCURACY_RESIDUAL:
            return self.solve(loads)
        return LinearResult(x * sizes, residual, iterations, self._methods[0].__name__)

    def _needs_parts(self, loads: NumberArray) -> bool:
        """Whether loads are complex and the matrix is not."""
        return np.iscomplexobj(loads) and not self._product.is_complex

    def _solve_portion(self, loads: NumberArray) -> LinearResult:
        """Solve for (n, k) right-hand sides by one method after the other, until the residuals are small."""
        sizes = np.linalg.norm(loads, axis=0)
        sizes[sizes == 0] = 1.0
        loads = loads / sizes
        state = _State(np.zeros_like(loads), loads, 1.0, 0, self._methods[0].__name__)
        for number in range(len(self._methods)):
            if state.residual <= krylov.STOP_RESIDUAL:
                break
            state = self._improve(state, loads, number)
        # Adding a constant makes the residuals sum to zero, and the ledger of power is such a sum.
        shift = state.residuals.sum(axis=0) / self._row_sums.sum()
        solution, residuals = state.solution + shift, state.residuals - shift * self._row_sums
        residual = float(np.linalg.norm(residuals, axis=0).max())
        if not residual <= REFUSED:
            raise RunError(
                f"the linear solver stopped at a relative residual of {residual:.1e}, above {REFUSED:.0e}; "
                "the mesh is too badly shaped or the coefficients too far apart: try a finer or cleaner mesh."
            )
        return LinearResult(np.asarray(solution * sizes), residual, state.iterations, state.method)

    def _improve(self, state: "_State", loads: NumberArray, number: int) -> "_State":
        """Reduce the residuals of loads (n, k) by one method, as far as it helps."""
        method = self._methods[number]
        if state.residual > REFUSED and number > 0:
            self.note = Note(
                "solver-fallback",
                f"the linear solver had to fall back from {_display(self._methods[0])} to {_display(method)}, which "
                "takes longer: coefficients are far apart, or tetrahedra flat.",
            )
        if number == len(self._prepared):
            self._prepared.append(method(self._product))
        helps = True
        # The residual that an iteration updates drifts from the true one: solve again for the true residual.
        while state.residual > krylov.STOP_RESIDUAL and helps:
            correction, more = self._prepared[number](state.residuals)
            solution = state.solution + correction
            residuals = loads - self._product(solution)
            residual = float(np.linalg.norm(residuals, axis=0).max())
            helps = residual < 0.1 * state.residual
            state = replace(state, iterations=state.iterations + more, method=method.__name__)
            if residual < state.residual:
                state = replace(state, solution=solution, residuals=residuals, residual=residual)
        return state


def _display(method: Callable[[Product], Method]) -> str:
    """The name of a method in a message."""
    return DISPLAY_NAMES.get(method.__name__, method.__name__)


@dataclass(frozen=True, eq=False)
class _State:
    """Solutions and true residuals (n, k) of loads of norm 1, the largest norm of these, and what it took."""

    solution: NumberArray
    residuals: NumberArray
    residual: float
    iterations: int
    method: str


def solver_for(matrix: csr_array, expected_right_hand_sides: int = 1, cycle: Cycle | None = None) -> Solver:
    """The solver that is quickest for a matrix.

    Parameters
    ----------
    matrix : (n, n) csr_array
        As for `Solver`.
    expected_right_hand_sides : int
        How many there will be, roughly.
    cycle : callable, optional
        The multigrid cycle of a similar matrix, such as that of A for ``A + i beta M``; it spares the preparation.

    Returns
    -------
    Solver

    Notes
    -----
    Milliseconds of one core to prepare + to solve for one load (for one of many), on spheres of radius 10 graded
    towards a point one mean free path deep, sigma_a .01, sigma_s' 1, eta 1.4:

    ======= ================== ================= ===================
    nodes   jacobi             multigrid         direct
    ======= ================== ================= ===================
    836     0 + 1.9 (.7)       2 + 1.8 (.6)      3 + .2 (.06)
    1,990   0 + 4.2 (2.2)      3 + 3.5 (1.6)     10 + .5 (.16)
    5,446   0 + 12 (8)         7 + 9 (5)         92 + 1.9 (.8)
    16,876  1 + 51 (39)        21 + 30 (17)      1,020 + 9 (4.5)
    50,181  2 + 210 (176)      55 + 106 (65)     17,000 + 45 (23)
    127,469 6 + 823 (723)      147 + 296 (206)
    ======= ================== ================= ===================

    An albedo of .9999 with eta 1.5 changes nothing; in a strong absorber (sigma_a 3, sigma_s' 10) jacobi takes a
    third of these times, multigrid three quarters. Between regions whose coefficients differ by 1e-4 to 1e6 jacobi
    takes up to 1.5 times its iterations of a homogeneous body, and its residuals are as small as multigrid's; so it
    is used where PyAMG is missing.
    """
    nodes = matrix.shape[0]
    loads = expected_right_hand_sides
    if nodes <= MOST_FOR_DIRECT and loads > 1 + (nodes / 1800) ** 2:
        methods: list[Callable[[Product], Method]] = [direct, multigrid, jacobi]
    elif nodes * loads > 15_000:
        methods = [multigrid, jacobi]
        if nodes <= MOST_TO_FALL_BACK:
            methods.append(direct)
        if cycle is not None:

            def shared_multigrid(product: Product) -> Multigrid:
                return Multigrid(product, cycle)

            methods.insert(0, shared_multigrid)
    else:
        methods = [jacobi, multigrid, direct]
    return Solver(matrix, [method for method in methods if HAS_PYAMG or method is not multigrid])
