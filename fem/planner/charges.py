"""Charges as a candidate: fitted to the boundary condition, without a mesh."""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.charges.adapt import COUNT_FACTOR, FEWEST_CHARGES, MOST_CHARGES
from tetlux.fem.meshless.solution import ChargeSolution
from tetlux.fem.meshless.solve import check_deposit, check_simple, homogeneous_medium
from tetlux.fem.outcome.plan import Candidate
from tetlux.fem.planner.candidate import impossible, refuse_mesh
from tetlux.fem.planner.effort import kind_of_body, largest_rate
from tetlux.fem.planner.request import Request
from tetlux.fem.validity.notes import check_size
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.solids import Sphere

# Relative L2 error by 300 charges: of the built-in shapes and of others, as scans.
ERROR_OF_SHAPE, ERROR_OF_SCAN = 2e-4, 6e-3
# Powers of the number of charges with which it falls.
RATE_OF_SHAPE, RATE_OF_SCAN = 2.0, 1.3
# Charges that are tried at least on scans, some .9 s. Shapes need few, and any limit moves the steps of a fit, which
# left the exitance of a torus below zero.
FEWEST_TO_TRY = 600
# Each further region multiplies the error.
ERROR_OF_REGION = 4.0
# Charges at least where points light a body that is no ball and that light fades much in: more of them are fitted until
# the exitance is nowhere below zero.
OF_FADING, FADING_LENGTHS = 200, 4.0
# Charges for what detectors read in bodies with regions: 215 to 1,200 in balls in balls, 450 to 1,420 in fingers.
OF_READINGS_IN_REGIONS = 700
# Seconds that any fit takes, and those of 300 charges, with the smaller fits before it, and how they grow.
SECONDS_OF_ANY, SECONDS_OF_300, RATE_OF_SECONDS = 0.07, 0.25, 1.5
BYTES_OF_300 = 20e6


def charges_candidate(request: Request) -> Candidate:
    """What charges would cost, and whether they are likely to be within the tolerance."""
    try:
        _check(request)
    except InputError as why:
        return impossible("charges", why)
    first, rate = _first_error(request)
    kind = f"charges on {kind_of_body(request)}"
    learned = request.costs.factors(kind)
    first *= learned[1]
    count = float(np.clip(300.0 * (first / request.exitance_tolerance) ** (1.0 / rate), FEWEST_CHARGES, MOST_CHARGES))
    error = first * (300.0 / count) ** rate
    suits = count < MOST_CHARGES or error <= request.exitance_tolerance
    count = max(count * (1 + len(request.inner)), OF_FADING if _has_fading_points(request) else 0.0)
    if request.tolerances.readings is not None and request.inner:
        count = max(count, OF_READINGS_IN_REGIONS)
    size = (count / 300.0) ** 2
    seconds = learned[0] * seconds_of_charges(count) * len(request.bodies)
    reason = f"about {round(count, -1):,.0f} charges, whose residual tells the error"
    if not suits:
        reason = f"{MOST_CHARGES:,} charges are not enough for the tolerance"
    return Candidate("charges", error, seconds, BYTES_OF_300 * size, reason, suits, kind, learned)


def seconds_of_charges(count: float) -> float:
    """Built-in prediction for fitting so many charges."""
    return SECONDS_OF_ANY + SECONDS_OF_300 * float((count / 300.0) ** RATE_OF_SECONDS)


def learn_charges(request: Request, candidate: Candidate, found: Sequence[ChargeSolution], seconds: float) -> None:
    """Learn from a fit how long so many charges take, and by how much 300 of them are off."""
    first, rate = _first_error(request)
    predicted = sum(seconds_of_charges(each.charges) for each in found)
    error = max(each.error_estimate * (each.charges / (1 + len(request.inner)) / 300.0) ** rate for each in found)
    request.costs.learn(candidate.kind, seconds / predicted, error / first)


def _first_error(request: Request) -> tuple[float, float]:
    """Built-in relative L2 error by 300 charges, and the power of their number with which it falls."""
    first, rate = (ERROR_OF_SHAPE, RATE_OF_SHAPE) if _are_shapes(request) else (ERROR_OF_SCAN, RATE_OF_SCAN)
    return first * ERROR_OF_REGION ** len(request.inner), rate


def most_charges(request: Request, candidate: Candidate, seconds: float) -> int:
    """Number of charges at which fitting ends in vain: when it takes as long as another model would."""
    if _are_shapes(request):
        return MOST_CHARGES
    seconds = max(seconds, COUNT_FACTOR**RATE_OF_SECONDS * candidate.seconds) / len(request.bodies)
    count = 300.0 * (seconds / SECONDS_OF_300) ** (1.0 / RATE_OF_SECONDS)
    return int(np.clip(count, FEWEST_TO_TRY, MOST_CHARGES))


def _are_shapes(request: Request) -> bool:
    """Whether the body and its regions are built-in shapes, of which few charges are needed."""
    return all(surface.shape is not None for surface in (request.surface, *request.inner))


def _has_fading_points(request: Request) -> bool:
    """Whether points light a body other than a ball, and their light fades much on its way through it."""
    has_points = any(len(deposit.terms.points) for some in request.deposits for deposit in some)
    if not has_points or isinstance(request.surface.shape, Sphere):
        return False
    return request.surface.diagonal * largest_rate(request) > FADING_LENGTHS


def _check(request: Request) -> None:
    """Refuse what charges cannot give.

    Raises
    ------
    InputError
    """
    refuse_mesh(request)
    if request.tolerances.fields:
        raise InputError("charges tell no errors of single places")
    for surface in (request.surface, *request.inner):
        check_simple(surface)
    for body in request.bodies:
        check_size(body)
    for body, lights, deposits in zip(request.bodies, request.lights, request.deposits, strict=True):
        for medium in body.by_label.values():
            homogeneous_medium(medium)
        for light, deposit in zip(lights, deposits, strict=True):
            check_deposit(light, deposit, body, request.inner)
