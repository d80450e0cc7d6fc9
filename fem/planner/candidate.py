"""What all candidates share."""

import math
from dataclasses import replace

from tetlux.fem.outcome.plan import Candidate, Model
from tetlux.fem.planner.request import Request
from tetlux.meshing.errors import InputError


def impossible(model: Model, error: InputError) -> Candidate:
    """A candidate that cannot solve the scene, for the reason of an error, without its remedy."""
    return Candidate(model, math.nan, math.nan, math.nan, reason_of(error), suits=False)


def reason_of(error: InputError) -> str:
    """What is wrong, without the remedy."""
    return error.text.split(";")[0].split(", and model")[0].rstrip(".")


def corrected(request: Request, candidate: Candidate, kind: str) -> Candidate:
    """A candidate of some kind, its predictions corrected by what past runs of that kind took and were off by."""
    kind = f"{candidate.model} {kind}"
    seconds, error = request.costs.factors(kind)
    return replace(
        candidate,
        seconds=candidate.seconds * seconds,
        error=candidate.error * error,
        kind=kind,
        learned=(seconds, error),
    )


def refuse_mesh(request: Request) -> None:
    """Refuse a request that needs a mesh.

    Raises
    ------
    InputError
    """
    if request.need_of_mesh:
        raise InputError(request.need_of_mesh)


def refuse_modulated(request: Request) -> None:
    """Refuse modulated light, which only finite elements on the whole body and charges solve for.

    Raises
    ------
    InputError
    """
    if request.is_modulated:
        raise InputError("it is for steady light alone")
