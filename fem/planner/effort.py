"""How many tetrahedra lights need, and how many seconds the mesher and finite elements take."""

from collections.abc import Sequence

import numpy as np

from tetlux.fem.adapt import MOST_TETRAHEDRA
from tetlux.fem.charges.adapt import MOST_CHARGES_WITH_FEM
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.medium import Medium
from tetlux.fem.planner.request import Request
from tetlux.fem.sources.deposit import Deposit
from tetlux.meshing.surface.surface import Surface

# Seconds of the mesher, and tetrahedra of its mesh, by shape; "scan" is any other. All figures of this file are least
# squares of what `python -m tests.benchmarks.plans` measures.
SECONDS_OF_MESHER = {"sphere": 0.7, "slab": 0.7, "box": 1.0, "torus": 1.4, "cylinder": 3.2, "scan": 2.0}
FIRST_TETRAHEDRA = {"sphere": 3_000, "slab": 3_000, "box": 6_000, "torus": 2_500, "cylinder": 4_200, "scan": 3_000}
# Seconds of the mesher for each triangle, and for each diagonal of the smallest region in that of the body.
SECONDS_OF_TRIANGLE, SECONDS_OF_REGION = 3e-5, 0.25
# Seconds for each tetrahedron of the last mesh, of all meshes together, and with quadratic elements.
SECONDS_OF_TETRAHEDRON, SECONDS_WITH_QUADRATIC = 1.9e-5, 2e-4
# Seconds of reading a mesh from the cache.
SECONDS_OF_CACHE = 0.02
# Tetrahedra that a light needs in addition to the mesher's own at a tolerance of .02, and the power of the inverse of
# the tolerance by which they grow.
OF_POINTS, RATE_OF_POINTS = 15_000.0, 1.0
OF_SPOT, RATE_OF_SPOT = 110_000.0, 1.35
# Those of the first mesh for each square of the length to resolve where light enters, how many times as many a wide
# beam takes at a tolerance of .02, on shapes and on scans, which get no layers, and their rate.
OF_ENTRY = 110.0
OF_BEAM, OF_BEAM_ON_SCAN, RATE_OF_BEAM = 0.45, 1.5, 1.5
# Those of the layer below uniform light for each square of the length over which light fades, at a tolerance of .02,
# and the share of them that a wide beam needs at least, which lights one side.
OF_LAYER, SHARE_OF_BEAM = 220.0, 0.5
# The share of them that light takes to which charges are fitted, but do not follow it closely enough.
SHARE_OF_FITTED = 0.9
# Relative L2 error of charges under diffuse light, of one charge in each square of the length over which light fades,
# and the power of charges per square with which it falls. Estimate of ten shapes by 85 to 1,540 charges: .7 to 1.6
# times as much; of a hare 1.1 and 1.7 times.
ERROR_OF_DIFFUSE, RATE_OF_DIFFUSE = 0.02, 0.75
# Points of a light to which charges are fitted, at most.
MOST_FITTED_POINTS = 30
TOLERANCE = 0.02


def kind_of_body(request: Request) -> str:
    """The built-in shape of the body, or "scan", and whether it has regions."""
    name = shape_of(request.surface)
    return f"{name} with regions" if request.inner else name


def tetrahedra_needed(request: Request) -> float:
    """How many tetrahedra the tolerance is likely to need."""
    if request.mesh is not None:
        return len(request.mesh.tetrahedra)
    needed = [tetrahedra_of(request, deposit) for some in request.deposits for deposit in some]
    return float(min(FIRST_TETRAHEDRA[shape_of(request.surface)] + max(needed), MOST_TETRAHEDRA))


def seconds_of_mesher(surface: Surface, inner: Sequence[Surface]) -> float:
    """Seconds of the mesher, which grow with how small the regions are."""
    triangles = sum(len(each.faces) for each in (surface, *inner))
    ratio = max((surface.diagonal / region.diagonal for region in inner), default=0.0)
    return SECONDS_OF_MESHER[shape_of(surface)] + SECONDS_OF_TRIANGLE * triangles + SECONDS_OF_REGION * ratio


