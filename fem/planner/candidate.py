"""What all candidates share."""

import math

from tetlux.fem.outcome.plan import Candidate, Model
from tetlux.fem.planner.request import Request
from tetlux.meshing.errors import InputError


def impossible(model: Model, error: InputError) -> Candidate:
    """A candidate that cannot solve the scene, for the reason of an error, without its remedy."""
    return Candidate(model, math.nan, math.nan, math.nan, reason_of(error), suits=False)


def reason_of(error: InputError) -> str:
    """What is wrong, without the remedy."""
    return error.text.split(";")[0].split(", and model")[0].rstrip(".")


def refuse_mesh(request: Request) -> None:
    """Refuse a request that needs a mesh.

    Raises
    ------
    InputError
    """
    if request.need_of_mesh:
        raise InputError(request.need_of_mesh)
