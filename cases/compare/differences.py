"""By how much a solution differs from closed forms."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tetlux.cases.compare.comparison import Comparison
from tetlux.fem.outcome.solution import Solution
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.errors import RunError

# What each closed form is, and what a difference from the finite elements therefore means.
MEANINGS = {
    "robin": "the same equation and boundary on the infinite slab, solved exactly: the difference is discretisation",
    "images": "the slab with fluence zero on extrapolated planes (Contini 1997): beyond discretisation, the difference "
    "is the boundary model",
    "dipole": "the dipole, a half-space with fluence zero on an extrapolated plane (Farrell 1992), with this medium's "
    "A (classic for the published curve): beyond discretisation, the difference is the boundary model and the slab's "
    "other face",
    "series": "the same equation and boundary, solved exactly: the difference is discretisation",
}
# Relative differences are taken where the closed form is above this share of its largest value.
FLOOR = 1e-6
# Below this an exitance is lost to arithmetic, W/unit².
DARK = 1e-200


@dataclass(frozen=True, eq=False)
class Compared:
    """Finite elements beside closed forms, at the boundary nodes where these hold, in order of the coordinate.

    Attributes
    ----------
    coordinate : str
        Name of what exitance is drawn against.
    along, exitance : (n,) ndarray
        That coordinate, and the solution's exitance, W/unit².
    forms : dict of (n,) ndarray
        Exitance by each closed form, W/unit².
    differences : dict
        By closed form: ``l2``, relative, weighted by area; ``largest``, relative at a node; and ``at``, where that is.
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


def compare(comparison: Comparison, solution: Solution) -> Compared:
    """Compare a solution with closed forms at its boundary nodes.

    Raises
    ------
    RunError
        If there is nothing to compare: no node where the closed forms hold, or no light at them.
    """
    points = solution.mesh.boundary_points
    here = np.flatnonzero(comparison.holds_at(points))
    along = comparison.coordinate.along(points[here])
    here, along = here[np.argsort(along)], np.sort(along)
    exitance, weights = solution.exitance[here], solution.mesh.boundary_node_areas[here]
    forms = {name: form.exitance(points[here]) for name, form in comparison.forms.items()}
    return Compared(
        comparison.coordinate.name,
        along,
        exitance,
        forms,
        {name: _difference(name, exitance, truth, weights, along) for name, truth in forms.items()},
        comparison.note,
        comparison.coordinate.single_valued,
    )


def bright_enough(truth: FloatArray) -> BoolArray:
    """Where a closed form (n,) is large enough for a relative difference, (n,)."""
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


def as_json(compared: Compared) -> dict[str, Any]:
    """A comparison as plain data."""
    return {
        "coordinate": compared.coordinate,
        "differences": {
            name: {**difference, "meaning": MEANINGS[name]} for name, difference in compared.differences.items()
        },
        "note": compared.note,
        "along": compared.along.tolist(),
        "fem": compared.exitance.tolist(),
        "closed_forms": {name: values.tolist() for name, values in compared.forms.items()},
    }
