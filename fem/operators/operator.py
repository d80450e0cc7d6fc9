"""`Operator`: the equation of given coefficients on a mesh, prepared to be solved."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.linear.solver import LinearResult, Solver, solver_for
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.model import Model
from tetlux.fem.operators.assembly import Assembly, Mass
from tetlux.fem.operators.fitting import Fitting
from tetlux.fem.operators.terms import Terms
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Operator:
    """The equation on a mesh by its terms, and its solver.

    Attributes
    ----------
    mesh : TetMesh
    model : Model
        The equation, with the coefficients of the media on its tetrahedra.
    terms : Terms
        Of the matrix.
    solver : Solver
    fitting : Fitting, optional
        The coefficients of the matrix where they are not those of the media.
    """

    mesh: TetMesh
    model: Model
    terms: Terms
    solver: Solver
    fitting: Fitting | None

    @property
    def coefficients(self) -> Coefficients:
        """Of the media."""
        return self.model.coefficients

    @property
    def absorbing(self) -> FloatArray:
        """Power absorbed for a fluence of 1 at each node, (n,), unit²."""
        return self.terms.absorption.row_sums(self.mesh)

    @property
    def losses(self) -> FloatArray:
        """Power absorbed or lost through the boundary for a fluence of 1 at each node, (n,), unit²."""
        return self.absorbing + self.terms.boundary.row_sums(self.mesh)

    __repr__ = one_line


def operator_of(assembly: Assembly, model: Model, mass: Mass, loads: int, fitting: Fitting | None = None) -> Operator:
    """The operator of a model with one unknown.

    Parameters
    ----------
    assembly : Assembly
        Of the mesh.
    model : Model
    mass : {"lumped", "consistent"}
    loads : int
        How many right-hand sides are to come, roughly.
    fitting : Fitting, optional
        Coefficients of the matrix where they are not those of the media.

    Returns
    -------
    Operator
    """
    ((block,),) = model.blocks
    if fitting is None:
        terms = assembly.terms(block.diffusion, block.sigma, block.robin, mass)
        solver = assembly.solver(model.coefficients, terms.combine(), loads)
    else:
        terms = assembly.terms(fitting.diffusion, block.sigma, block.robin, mass, fitting.absorption_scale)
        solver = solver_for(terms.combine(), loads)
    return Operator(assembly.mesh, model, terms, solver, fitting)


def solve_columns(
    operators: Sequence[Operator], columns: Sequence[FloatArray], nodes: int
) -> tuple[FloatArray, list[LinearResult]]:
    """Solve for several right-hand sides, each with an operator of its own.

    Parameters
    ----------
    operators : sequence of Operator
        Those that are the same object are solved with together.
    columns : sequence of (n,) ndarray
        As many right-hand sides, perhaps none.
    nodes : int
        n.

    Returns
    -------
    solutions : (n, k) ndarray
    results : list of LinearResult
        One for each operator.
    """
    loads = np.column_stack([np.zeros((nodes, 0)), *columns])
    solutions, results = np.zeros(loads.shape), []
    for operator in dict.fromkeys(operators):
        own = [column for column, each in enumerate(operators) if each is operator]
        results.append(operator.solver.solve(loads[:, own]))
        solutions[:, own] = results[-1].x
    return solutions, results
