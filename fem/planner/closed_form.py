"""Closed forms as a candidate: exact series of a ball or slab."""

import math
from collections.abc import Sequence

import numpy as np

from tetlux.fem.meshless.exact_field import ExactField
from tetlux.fem.outcome.plan import Candidate
from tetlux.fem.planner.candidate import impossible, refuse_mesh, refuse_modulated
from tetlux.fem.planner.request import Request
from tetlux.fem.quadratic.field_error import DARKEST
from tetlux.meshing.errors import InputError

# Seconds that making a closed form takes.
SECONDS = 0.01


def closed_form_candidate(request: Request) -> Candidate:
    """What a closed form would cost, and whether it is close enough to the body."""
    try:
        refuse_mesh(request)
        refuse_modulated(request)
        fields = request.exact_fields
    except InputError as why:
        return impossible("closed-form", why)
    error = max(field.error for field in fields)
    seconds = SECONDS + request.points * sum(field.seconds_per_point for field in fields)
    missed = _missed(request, fields, error)
    reason = f"{fields[0].name} {missed}".rstrip()
    return Candidate("closed-form", error, seconds, 1e6, reason, suits=not missed)


def _missed(request: Request, fields: Sequence[ExactField], error: float) -> str:
    """Which tolerance the ends of the body make a closed form miss; empty if it misses none."""
    wanted = request.tolerances
    if wanted.exitance is not None and not error <= wanted.exitance:
        return "does not hold in this body, which ends too near the light"
    if wanted.readings is not None:
        places = np.array([placed.position for placed in wanted.placed])
        if not max(float(field.errors_at(places).max()) for field in fields) <= wanted.readings:
            return "does not hold at a detector, since the body ends too near"
    for tolerance in wanted.fields.values():
        if not max(field.error_in_the_dark(DARKEST) for field in fields) <= tolerance:
            return "does not hold where it is dark, since the body ends there"
    return "" if math.isfinite(error) else "has no finite error"
