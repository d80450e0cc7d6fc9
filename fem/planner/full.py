"""Finite elements as a candidate, which solves every scene."""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.adapt import MOST_TETRAHEDRA
from tetlux.fem.memory import BYTES_OF_IMPORTS, estimate_memory
from tetlux.fem.outcome.plan import Candidate
from tetlux.fem.planner.candidate import impossible
from tetlux.fem.planner.request import Request
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.validity.notes import check_size
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface

# Tetrahedra of the mesher's own mesh, and seconds of the mesher: of built-in shapes and others, and for each triangle.
FIRST_TETRAHEDRA = 6_000
SECONDS_OF_MESHER, SECONDS_OF_TRIANGLE = 0.7, 1.2e-5
# Seconds of the mesher for each diagonal of the smallest region in that of the body: nefertiti with a ball in it, 39 of
# its diagonals, 51 s, parts of it, 19 and 11 of its diagonals, 30 and 12 s.
SECONDS_OF_REGION = 1.2
# Seconds for each tetrahedron of the last mesh, of all meshes together, and with quadratic elements.
SECONDS_OF_TETRAHEDRON, SECONDS_WITH_QUADRATIC = 2.7e-5, 2e-4
# Tetrahedra at a tolerance of .02, which grow as its inverse: of uniform light, points in several media, and other
# light, whose facets are refined.
OF_UNIFORM, OF_POINTS, OF_BEAM = 5_000, 15_000, 60_000
# Points of a light to which charges are fitted, at most.
MOST_FITTED_POINTS = 30


def full_candidate(request: Request) -> Candidate:
    """What finite elements would cost; they refine until the tolerance is met."""
    try:
        for body in request.bodies:
            check_size(body)
    except InputError as why:
        return impossible("full", why)
    tetrahedra = tetrahedra_needed(request)
    triangles = sum(len(surface.faces) for surface in (request.surface, *request.inner))
    seconds = seconds_of_elements(request, tetrahedra)
    if request.mesh is None:
        seconds += SECONDS_OF_MESHER + SECONDS_OF_TRIANGLE * triangles
        seconds += seconds_of_regions(request.surface.diagonal, request.inner)
    reason = f"finite elements, about {round(tetrahedra, -3):,.0f} tetrahedra"
    if request.mesh is not None:
        reason = "finite elements on the given mesh"
    needed = bytes_of_elements(request, tetrahedra)
    return Candidate("full", request.exitance_tolerance, seconds, needed, reason, suits=True)


def tetrahedra_needed(request: Request) -> float:
    """How many tetrahedra the tolerance is likely to need."""
    if request.mesh is not None:
        return len(request.mesh.tetrahedra)
    kinds = [_tetrahedra(request, deposit) for some in request.deposits for deposit in some]
    tolerance = min(request.exitance_tolerance, *request.tolerances.fields.values(), 1.0)
    return float(np.clip(FIRST_TETRAHEDRA + max(kinds) * (0.02 / tolerance), 0, MOST_TETRAHEDRA))


def seconds_of_elements(request: Request, tetrahedra: float) -> float:
    """Seconds to solve and refine."""
    is_quadratic = request.tolerances.need_quadratic or len(request.detectors) > 0
    each = SECONDS_WITH_QUADRATIC if is_quadratic else SECONDS_OF_TETRAHEDRON
    return each * tetrahedra * len(request.bodies)


def seconds_of_regions(diagonal: float, inner: Sequence[Surface]) -> float:
    """Seconds that the mesher takes longer with regions, which grow with how small they are."""
    return SECONDS_OF_REGION * max((diagonal / region.diagonal for region in inner), default=0.0)


def bytes_of_elements(request: Request, tetrahedra: float) -> float:
    """Memory for so many tetrahedra."""
    lights, is_refined = sum(map(len, request.deposits)), request.mesh is None
    return estimate_memory(round(tetrahedra), len(request.bodies), lights, refined=is_refined) - BYTES_OF_IMPORTS


def _tetrahedra(request: Request, deposit: Deposit) -> float:
    """Tetrahedra that a light needs in addition to the mesher's own, at a tolerance of .02."""
    terms = deposit.terms
    if len(terms.points) and not len(terms.segments) and deposit.on_mesh is None:
        is_fitted = len(terms.points) <= MOST_FITTED_POINTS and request.bodies[0].only_medium is not None
        return 0 if is_fitted and request.mesh is None else OF_POINTS
    if terms.is_distributed and deposit.on_mesh is None:
        return OF_UNIFORM
    return OF_BEAM
