"""The reference exitance of a benchmark: a closed form, or else a far finer run of tetlux."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.cases.chart.samples import Samples, project_to_sphere
from tetlux.cases.file.case import Case
from tetlux.fem.exact.registry import closed_forms
from tetlux.fem.lights import Deposit
from tetlux.fem.media.medium import Medium
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.solve import solve
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.solids import Shape, Slab, Sphere

# Tolerances of the reference run if there is no closed form: the first one that is met counts, or else the run with
# the least estimated error.
REFERENCE_TOLERANCES, REFERENCE_TETRAHEDRA = (0.001, 0.002, 0.005), 500_000
QUICK_TOLERANCES = (0.01,)
# Descriptions of closed forms that hold on the whole body; that of a cylinder holds on its side only.
DESCRIPTIONS: dict[type, str] = {
    Sphere: "the same equation and boundary on the true sphere, solved in closed form",
    Slab: "the same equation and boundary on the endless slab, solved in closed form; both faces, away from the rim",
}


@dataclass(frozen=True, eq=False)
class Reference:
    """The reference exitance at the samples.

    Attributes
    ----------
    kind : {"closed form", "finer run"}
    description : str
        A phrase for the reader of a chart.
    exitance : (n,) ndarray
        Exitance at the samples, W/unit².
    error : float
        Estimated relative L2 error of the reference itself; 0 for a closed form.
    """

    kind: str
    description: str
    exitance: FloatArray
    error: float = 0.0


def closed_form_reference(
    shape: Shape | None, medium: Medium, deposits: Sequence[Deposit], samples: Samples
) -> tuple[Samples, Reference] | None:
    """Evaluate the closed form of the equation and boundary condition that the solver solves.

    Returns
    -------
    tuple of Samples and Reference, or None
        The samples where it holds, on the exact shape. None if there is no closed form for this shape or light, or a
        source is too near to a part where it does not hold.
    """
    if type(shape) not in DESCRIPTIONS:
        return None
    if isinstance(shape, Sphere):
        samples = project_to_sphere(samples, shape)
    try:
        form = next((f for f in closed_forms(shape, medium, deposits).values() if f.same_model), None)
        if form is None:
            return None
        samples = samples.where(form.holds_at(samples.points))
        return samples, Reference("closed form", DESCRIPTIONS[type(shape)], form.exitance(samples.points))
    except InputError:
        return None


def finer_run_reference(case: Case, samples: Samples, *, quick: bool) -> Reference:
    """Run tetlux at the finest tolerance that it meets, or return the most accurate of its runs."""
    best: Solution | None = None
    for tolerance in QUICK_TOLERANCES if quick else REFERENCE_TOLERANCES:
        solution = solve(
            case.surface,
            case.medium,
            case.lights,
            tolerance=tolerance,
            most_tetrahedra=REFERENCE_TETRAHEDRA,
            cache=False,
        )
        if best is None or solution.error_estimate < best.error_estimate:
            best = solution
        if best.error_estimate <= tolerance:
            break
    assert best is not None
    size = f"{len(best.mesh.tetrahedra):,} tetrahedra"
    description = f"tetlux itself on {size}, estimated error {best.error_estimate:.2%}"
    exitance = np.asarray(best.exitance_at(samples.points))
    return Reference("finer run", description, exitance, best.error_estimate)
