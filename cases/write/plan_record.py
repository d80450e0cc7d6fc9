"""``plan`` of a summary: what was planned, and what came of it."""

from typing import Any

from tetlux.cases.plain import finite
from tetlux.fem.outcome.plan import Candidate, Plan
from tetlux.fem.planner.solve import AnySolution


def describe_plan(plan: Plan, solutions: tuple[AnySolution, ...]) -> dict[str, Any]:
    """A plan as plain data, with its predictions beside what was measured.

    Parameters
    ----------
    plan : Plan
        As it was after the run.
    solutions : tuple of Solution, ChargeSolution or ClosedFormSolution
        Of each channel.

    Returns
    -------
    dict
    """
    chosen = plan.best
    return {
        "chosen": plan.chosen,
        "runs": plan.runs,
        "candidates": [_candidate(each) for each in plan.candidates],
        "model_error": {"near_light": plan.near_error, "elsewhere": plan.model_error},
        "predicted": {"seconds": chosen.seconds, "error": chosen.error},
        "measured": {
            "seconds": max(solution.seconds["total"] for solution in solutions),
            "error": finite(max(solution.error_estimate for solution in solutions)),
        },
    }


def _candidate(candidate: Candidate) -> dict[str, Any]:
    return {
        "model": candidate.model,
        "suits": candidate.suits,
        "error": finite(candidate.error),
        "seconds": finite(candidate.seconds),
        "bytes": finite(candidate.bytes),
        "reason": candidate.reason,
    }
