"""The error of a reading, and the contribution of each tetrahedron to it.

A reading is linear in the fluence. The dual solution z, whose load is the reading, is the weight of a local residual in
it. With R the average of gradients over the tetrahedra around a node, the contribution of a tetrahedron K is::

    eta_K = D ∫_K (grad phi_h - R grad phi_h) . (grad z_h - R grad z_h)

Contributions have either sign and cancel mostly, like the steps of a random walk. The estimated error is
``RANDOM_SCALE sqrt(sum eta_K² + (CORRELATED_WEIGHT sum eta_K)²)``. To it are added:

* what gaps between facets and true surfaces change (`tetlux.fem.quadratic.gaps`);
* the change of the fluence, less that of charges, from a detector to its facet;
* what ripples of the residual of fitted charges do to the exitance of a flat surface (`tetlux.fem.charges.check`): they
  are shorter than triangles, and at the detector, where the dual solution is singular, elements do not see them.
"""

import numpy as np

from tetlux.fem.charges.readings import ripple_errors
from tetlux.fem.known.fitted_patch import FittedPatch
from tetlux.fem.known.patch import Patch
from tetlux.fem.media.coefficients import at_cells
from tetlux.fem.quadratic.gaps import gap_contributions
from tetlux.fem.quadratic.measurement import DiscreteMeasurement, Measurement
from tetlux.fem.quadratic.reading_error import ReadingError
from tetlux.fem.quadratic.recovered_gradient import recovered_gradient_difference
from tetlux.fem.quadratic.solution import QuadraticSolution
from tetlux.meshing.arrays import FloatArray, Number, NumberArray
from tetlux.meshing.surface.triangles import longest_sides

# Factor of all contributions of gradients. Of 1,000 random readings (`tests.benchmarks.readings`), and of 210 in a
# ball with a core, for .48 / .55 / .6: share within twice the bar .968, .975, .980 and .967, .981, .986; bar over
# error in the median 1.75, 1.92, 2.05 and 1.58, 1.82, 1.98. Of 140 readings with the half-space subtracted .936 for
# .48.
RANDOM_SCALE = 0.55
# Weight of the sum of contributions, which do not cancel entirely, beside the root of their squares.
CORRELATED_WEIGHT = 0.4
# Relative error of the load of broad beams on bubbles. A broad beam is one ray through the middle of each facet, where
# bubbles are 4/3 of their mean.
BEAM_RELATIVE_ERROR = 0.35
# Weight of the root of the squares of the contributions of gaps, beside their sum, for what is of second order in them.
# With gaps / without, of 1,000 random readings .968 / .838 are within twice the bar, the worst 4 / 27 bars off.
GAP_RANDOM_SCALE = 0.3
# Weight of ripples at the detector. Share within twice the bar of readings that are off by more than .1 %, for
# 0 / .25 / .35 / .5: .74, .95, .99, .99 where charges are fitted for the exitance (82 of 370 readings); bar over error
# for all: 1.5, 3.1, 3.8, 5.1 in the median. Where they are fitted for the detectors 37 of 410 fresh readings are off by
# as much, .92 of them within twice the bar, and 99.3 % of all.
RIPPLE_WEIGHT = 0.35


def local_residual(solution: QuadraticSolution, dual: NumberArray, *, keep: bool) -> NumberArray:
    """Contributions eta_K to the error of a linear function of the fluence, by its dual solution (size,), (m,).

    `keep` says that the dual will come again, for other scenes, so that what is computed of it is kept.
    """
    operator = solution.operator
    steps = operator.gradient_steps(dual) if keep else recovered_gradient_difference(operator.space, dual)
    local = np.einsum("mij,mij->m", solution.gradient_difference, steps) / 4.0
    local *= operator.coefficients.diffusion * operator.mesh.volumes
    return np.asarray(local)


def weigh_residual(
    solution: QuadraticSolution, dual: NumberArray, value: Number, *, keep: bool = False
) -> ReadingError:
    """The error of a linear function of the fluence by its dual solution (size,); `value` is that of the function.

    That of the light that volume sources are made by contributes too. `keep` is as for `local_residual`.
    """
    local = local_residual(solution, dual, keep=keep)
    sources = solution.volume_sources
    if sources:
        local = local + sources[0].field.local_residual([source.light for source in sources], dual, keep=keep)
    rays = BEAM_RELATIVE_ERROR * abs(solution.broad_beams @ dual)
    of_gaps = gap_contributions(solution.operator, solution.fluence, dual, solution.inflow)
    squares = (RANDOM_SCALE * np.abs(local)) ** 2 + (GAP_RANDOM_SCALE * np.abs(of_gaps)) ** 2
    correlated = RANDOM_SCALE * CORRELATED_WEIGHT * local.sum().item()
    return ReadingError(value, squares, correlated, float(rays), of_gaps.sum().item())


def read_with_error(solution: QuadraticSolution, measurement: Measurement) -> ReadingError:
    """The value of a measurement and its estimated error."""
    if measurement in solution.errors:
        return solution.errors[measurement]
    operator = solution.operator
    dual, discrete = operator.duals([measurement])[0], operator.discretise(measurement)
    value = solution.read(discrete, dual)
    found = weigh_residual(solution, dual, value, keep=True)
    if not measurement.inside:
        # Along the normal the relative change of the fluence over the extrapolation length is 1.
        steepness = operator.robin / at_cells(operator.coefficients.diffusion, discrete.cells)
        changes = discrete.distances_from_mesh * steepness * np.abs(discrete.scale * solution.remainder_at(discrete))
        off = float(np.abs(measurement.weights) @ changes)
        ripples = sum(_ripples(patch.patch, discrete) ** 2 for patch in solution.patches)
        found.squares[discrete.cells[0]] += off**2 + RIPPLE_WEIGHT**2 * ripples
    if len(solution.errors) < operator.most_duals:
        solution.errors[measurement] = found
    return found


def _ripples(patch: Patch, discrete: DiscreteMeasurement) -> float:
    """The exitance that ripples of the residual of fitted charges make around a detector, W/unit²."""
    if not isinstance(patch, FittedPatch) or not patch.cells[discrete.cells[0]]:
        return 0.0
    center, corners = discrete.measurement.points.mean(axis=0), discrete.space.mesh.points[discrete.dofs[0, :3]]
    points = patch.residual.points
    error = ripple_errors(patch.charges.equation, points, points.spacing, patch.residual.values, center[None])[0]
    apart = points.spacing[points.tree.query(center)[1]]
    # Smaller triangles see ripples.
    return float(error * min(longest_sides(corners[None])[0] / apart, 1.0))


def fluence_with_error(solution: QuadraticSolution, points: FloatArray) -> NumberArray:
    """Fluence at points (q, 3) inside the body, W/unit², and its relative error, (2, q)."""
    measurements = [Measurement(point[None], np.ones(1), inside=True) for point in points]
    found = []
    for some in solution.prepare(measurements):
        readings = [read_with_error(solution, measurement) for measurement in some]
        found += [(reading.value, reading.relative) for reading in readings]
    return np.array(found).reshape(-1, 2).T
