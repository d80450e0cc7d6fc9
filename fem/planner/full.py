"""Finite elements as a candidate, which solves every scene."""

from tetlux.fem.memory import BYTES_OF_IMPORTS, estimate_memory
from tetlux.fem.outcome.plan import Candidate
from tetlux.fem.planner.candidate import corrected, impossible
from tetlux.fem.planner.effort import (
    SECONDS_OF_CACHE,
    kind_of_body,
    kind_of_light,
    seconds_of_elements,
    seconds_of_mesher,
    tetrahedra_needed,
)
from tetlux.fem.planner.request import Request
from tetlux.fem.validity.notes import check_size
from tetlux.meshing.errors import InputError


def full_candidate(request: Request) -> Candidate:
    """What finite elements would cost; they refine until the tolerance is met."""
    try:
        for body in request.bodies:
            check_size(body)
    except InputError as why:
        return impossible("full", why)
    tetrahedra = tetrahedra_needed(request)
    seconds = seconds_of_elements(request, tetrahedra)
    if request.is_meshed:
        seconds += SECONDS_OF_CACHE
    elif request.mesh is None:
        seconds += seconds_of_mesher(request.surface, request.inner)
    reason = f"finite elements, about {round(tetrahedra, -3):,.0f} tetrahedra"
    if request.mesh is not None:
        reason = "finite elements on the given mesh"
    needed = bytes_of_elements(request, tetrahedra)
    found = Candidate("full", request.exitance_tolerance, seconds, needed, reason, suits=True)
    mesh = "given mesh" if request.mesh is not None else "cached mesh" if request.is_meshed else kind_of_body(request)
    return corrected(request, found, f"{kind_of_light(request)} on {mesh}")


def bytes_of_elements(request: Request, tetrahedra: float) -> float:
    """Memory for so many tetrahedra."""
    lights, is_refined = sum(map(len, request.deposits)), request.mesh is None
    return estimate_memory(round(tetrahedra), len(request.bodies), lights, refined=is_refined) - BYTES_OF_IMPORTS
