"""The part of a body that light reaches as a candidate, by finite elements."""

import numpy as np

from tetlux.fem.outcome.plan import Candidate
from tetlux.fem.planner.candidate import corrected, impossible, refuse_mesh, refuse_modulated
from tetlux.fem.planner.effort import (
    SECONDS_OF_MESHER,
    SECONDS_OF_REGION,
    kind_of_light,
    seconds_of_elements,
    tetrahedra_needed,
)
from tetlux.fem.planner.full import bytes_of_elements
from tetlux.fem.planner.request import Request
from tetlux.meshing.errors import InputError

# Seconds of the mesher for each triangle of a part: nefertiti within 50 mm of the light, 18,000 triangles, 1.5 s.
SECONDS_OF_TRIANGLE = 4e-5
# Seconds of cutting for each triangle of the body.
SECONDS_OF_CUT = 5e-6


def truncated_candidate(request: Request) -> Candidate:
    """What finite elements on the part that light reaches would cost."""
    try:
        refuse_mesh(request)
        refuse_modulated(request)
        if request.tolerances.fields or request.detectors:
            raise InputError("the error of the cut is known for the exitance as a whole only")
        box = request.dark_box
    except InputError as why:
        return impossible("truncated", why)
    tetrahedra = tetrahedra_needed(request)
    # Most points have two triangles.
    triangles = 2 * int(((request.surface.points > box.low) & (request.surface.points < box.high)).all(axis=1).sum())
    seconds = SECONDS_OF_CUT * len(request.surface.faces) + SECONDS_OF_MESHER["box"] + SECONDS_OF_TRIANGLE * triangles
    seconds += seconds_of_elements(request, tetrahedra)
    size = float(np.linalg.norm(box.high - box.low))
    seconds += SECONDS_OF_REGION * max((size / region.diagonal for region in request.inner), default=0.0)
    reason = f"finite elements within {box.distance:.3g} {request.surface.unit} of the light, beyond which it is dark"
    needed = bytes_of_elements(request, tetrahedra)
    found = Candidate("truncated", request.exitance_tolerance, seconds, needed, reason, suits=True)
    return corrected(request, found, f"{kind_of_light(request)}{' with regions' if request.inner else ''}")
