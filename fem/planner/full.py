"""Finite elements as a candidate, which solves every scene."""

import numpy as np

from tetlux.fem.adapt import MOST_TETRAHEDRA
from tetlux.fem.memory import BYTES_OF_IMPORTS, estimate_memory
from tetlux.fem.outcome.plan import Candidate
from tetlux.fem.planner.request import Request
from tetlux.fem.sources.deposit import Deposit

# Tetrahedra of the mesher's own mesh, and seconds of the mesher: of built-in shapes and others, and for each triangle.
FIRST_TETRAHEDRA = 6_000
SECONDS_OF_MESHER, SECONDS_OF_TRIANGLE = 0.7, 1.2e-5
# Seconds for each tetrahedron of the last mesh, of all meshes together, and with quadratic elements.
SECONDS_OF_TETRAHEDRON, SECONDS_WITH_QUADRATIC = 2.7e-5, 2e-4
# Tetrahedra at a tolerance of .02, which grow as its inverse: of uniform light, points in several media, and other
# light, whose facets are refined.
OF_UNIFORM, OF_POINTS, OF_BEAM = 5_000, 15_000, 60_000
# Points of a light to which charges are fitted, at most.
MOST_FITTED_POINTS = 30


def full_candidate(request: Request) -> Candidate:
    """What finite elements would cost; they refine until the tolerance is met."""
    kinds = [_tetrahedra(request, deposit) for some in request.deposits for deposit in some]
    tolerance = min(t for t in (request.exitance_tolerance, *request.tolerances.fields.values()))
    tetrahedra = FIRST_TETRAHEDRA + max(kinds) * (0.02 / tolerance)
    if request.mesh is not None:
        tetrahedra = len(request.mesh.tetrahedra)
    tetrahedra = float(np.clip(tetrahedra, 0, MOST_TETRAHEDRA))
    each = SECONDS_WITH_QUADRATIC if request.tolerances.need_quadratic or request.detectors else SECONDS_OF_TETRAHEDRON
    triangles = sum(len(surface.faces) for surface in (request.surface, *request.inner))
    seconds = 0.0 if request.mesh is not None else SECONDS_OF_MESHER + SECONDS_OF_TRIANGLE * triangles
    seconds += each * tetrahedra * len(request.bodies)
    lights = sum(map(len, request.deposits))
    needed = estimate_memory(round(tetrahedra), len(request.bodies), lights, refined=request.mesh is None)
    reason = f"finite elements, about {round(tetrahedra, -3):,.0f} tetrahedra"
    if request.mesh is not None:
        reason = "finite elements on the given mesh"
    return Candidate("full", request.exitance_tolerance, seconds, needed - BYTES_OF_IMPORTS, reason, suits=True)


def _tetrahedra(request: Request, deposit: Deposit) -> float:
    """Tetrahedra that a light needs in addition to the mesher's own, at a tolerance of .02."""
    terms = deposit.terms
    if len(terms.points) and not len(terms.segments) and deposit.on_mesh is None:
        is_fitted = len(terms.points) <= MOST_FITTED_POINTS and request.bodies[0].only_medium is not None
        return 0 if is_fitted and request.mesh is None else OF_POINTS
    if terms.is_distributed and deposit.on_mesh is None:
        return OF_UNIFORM
    return OF_BEAM
