"""What must hold of every run on the stress map."""

import math

from tetlux.cases.stress.measure import Figures
from tetlux.cases.stress.runs import Run
from tetlux.cases.stress.scenes import TOLERANCE

# Of the largest fluence; of the incident power; of a linear system's load; of the bound; of the largest exitance.
DIP, LEDGER, RESIDUAL, OVERSHOOT, SCALING = 1e-12, 1e-9, 1e-8, 1e-9, 1e-8
# What warnings say that are of how well the equation was solved, and not of how good it is, or of the surface.
REASONS = ("was not met", "below zero", "the mesh's facets", "far too coarse", "no light leaves")


def broken(run: Run) -> dict[str, str]:
    """What a run breaks: the rule, and by how much."""
    if run.figures is None:
        return {"failure": run.message} if run.outcome == "failed" else {}
    figures = run.figures
    numbers = (figures.lowest, figures.ledger, figures.residual, figures.estimate)
    if not figures.finite or not all(map(math.isfinite, numbers)):
        return {"not a number": "in fluence, exitance or their sums"}
    found = {}
    if figures.lowest < -DIP and not figures.dips:
        found["negative fluence"] = f"{figures.lowest:.1e} of its maximum"
    if figures.overshoot is not None and figures.overshoot > OVERSHOOT:
        found["maximum principle"] = f"fluence {figures.overshoot:.1e} above its bound"
    if abs(figures.ledger) > LEDGER:
        found["ledger"] = f"{figures.ledger:.1e} of the power is missing"
    if figures.residual > RESIDUAL:
        found["residual"] = f"{figures.residual:.1e} of the load"
    if figures.scaling is not None and figures.scaling > SCALING:
        found["scaling"] = f"{figures.scaling:.1e} from the figures at scale 1"
    if figures.error is not None and not figures.error <= TOLERANCE and not is_warned(figures):
        found["silent error"] = f"{figures.error:.2g} without a warning"
    return found


def violations(run: Run) -> dict[str, str]:
    """What a run breaks, if it is of a method that may not."""
    return broken(run) if run.method.counts else {}


def is_warned(figures: Figures) -> bool:
    """Whether a warning names a reason for an error of the solution."""
    return any(reason in warning for warning in figures.warnings for reason in REASONS)
