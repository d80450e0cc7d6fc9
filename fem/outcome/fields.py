"""Exitance and fluence of a solution by quadratic elements, where a tolerance of either everywhere was asked for."""

from dataclasses import replace

from tetlux.fem.outcome.solution import Solution
from tetlux.fem.quadratic.field_error import field_errors
from tetlux.fem.quadratic.solution import Where, prefer_positive


def error_of_field(solution: Solution, where: Where) -> float:
    """Relative error that some 95 % of the points of each band are within: see `tetlux.fem.quadratic.field_error`."""
    assert solution.quadratic is not None
    return max((band.relative for band in field_errors(solution.quadratic, where)), default=0.0)


def use_quadratic_elements(solution: Solution) -> Solution:
    """The solution with exitance and fluence by quadratic elements, of each light too.

    Where distributed light decays within a tetrahedron, linear elements are better, and the solution stays as it is.
    """
    quadratic = solution.quadratic
    assert quadratic is not None
    if quadratic.thin_layers.any():
        return solution
    at_nodes = quadratic.fluence[: len(solution.mesh.points)]
    return replace(
        solution,
        fluence=prefer_positive(at_nodes, solution.fluence),
        of_lights=tuple(use_quadratic_elements(part) for part in solution.of_lights),
        is_quadratic=True,
    )
