"""The differences between a solution and closed forms."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tetlux.cases.compare.comparison import Comparison
from tetlux.fem.outcome.solution import Solution
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.errors import RunError

# What each closed form is, and the cause of its difference from the finite elements.
MEANINGS = {
    "robin": "the same equation and boundary on the infinite slab, solved exactly: the difference is discretisation",
    "images": "the slab with fluence zero on extrapolated planes (Contini 1997): the difference is discretisation and "
    "the boundary model",
    "dipole": "the dipole, a half-space with fluence zero on an extrapolated plane (Farrell 1992), with this medium's "
    "A (classic for the published curve): the difference is discretisation, the boundary model and the slab's other "
    "face",
    "series": "the same equation and boundary, solved exactly: the difference is discretisation",
}
# Relative differences are computed where the closed form exceeds this share of its maximum.
FLOOR = 1e-6
# An exitance below this has underflowed, W/unit².
DARK = 1e-200


@dataclass(frozen=True, eq=False)
class ComparisonResult:
    """Exitance by finite elements and by closed forms, at the boundary nodes where these hold, sorted by coordinate.

    Attributes
    ----------
    coordinate : str
        Name of the coordinate that exitance is drawn over.
    along, exitance : (n,) ndarray
        Values of the coordinate, and the solution's exitance, W/unit².
    forms : dict of (n,) ndarray
        Exitance by each closed form, W/unit².
    differences : dict
        For each closed form: ``l2``, the relative L2 difference by area; ``largest``, the largest relative difference
        at a node; and ``at``, the coordinate of that node.
    note : str
    single_valued : bool
        See `Coordinate`.
    """

    coordinate: str
    along: FloatArray
    exitance: FloatArray
    forms: dict[str, FloatArray]
    differences: dict[str, dict[str, float]]
    note: str
    single_valued: bool


def compare(comparison: Comparison, solution: Solution) -> ComparisonResult:
    """Compare a solution with closed forms at its boundary nodes.

    Raises
    ------
    RunError
        If no light leaves at the nodes where the closed forms hold, or there are none.
    """
    points = solution.mesh.boundary_points
    here = np.flatnonzero(comparison.holds_at(points))
    along = comparison.coordinate.along(points[here])
    here, along = here[np.argsort(along)], np.sort(along)
    exitance, weights = solution.exitance[here], solution.mesh.boundary_node_areas[here]
    forms = {name: form.exitance(points[here]) for name, form in comparison.forms.items()}
    return ComparisonResult(
        comparison.coordinate.name,
        along,
        exitance,
        forms,
        {name: _difference(name, exitance, truth, weights, along) for name, truth in forms.items()},
        comparison.note,
        comparison.coordinate.single_valued,
    )


def bright_enough(truth: FloatArray) -> BoolArray:
    """Whether a closed form (n,) is large enough for a relative difference, (n,)."""
    return np.asarray(truth > FLOOR * truth.max())


def _difference(
    name: str, exitance: FloatArray, truth: FloatArray, weights: FloatArray, along: FloatArray
) -> dict[str, float]:
    largest = float(truth.max(initial=0.0))
    if not largest > DARK:
        raise RunError(
            f'compare: the closed form "{name}" has no light at the nodes where it holds; leave compare out.'
        )
    counted = bright_enough(truth)
    relative = np.where(counted, exitance / np.where(counted, truth, 1.0) - 1.0, 0.0)
    worst = int(np.abs(relative).argmax())
    return {
        "l2": float(math.sqrt(weights @ ((exitance - truth) / largest) ** 2 / (weights @ (truth / largest) ** 2))),
        "largest": float(relative[worst]),
        "at": float(along[worst]),
    }


def as_data(result: ComparisonResult) -> dict[str, Any]:
    """Convert a comparison to plain data."""
    return {
        "coordinate": result.coordinate,
        "differences": {
            name: {**difference, "meaning": MEANINGS[name]} for name, difference in result.differences.items()
        },
        "note": result.note,
        "along": result.along.tolist(),
        "fem": result.exitance.tolist(),
        "closed_forms": {name: values.tolist() for name, values in result.forms.items()},
    }