def seconds_of_elements(request: Request, tetrahedra: float) -> float:
    """Seconds to solve and refine."""
    is_quadratic = request.tolerances.need_quadratic or len(request.detectors) > 0
    each = SECONDS_WITH_QUADRATIC if is_quadratic else SECONDS_OF_TETRAHEDRON
    return each * tetrahedra * len(request.bodies)


def largest_rate(request: Request) -> float:
    """The largest rate at which light fades in one of the media, 1/unit."""
    return _largest_rate([medium for body in request.bodies for medium in body.by_label.values()])


def error_in_diffuse_light(request: Request, charges: float) -> float:
    """Relative L2 error of so many charges under diffuse light."""
    squares = request.surface.area * largest_rate(request) ** 2
    return float(ERROR_OF_DIFFUSE * (squares / charges) ** RATE_OF_DIFFUSE)


def kind_of_light(request: Request) -> str:
    """The kind of the light that needs most tetrahedra."""
    every = [deposit for some in request.deposits for deposit in some]
    return _kind(request, max(every, key=lambda deposit: tetrahedra_of(request, deposit)))


def tetrahedra_of(request: Request, deposit: Deposit) -> float:
    """Tetrahedra that a light needs in addition to the mesher's own."""
    kind = _kind(request, deposit)
    ratio = TOLERANCE / min(request.exitance_tolerance, *request.tolerances.fields.values(), 1.0)
    if kind == "points":
        return OF_POINTS * float(ratio**RATE_OF_POINTS)
    if kind == "spot":
        return OF_SPOT * float(ratio**RATE_OF_SPOT) + _squares_of_entry(deposit) * OF_ENTRY
    if kind == "beam":
        has_layers = request.surface.shape is not None and not request.inner
        share = OF_BEAM if has_layers else OF_BEAM_ON_SCAN
        of_entry = _squares_of_entry(deposit) * OF_ENTRY * share * float(ratio**RATE_OF_BEAM)
        return max(of_entry, SHARE_OF_BEAM * _of_layer(request, ratio))
    if kind == "layer":
        return _of_layer(request, ratio)
    if kind == "fitted" and np.any(deposit.terms.irradiance):
        left = error_in_diffuse_light(request, MOST_CHARGES_WITH_FEM) * ratio / TOLERANCE
        return SHARE_OF_FITTED * min(left, 1.0) * _of_layer(request, ratio)
    return 0.0


def _of_layer(request: Request, ratio: float) -> float:
    """Tetrahedra of the layer of the whole surface in which light fades."""
    outer = [body.outer for body in request.bodies]
    return OF_LAYER * request.surface.area * _largest_rate(outer) ** 2 * ratio


def _kind(request: Request, deposit: Deposit) -> str:
    """What a light is to finite elements: fitted by charges, or what has to be resolved."""
    terms, is_one = deposit.terms, request.bodies[0].only_medium is not None and request.mesh is None
    if deposit.on_mesh is not None:
        return "beam" if deposit.footprint.radius == np.inf else "spot"
    if len(terms.segments) or len(terms.points) > MOST_FITTED_POINTS:
        return "points"
    if is_one:
        return "fitted"
    return "points" if len(terms.points) else "layer"


def _squares_of_entry(deposit: Deposit) -> int:
    """In how many cubes of the length to resolve a light enters the body."""
    places, size = deposit.hints.places, deposit.hints.resolution
    if len(places) == 0 or not 0.0 < size < np.inf:
        return 0
    return len(np.unique(np.floor(places / size), axis=0))


def _largest_rate(media: Sequence[AnyMedium]) -> float:
    return max((medium.sigma_tr for medium in media if isinstance(medium, Medium)), default=0.0)


def shape_of(surface: Surface) -> str:
    """The name of a built-in shape, or "scan"."""
    name = type(surface.shape).__name__.lower()
    return name if name in SECONDS_OF_MESHER else "scan"
