"""`Operator`: a model on a mesh, prepared to be solved."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.linear.solver import LinearResult, Solver, solver_for
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.models.model import Model
from tetlux.fem.operators.assembly import Assembly, Lumping
from tetlux.fem.operators.fitting import LayerFitting
from tetlux.fem.operators.terms import Terms
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Operator:
    """The terms of a model on a mesh, and the solver of its matrix.

    Attributes
    ----------
    mesh : TetMesh
    model : Model
        The equation, with the coefficients of the media on its tetrahedra.
    terms : Terms
        Of the matrix, which also holds the shift of the model.
    solver : Solver
    fitting : LayerFitting, optional
        The coefficients of the matrix where they are not those of the media.
    """

    mesh: TetMesh
    model: Model
    terms: Terms
    solver: Solver
    fitting: LayerFitting | None

    @property
    def coefficients(self) -> Coefficients:
        """Of the media."""
        return self.model.coefficients

    @property
    def absorption_weights(self) -> FloatArray:
        """Power absorbed for a fluence of 1 at each node, (n,), unit²."""
        return self.terms.absorption.row_sums(self.mesh)

    @property
    def loss_weights(self) -> FloatArray:
        """Power absorbed or lost through the boundary for a fluence of 1 at each node, (n,), unit²."""
        return self.absorption_weights + self.terms.boundary_term.row_sums(self.mesh)

    __repr__ = one_line


def operator_of(
    assembly: Assembly,
    model: Model,
    lumping: Lumping,
    expected_right_hand_sides: int,
    fitting: LayerFitting | None = None,
) -> Operator:
    """The operator of a model with one unknown.

    Parameters
    ----------
    assembly : Assembly
        Of the mesh.
    model : Model
    lumping : {"lumped", "consistent"}
    expected_right_hand_sides : int
        How many there will be, roughly.
    fitting : LayerFitting, optional
        Coefficients of the matrix where they are not those of the media.

    Returns
    -------
    Operator
    """
    ((block,),) = model.blocks
    if fitting is None:
        terms = assembly.terms(block.diffusion, block.sigma, block.robin, lumping)
        solver = assembly.solver(model, terms.combine(model.shift), expected_right_hand_sides)
    else:
        terms = assembly.terms(fitting.diffusion, block.sigma, block.robin, lumping, fitting.absorption_scale)
        solver = solver_for(terms.combine(model.shift), expected_right_hand_sides)
    return Operator(assembly.mesh, model, terms, solver, fitting)


def solve_columns(
    operators: Sequence[Operator], columns: Sequence[NumberArray], nodes: int
) -> tuple[NumberArray, list[LinearResult]]:
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
        Complex if a matrix or a right-hand side is.
    results : list of LinearResult
        One for each operator.
    """
    loads = np.column_stack([np.zeros((nodes, 0)), *columns])
    owned = {
        operator: [column for column, each in enumerate(operators) if each is operator]
        for operator in dict.fromkeys(operators)
    }
    results = [operator.solver.solve(loads[:, own]) for operator, own in owned.items()]
    solutions = np.zeros(loads.shape, np.result_type(np.float64, *(result.x for result in results)))
    for own, result in zip(owned.values(), results, strict=True):
        solutions[:, own] = result.x
    return solutions, results
