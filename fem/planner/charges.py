"""Charges as a candidate: fitted to the boundary condition, without a mesh."""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.charges.adapt import COUNT_FACTOR, FEWEST_CHARGES, MOST_CHARGES
from tetlux.fem.meshless.solution import ChargeSolution
from tetlux.fem.meshless.solve import check_deposit, check_simple, homogeneous_medium
from tetlux.fem.outcome.plan import Candidate
from tetlux.fem.planner.candidate import impossible, refuse_mesh
from tetlux.fem.planner.effort import (
    RATE_OF_DIFFUSE,
    error_in_diffuse_light,
    kind_of_body,
    shape_of,
)
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
# Charges where points light a body and their light fades on its way through it, and the lengths over which it fades in
# the body's diagonal from which and up to which so many are needed: more are fitted until the exitance is nowhere below
# zero. Of 100 scenes: spheres take 80 to 130 at any length, boxes 118 to 330 from 7 to 22 and 123 to 132 beyond,
# cylinders 100 to 300, slabs 110 to 330 from 4 on, tori 280 to 510, a hare 170 to 840.
OF_FADING = {
    "slab": (200.0, 4.5, 60.0),
    "cylinder": (130.0, 8.0, 20.0),
    "box": (200.0, 8.0, 18.0),
    "torus": (380.0, 0.0, 60.0),
    "scan": (450.0, 2.5, 60.0),
}
# Shapes with parts in the shade: with regions in them, charges left the exitance below zero on 15 of 16 scenes.
SHADED = ("torus", "scan")
MOST_FADING_IN_SHADE = 40.0
# Slabs with regions in which light fades so many times faster took more than 1,100 charges, in vain on five of six.
MOST_CONTRAST_OF_SLAB = 9.0
# Charges in bodies with regions, where the power that is lacking often asks for more of them than the tolerance: so
# many for each time that light fades faster in one medium than in another, from the fewest to the most. Bodies whose
# diagonal has fewer than the least lengths over which light fades need the fewest: 244 to 266 on seven of eight.
OF_CONTRAST, FEWEST_IN_REGIONS, MOST_IN_REGIONS, LEAST_FADING = 75.0, 240.0, 900.0, 5.0
# Charges for what detectors read in bodies with regions: 215 to 1,200 in balls in balls, 450 to 1,420 in fingers.
OF_READINGS_IN_REGIONS = 700
# Seconds that any fit takes, those for each triangle, those of 300 charges, with the smaller fits before it, and how
# they grow with the number. Regions take so many times as long.
SECONDS_OF_ANY, SECONDS_OF_TRIANGLE = 0.03, 7e-6
SECONDS_OF_300, RATE_OF_SECONDS, FACTOR_OF_REGIONS = 0.18, 1.8, 1.7
BYTES_OF_300 = 20e6


def charges_candidate(request: Request) -> Candidate:
    """What charges would cost, and whether they are likely to be within the tolerance."""
    try:
        _check(request)
    except InputError as why:
        return impossible("charges", why)
    first, rate = _first_error(request)
    kind = f"charges on {kind_of_body(request)}{' in diffuse light' if _is_diffuse(request) else ''}"
    learned = request.costs.factors(kind)
    first *= learned[1]
    needed = 300.0 * (first / request.exitance_tolerance) ** (1.0 / rate)
    suits = needed <= MOST_CHARGES
    count = _next_count(needed)
    error = first * (300.0 / count) ** rate
    count = max(count * _share_of_regions(request), _of_fading(request))
    if request.inner:
        count = max(count, _of_contrast(request) if request.tolerances.readings is None else OF_READINGS_IN_REGIONS)
    size = (count / 300.0) ** 2
    seconds = learned[0] * _seconds_of(request, count) * len(request.bodies)
    reason = f"about {round(count, -1):,.0f} charges, whose residual tells the error"
    if not suits:
        reason = f"{MOST_CHARGES:,} charges are not enough for the tolerance"
    return Candidate("charges", error, seconds, BYTES_OF_300 * size, reason, suits, kind, learned)


def seconds_of_charges(count: float) -> float:
    """Built-in prediction for fitting so many charges."""
    return SECONDS_OF_ANY + SECONDS_OF_300 * float((count / 300.0) ** RATE_OF_SECONDS)


