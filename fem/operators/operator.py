"""`Operator`: the equation of given coefficients on a mesh, prepared to be solved."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.fem.linear.solver import LinearResult, Solver, solver_for
from tetlux.fem.media.coefficients import Coefficients
from tetlux.fem.operators.assembly import Assembly, Mass
from tetlux.fem.operators.fitting import Fitting
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.describe import one_line
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Operator:
    """A matrix on a mesh, its solver, and the power that a fluence loses.

    Attributes
    ----------
    mesh : TetMesh
    coefficients : Coefficients
        Of the media, on its tetrahedra.
    solver : Solver
    absorbing : (n,) ndarray
        Power absorbed for a fluence of 1 at each node, unit².
    fitting : Fitting, optional
        The coefficients of the matrix where they are not those of the media.
    """

    mesh: TetMesh
    coefficients: Coefficients
    solver: Solver
    absorbing: FloatArray
    fitting: Fitting | None

    @property
    def losses(self) -> FloatArray:
        """Power absorbed or lost through the boundary for a fluence of 1 at each node, (n,), unit²."""
        losses = self.absorbing.copy()
        losses[self.mesh.boundary_nodes] += self.coefficients.escape * self.mesh.boundary_node_areas
        return losses

    __repr__ = one_line


def operator_of(
    assembly: Assembly, coefficients: Coefficients, mass: Mass, loads: int, fitting: Fitting | None = None
) -> Operator:
    """The operator of given coefficients.

    Parameters
    ----------
    assembly : Assembly
        Of the mesh.
    coefficients : Coefficients
    mass : {"lumped", "consistent"}
    loads : int
        How many right-hand sides are to come, roughly.
    fitting : Fitting, optional
        Coefficients of the matrix where they are not those of the media.

    Returns
    -------
    Operator
    """
    mesh, sigma_a = assembly.mesh, coefficients.sigma_a
    absorbing = np.asarray(
        sigma_a * mesh.node_volumes if coefficients.uniform else mesh.to_nodes(sigma_a * mesh.volumes)
    )
    if fitting is None:
        return Operator(mesh, coefficients, assembly.solver(coefficients, mass, loads), absorbing, None)
    matrix = assembly.matrix(fitting.diffusion, sigma_a, coefficients.escape, mass, fitting.absorption_scale)
    return Operator(mesh, coefficients, solver_for(matrix, loads), fitting.absorption_scale * absorbing, fitting)


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
