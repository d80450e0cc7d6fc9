"""What must hold of every run on the stress map."""

import math

from tetlux.cases.stress_measure import Figures
from tetlux.cases.stress_scenes import TOLERANCE

# Of the largest fluence; of the incident power; of a linear system's load; of the bound; of the largest exitance.
DIP, LEDGER, RESIDUAL, OVERSHOOT, SCALING = 1e-12, 1e-9, 1e-8, 1e-9, 1e-8
# A warning of this says how good the diffusion equation is, and not how well it was solved.
OF_THE_MODEL = "that diffusion"


def broken(figures: Figures) -> list[str]:
    """What a run breaks, a few words for each.

    Parameters
    ----------
    figures : Figures

    Returns
    -------
    list of str
    """
    numbers = (figures.lowest, figures.ledger, figures.residual, figures.estimate)
    if not figures.finite or not all(map(math.isfinite, numbers)):
        return ["not a number"]
    found = []
    if figures.lowest < -DIP and not figures.dips:
        found.append(f"fluence {figures.lowest:.1e} of its maximum")
    if figures.overshoot is not None and figures.overshoot > OVERSHOOT:
        found.append(f"fluence {figures.overshoot:.1e} above the maximum principle")
    if abs(figures.ledger) > LEDGER:
        found.append(f"ledger {figures.ledger:.1e}")
    if figures.residual > RESIDUAL:
        found.append(f"residual {figures.residual:.1e}")
    if figures.scaling is not None and figures.scaling > SCALING:
        found.append(f"differs by {figures.scaling:.1e} from scale 1")
    if figures.error is not None and not figures.error <= TOLERANCE and not is_warned_of(figures):
        found.append(f"error {figures.error:.2g} without a warning")
    return found


def is_warned_of(figures: Figures) -> bool:
    """Whether a warning names a reason for an error of the solution."""
    return any(OF_THE_MODEL not in warning for warning in figures.warnings)
