"""The rules that every trial of the stress map must obey."""

import math
from collections.abc import Iterator

from tetlux.cases.stress.measure import Diagnostics
from tetlux.cases.stress.scenes.scenarios import TOLERANCE
from tetlux.cases.stress.trials import Trial
from tetlux.meshing.notes import codes_of

# Tolerances relative to: the largest fluence; the incident power; the load of a linear system; the bound of the maximum
# principle; the largest exitance.
DIP, LEDGER, RESIDUAL, OVERSHOOT, SCALING = 1e-12, 1e-9, 1e-8, 1e-9, 1e-8
# Codes of warnings that explain an error of the discretisation; others explain errors of the model or the surface.
REASONS = {
    "tolerance-missed",
    "detector-tolerance-missed",
    "reading-dark",
    "fluence-negative",
    "power-moved",
    "exitance-negative",
    "power-negative",
    "source-depth-off",
    "no-light-leaves",
}


def broken_rules(trial: Trial) -> dict[str, str]:
    """The rules that a trial breaks, each with a phrase that says by how much."""
    if trial.diagnostics is None:
        return {"failure": trial.message} if trial.outcome == "failed" else {}
    found = trial.diagnostics
    estimate = None if found.of_readings else found.estimate
    figures = [each for each in (found.lowest, found.ledger, found.residual, estimate) if each is not None]
    if not found.finite or not all(map(math.isfinite, figures)):
        return {"not a number": "in fluence, exitance or their sums"}
    return dict(_broken_by(found))


def _broken_by(found: Diagnostics) -> Iterator[tuple[str, str]]:
    if found.lowest is not None and found.lowest < -DIP and not found.may_be_negative:
        yield "negative fluence", f"{found.lowest:.1e} of its maximum"
    if found.overshoot is not None and found.overshoot > OVERSHOOT:
        yield "maximum principle", f"fluence {found.overshoot:.1e} above its bound"
    if found.ledger is not None and abs(found.ledger) > LEDGER:
        yield "ledger", f"{found.ledger:.1e} of the power is missing"
    if found.residual is not None and found.residual > RESIDUAL:
        yield "residual", f"{found.residual:.1e} of the load"
    if found.scaling is not None and found.scaling > SCALING:
        yield "scaling", f"{found.scaling:.1e} from the figures at scale 1"
    if found.error is not None and not found.error <= _allowance(found) and not is_warned(found):
        yield "silent error", f"{found.error:.2g} without a warning, {found.estimate:.2g} by its own estimate"
    if found.bound is not None and found.error is not None and found.error > found.bound:
        yield "bound", f"an error of {found.error:.2g}, above its bound of {found.bound:.2g}"


def _allowance(found: Diagnostics) -> float:
    """The largest error that needs no warning: the tolerance, and of a reading twice its bar if that is more."""
    return max(TOLERANCE, 2.0 * found.estimate) if found.of_readings else TOLERANCE


def violations(trial: Trial) -> dict[str, str]:
    """The rules that a trial breaks, if its variant counts."""
    return broken_rules(trial) if trial.variant.counts else {}


def is_warned(found: Diagnostics) -> bool:
    """Whether a warning explains an error of the discretisation."""
    return not REASONS.isdisjoint(codes_of(found.warnings))