def _seconds_of(request: Request, count: float) -> float:
    """Built-in prediction for fitting so many charges to the body."""
    of_triangles = SECONDS_OF_TRIANGLE * sum(len(each.faces) for each in (request.surface, *request.inner))
    return of_triangles + seconds_of_charges(count) * (FACTOR_OF_REGIONS if request.inner else 1.0)


def _share_of_regions(request: Request) -> float:
    """How many times as many charges as a body without regions a body needs, at least."""
    return max(1.0, 0.5 * (1 + len(request.inner)))


def _next_count(needed: float) -> float:
    """The number of charges of the first fit, of those with growing numbers, that has as many as are needed."""
    steps = round(np.log(MOST_CHARGES / FEWEST_CHARGES) / np.log(COUNT_FACTOR))
    counts = np.geomspace(FEWEST_CHARGES, MOST_CHARGES, steps + 1)
    return float(counts[min(np.searchsorted(counts, needed), steps)])


def learn_charges(request: Request, candidate: Candidate, found: Sequence[ChargeSolution], seconds: float) -> None:
    """Learn from a fit how long fits of its kind take, and by how much 300 charges are off."""
    first, rate = _first_error(request)
    built_in = candidate.seconds / candidate.learned[0]
    error = max(each.error_estimate * (each.charges / _share_of_regions(request) / 300.0) ** rate for each in found)
    request.costs.learn(candidate.kind, seconds / built_in, error / first)


def _first_error(request: Request) -> tuple[float, float]:
    """Built-in relative L2 error by 300 charges, and the power of their number with which it falls."""
    first, rate = (ERROR_OF_SHAPE, RATE_OF_SHAPE) if _are_shapes(request) else (ERROR_OF_SCAN, RATE_OF_SCAN)
    first *= ERROR_OF_REGION ** len(request.inner)
    if _is_diffuse(request):
        return max(first, error_in_diffuse_light(request, 300.0)), RATE_OF_DIFFUSE
    return first, rate


def _is_diffuse(request: Request) -> bool:
    """Whether light enters everywhere."""
    return any(bool(np.any(deposit.terms.irradiance)) for some in request.deposits for deposit in some)


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


def _of_contrast(request: Request) -> float:
    """Charges at least in a body with regions."""
    if _lengths(request) < LEAST_FADING:
        return FEWEST_IN_REGIONS
    return float(np.clip(OF_CONTRAST * _contrast(request), FEWEST_IN_REGIONS, MOST_IN_REGIONS))


def _contrast(request: Request) -> float:
    """How many times faster light fades in one medium than in another."""
    media = [homogeneous_medium(medium) for body in request.bodies for medium in body.by_label.values()]
    rates = [medium.sigma_tr for medium in media]
    return max(rates) / max(min(rates), np.finfo(float).tiny)


def _lengths(request: Request) -> float:
    """How many lengths over which light fades, outside of regions, fit into the body's diagonal."""
    return request.surface.diagonal * max(homogeneous_medium(body.outer).sigma_tr for body in request.bodies)


def _of_fading(request: Request) -> float:
    """Charges at least where points light a body that is faint elsewhere."""
    count, least, most = OF_FADING.get(shape_of(request.surface), (0.0, 0.0, 0.0))
    has_points = any(len(deposit.terms.points) for some in request.deposits for deposit in some)
    return count if has_points and not request.is_modulated and least <= _lengths(request) < most else 0.0


def _check_regions(request: Request) -> None:
    """Refuse an exitance all over a body with regions where charges have been in vain.

    Raises
    ------
    InputError
    """
    if not request.inner or request.tolerances.exitance is None:
        return
    shape, lengths = shape_of(request.surface), _lengths(request)
    # Amplitudes of modulated light may be below zero.
    if shape in SHADED and lengths < MOST_FADING_IN_SHADE and not request.is_modulated:
        raise InputError("with regions in a body that shades parts of itself charges leave light below zero")
    if shape == "slab" and lengths >= LEAST_FADING and _contrast(request) > MOST_CONTRAST_OF_SLAB:
        raise InputError("regions of so much contrast in a slab need too many charges")


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
    _check_regions(request)
