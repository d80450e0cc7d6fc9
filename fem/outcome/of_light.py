"""The solution of one light: its fluence, limited to be nonnegative where that is asked for, and its ledger."""

from collections.abc import Sequence
from dataclasses import replace

from tetlux.fem.known.subtraction import Subtraction
from tetlux.fem.operators.limiter import limit_to_nonnegative
from tetlux.fem.operators.loads import Load
from tetlux.fem.outcome.power import Power
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.quadratic.operator import QuadraticOperator
from tetlux.fem.quadratic.scene import QuadraticScene
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.meshing.arrays import NumberArray
from tetlux.meshing.surface.surface import Surface


def solution_of_light(
    load: Load, fluence: NumberArray, subtractions: Sequence[Subtraction], surface: Surface, *, limit: bool
) -> Solution:
    """The solution of one light.

    Parameters
    ----------
    load : Load
        Of the light.
    fluence : (n,) ndarray, real or complex
        The solution of its linear systems, W/unit².
    subtractions : sequence of Subtraction
        The charges of this light that are subtracted.
    surface : Surface
        What the mesh stands for.
    limit : bool
        Whether the fluence is limited to be nonnegative where that of the equation itself is.

    Returns
    -------
    Solution
    """
    deposited, terms, operator = load.deposit.ledger, load.deposit.terms, load.operator
    mesh, limited_power, solved = operator.mesh, 0.0, fluence
    may_be_negative = load.has_first_moment or any(each.patch.charges.has_negative_source for each in subtractions)
    if limit and operator.model.nonnegative and not may_be_negative:
        fluence, limited_power = limit_to_nonnegative(fluence, mesh.edges, operator.loss_weights)
    outside = mesh.boundary_node_areas * terms.irradiance
    transmitted = mesh.boundary_node_areas * terms.transmitted_irradiance
    emitted = float((mesh.volumes * terms.emission).sum())
    absorbed = (operator.absorption_weights * fluence).sum().item()
    # Power that nodes lack together stays in the ledger: the known light that is absorbed is too large by it.
    absorbed += (operator.loss_weights * (solved - fluence)).sum().item()
    ledger = Power(
        incident=deposited.incident + float(outside.sum()) + emitted,
        specular=deposited.specular + float((outside - transmitted).sum()),
        absorbed=deposited.absorbed + absorbed + sum(each.terms.absorbed for each in subtractions),
        exited=0.0,
        ballistic=deposited.ballistic,
        stored=operator.model.shift * (mesh.node_volumes @ fluence).item()
        + sum(each.terms.stored for each in subtractions),
    )
    solution = Solution(
        mesh,
        surface,
        operator.model.boundary_condition,
        fluence,
        ledger,
        tuple(each.patch for each in subtractions),
        terms.transmitted_irradiance,
        limited_power=limited_power,
        known_absorption=tuple(each.terms.absorbed for each in subtractions),
        fitting=operator.fitting,
    )
    exited = (mesh.boundary_node_areas @ solution.exitance).item() + sum(each.terms.exited for each in subtractions)
    return replace(solution, power=replace(ledger, exited=exited))


def attach_quadratic(
    of_lights: Sequence[Solution], loads: Sequence[Load], operator: QuadraticOperator
) -> tuple[list[Solution], QuadraticSolution]:
    """Give the solution of each light its quadratic elements, by which detectors are read.

    Parameters
    ----------
    of_lights : sequence of Solution
    loads : sequence of Load
        Of the same lights.
    operator : QuadraticOperator

    Returns
    -------
    of_lights : list of Solution
    quadratic : QuadraticSolution
        Of all lights together.
    """
    lights = QuadraticScene(
        operator,
        tuple(load.deposit for load in loads),
        tuple(solution.patches for solution in of_lights),
        tuple(solution.fluence for solution in of_lights),
    )
    attached = [
        replace(solution, quadratic=QuadraticSolution(lights, (light,))) for light, solution in enumerate(of_lights)
    ]
    return attached, QuadraticSolution(lights, tuple(range(len(loads))))
