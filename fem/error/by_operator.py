"""The error of the sum of all lights, where lights have different operators."""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.error.estimate import Estimate, estimate_error
from tetlux.fem.operators.loads import Load
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.outcome.sums import sum_solutions
from tetlux.meshing.surface.surface import Surface


def estimate_by_operator(
    loads: Sequence[Load], of_lights: Sequence[Solution], whole: Solution, inner: Sequence[Surface]
) -> Estimate:
    """Estimate the error of a solution as the sum of the errors of its parts, one part for each operator.

    Parameters
    ----------
    loads : sequence of Load
        Of the lights.
    of_lights : sequence of Solution
        Of each light.
    whole : Solution
        Their sum.
    inner : sequence of Surface
        Of the regions of the mesh.

    Returns
    -------
    Estimate
    """
    estimates = []
    for operator in dict.fromkeys(load.operator for load in loads):
        own = [light for light, load in enumerate(loads) if load.operator is operator]
        terms = [loads[light].deposit.terms for light in own]
        emission = sum((each.emission for each in terms), 0.0)
        emission = emission + sum(source.density for each in terms for source in each.volume_sources)
        # Only nonuniform deposits make the exitance ripple.
        uneven = [loads[light].at_nodes for light in own if not loads[light].deposit.terms.is_distributed]
        estimates.append(
            estimate_error(
                sum_solutions([of_lights[light] for light in own]),
                whole,
                operator.coefficients,
                operator.solver,
                np.sum([np.zeros(len(operator.mesh.points)), *uneven], axis=0),
                emission,
                inner,
                operator.fitting,
            )
        )
    return Estimate(
        np.sum([each.exitance_indicators for each in estimates], axis=0),
        np.sum([each.power_indicators for each in estimates], axis=0),
        np.max([each.splits for each in estimates], axis=0),
        estimates[-1].duals,
        np.sum([each.of_heights for each in estimates], axis=0),
    )
