"""Charges as a candidate: fitted to the boundary condition, without a mesh."""

import numpy as np

from tetlux.fem.charges.adapt import COUNT_FACTOR, FEWEST_CHARGES, MOST_CHARGES
from tetlux.fem.meshless.solve import check_deposit, check_simple, homogeneous_medium
from tetlux.fem.outcome.plan import Candidate
from tetlux.fem.planner.candidate import impossible, refuse_mesh
from tetlux.fem.planner.request import Request
from tetlux.fem.validity.notes import check_size
from tetlux.meshing.errors import InputError

# Relative L2 error by 300 charges: of the built-in shapes and of others, as scans.
ERROR_OF_SHAPE, ERROR_OF_SCAN = 2e-4, 6e-3
# Powers of the number of charges with which it falls.
RATE_OF_SHAPE, RATE_OF_SCAN = 2.0, 1.3
# Charges that are tried at least on scans, some .9 s. Shapes need few, and any limit moves the steps of a fit, which
# left the exitance of a torus below zero.
FEWEST_TO_TRY = 600
# Each further region multiplies the error.
ERROR_OF_REGION = 4.0
# Seconds that any fit takes: `python -m tests.benchmarks.plans` has .06 to .17 for 100 charges.
SECONDS_OF_ANY = 0.08
# Seconds and bytes of a fit of 300 charges, with those of the smaller fits before it; they grow with the square.
SECONDS_OF_300, BYTES_OF_300 = 0.22, 20e6


def charges_candidate(request: Request) -> Candidate:
    """What charges would cost, and whether they are likely to be within the tolerance."""
    try:
        _check(request)
    except InputError as why:
        return impossible("charges", why)
    first, rate = (ERROR_OF_SHAPE, RATE_OF_SHAPE) if _are_shapes(request) else (ERROR_OF_SCAN, RATE_OF_SCAN)
    first *= ERROR_OF_REGION ** len(request.inner)
    count = float(np.clip(300.0 * (first / request.exitance_tolerance) ** (1.0 / rate), FEWEST_CHARGES, MOST_CHARGES))
    error = first * (300.0 / count) ** rate
    suits = count < MOST_CHARGES or error <= request.exitance_tolerance
    count *= 1 + len(request.inner)
    size = (count / 300.0) ** 2
    seconds = (SECONDS_OF_ANY + SECONDS_OF_300 * size) * len(request.bodies)
    reason = f"about {round(count, -1):,.0f} charges, whose residual tells the error"
    if not suits:
        reason = f"{MOST_CHARGES:,} charges are not enough for the tolerance"
    return Candidate("charges", error, seconds, BYTES_OF_300 * size, reason, suits)


def most_charges(request: Request, candidate: Candidate, seconds: float) -> int:
    """Number of charges at which fitting ends in vain: when it takes as long as another model would."""
    if _are_shapes(request):
        return MOST_CHARGES
    seconds = max(seconds, COUNT_FACTOR**2 * candidate.seconds) / len(request.bodies)
    count = 300.0 * np.sqrt(seconds / SECONDS_OF_300)
    return int(np.clip(count, FEWEST_TO_TRY, MOST_CHARGES))


def _are_shapes(request: Request) -> bool:
    """Whether the body and its regions are built-in shapes, of which few charges are needed."""
    return all(surface.shape is not None for surface in (request.surface, *request.inner))


def _check(request: Request) -> None:
    """Refuse what charges cannot give.

    Raises
    ------
    InputError
    """
    refuse_mesh(request)
    if request.tolerances.fields:
        raise InputError("charges tell no errors of single places")
    if request.tolerances.readings is not None and request.inner:
        raise InputError("charges are fitted for readings in a body without regions only")
    for surface in (request.surface, *request.inner):
        check_simple(surface)
    for body in request.bodies:
        check_size(body)
    for body, lights, deposits in zip(request.bodies, request.lights, request.deposits, strict=True):
        for medium in body.by_label.values():
            homogeneous_medium(medium)
        for light, deposit in zip(lights, deposits, strict=True):
            check_deposit(light, deposit, body, request.inner)
