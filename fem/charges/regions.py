"""Charges in a body of homogeneous regions: each region has charges of its own, outside it.

Charges of a region lie outside its outer surface and inside the surfaces of regions within it, so that they solve its
equation in it. They are fitted to ``D dphi/dn + phi/(2A) = 0`` on the body's surface, and to the continuity of phi and
``D dphi/dn`` on the surface of an inner region. Equations for phi are divided by 2A, so that all are in W/unit².
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.charges.adapt import COUNT_FACTOR, FEWEST_CHARGES, MOST_CHARGES, SMOOTH_ESTIMATE
from tetlux.fem.charges.check import ErrorEstimates, exitance_error, norm, residual_wave_number
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.fit import factorise
from tetlux.fem.charges.jumps import Jumps, errors_by_jumps, jumps_of
from tetlux.fem.charges.kernel import Equation
from tetlux.fem.charges.placement import (
    EQUATION_REFINEMENT,
    HEIGHT_ROUGH,
    HEIGHT_SMOOTH,
    ChargePlacement,
    distance_from,
    place_above_surface,
    place_charges_at,
    spacing_scale,
    weight_by_distance,
)
from tetlux.fem.charges.readings import ReadingGoal
from tetlux.fem.charges.samples import Samples, scaled
from tetlux.meshing.arrays import FloatArray, IntArray, NumberArray
from tetlux.meshing.surface.surface import Surface

# Equations are weighted by this power of the distance from the light, larger than in one medium, since light from deep
# regions is faint. Four-layer head, 1,050 charges: error in % of the reading at 30°, and of the exitance, for powers of
# .75 / 1.25 / 1.5: -.99, .0045 / -.75, .0047 / -.66, .0049; of the reading at 45°: 1.0 / .03 / -.19.
DISTANCE_EXPONENT = 1.25
# Only the long waves of the residual at an inner interface reach the body's surface: this is their length over that of
# waves at the body's surface. Estimate over error on 24 random balls of two or three layers: .26 to 1.9 with 1, .89 to
# 3.8 with 3.
INNER_RIPPLE_FACTOR = 3.0
# A last fit with the most charges is made if these are at least this many times those of the fit before.
LEAST_LAST_FACTOR = 1.2


@dataclass(frozen=True, eq=False)
class Interface:
    """The outer surface of a region, or of the body.

    Attributes
    ----------
    surface : Surface
    inside : int
        The region.
    outside : int or None
        The region around it; None for the body itself.
    """

    surface: Surface
    inside: int
    outside: int | None


@dataclass(frozen=True, eq=False)
class InterfacePlacement:
    """Positions of charges on both sides of an interface.

    Attributes
    ----------
    interface : Interface
    placement : ChargePlacement
        Of charges of the region inside, which lie outside the interface.
    charges_inside : (c, 3) ndarray
        Charges of the region outside, which lie inside the interface.
    """

    interface: Interface
    placement: ChargePlacement
    charges_inside: FloatArray


@dataclass(frozen=True, eq=False)
class RegionSources:
    """Point sources: positions (p, 3), regions (p,), and powers (p, s) in s lights, W."""

    points: FloatArray
    regions: IntArray
    powers: NumberArray


@dataclass(frozen=True, eq=False)
class FittedRegions:
    """Fitted charges of each region.

    Attributes
    ----------
    fields : tuple of ChargeField
        Of the region around all others, then of regions 1, 2, ...: sources, then charges.
    placements : tuple of InterfacePlacement
    residual : (n,) ndarray
        Of the boundary condition at the checked points of the body's surface, of all lights together, W/unit².
    jumps : tuple of Jumps
        At the checked points of the surfaces of regions 1, 2, ..., of all lights together.
    errors : ErrorEstimates
    """

    fields: tuple[ChargeField, ...]
    placements: tuple[InterfacePlacement, ...]
    residual: NumberArray
    jumps: tuple[Jumps, ...]
    errors: ErrorEstimates


def place_at_interfaces(
    interfaces: Sequence[Interface], light: RegionSources, count: int, height: float = HEIGHT_ROUGH
) -> list[InterfacePlacement]:
    """Positions of about `count` charges of all regions together."""
    rng = np.random.default_rng(0)
    spacings = [distance_from(interface.surface, light.points) for interface in interfaces]
    inner = sum(interface.outside is not None for interface in interfaces)
    # An inner interface has charges on both sides.
    share = len(interfaces) / (len(interfaces) + inner)
    surfaces = [interface.surface for interface in interfaces]
    scale = spacing_scale(surfaces, spacings, share * count)
    found = []
    for interface, spacing in zip(interfaces, spacings, strict=True):
        weight = weight_by_distance(spacing, DISTANCE_EXPONENT)
        placement = place_charges_at(interface.surface, scaled(spacing, scale), weight, rng, height)
        charges_inside = np.zeros((0, 3))
        if interface.outside is not None:
            turned = replace(interface.surface, faces=interface.surface.faces[:, ::-1])
            feet = replace(placement.feet, normals=-placement.feet.normals)
            inward, clear = place_above_surface(turned, feet, EQUATION_REFINEMENT * feet.spacing, height)
            charges_inside = inward[clear]
        found.append(InterfacePlacement(interface, placement, charges_inside))
    return found


def boundary_equations(
    interface: Interface, samples: Samples, equations: Sequence[Equation], charges: Sequence[FloatArray]
) -> list[NumberArray]:
    """Boundary or interface equations at samples (m,) for unit charges of each region, (c, 3) each, W/unit².

    Returns
    -------
    list of (m, c) or (2 m, c) ndarray
        On the body's surface ``D dphi/dn + phi/(2A)``; on others the jumps of ``phi/(2A)`` and of ``D dphi/dn``.
    """
    rows = 1 if interface.outside is None else 2
    found: list[NumberArray] = []
    for region, (equation, positions) in enumerate(zip(equations, charges, strict=True)):
        if region not in (interface.inside, interface.outside):
            found.append(np.zeros((rows * len(samples), len(positions))))
            continue
        fluence, flux = equation.traces_of_each(samples.points, samples.normals, positions)
        fluence *= equation.robin
        if interface.outside is None:
            found.append(fluence + flux)
        else:
            found.append((1.0 if region == interface.inside else -1.0) * np.vstack([fluence, flux]))
    return found


def fit_regions(
    interfaces: Sequence[Interface],
    equations: Sequence[Equation],
    light: RegionSources,
    *,
    tolerance: float | None,
    goal: ReadingGoal | None = None,
    most: int = MOST_CHARGES,
) -> Iterator[tuple[FittedRegions, float]]:
    """Fit growing numbers of charges, the last of about `most`.

    Parameters
    ----------
    interfaces : sequence of Interface
        The body's surface first, then those of regions 1, 2, ...
    equations : sequence of Equation
        Of region 0, around all others, and of regions 1, 2, ...
    light : RegionSources
    tolerance : float, optional
        Relative L2 error of the exitance.
    goal : ReadingGoal, optional
        Detectors on the body's surface, and the relative error of what each reads.
    most : int
        Approximate number of charges at which fitting ends.

    Yields
    ------
    FittedRegions and float
        The fit so far that is nearest to the tolerances, and its largest estimated error over its tolerance.
    """
    count, height = min(FEWEST_CHARGES * (2 * len(interfaces) - 1), most), HEIGHT_ROUGH
    best, least = None, np.inf
    while True:
        fitted = fit_regions_at(place_at_interfaces(interfaces, light, count, height), equations, light)
        excess = _excess(fitted, tolerance, goal)
        if best is None or excess < least:
            best, least = fitted, excess
        yield best, least
        if LEAST_LAST_FACTOR * count > most:
            return
        count = min(round(COUNT_FACTOR * count), most)
        height = HEIGHT_SMOOTH if best.errors.estimate <= SMOOTH_ESTIMATE else HEIGHT_ROUGH


def _excess(fitted: FittedRegions, tolerance: float | None, goal: ReadingGoal | None) -> float:
    """The largest estimated error over its tolerance."""
    if goal is None:
        assert tolerance is not None
        return fitted.errors.estimate / tolerance
    body, exitance = fitted.placements[0], fitted.fields[0].exitance(goal.detectors).sum(axis=1)
    checked = body.placement.checked
    at_surface = goal.relative_errors(checked, EQUATION_REFINEMENT * checked.spacing, fitted.residual, exitance)
    within = errors_by_jumps(body.interface.surface, goal, fitted.jumps, exitance)
    return goal.excess(np.hypot(at_surface, within), fitted.errors.estimate, tolerance)


def fit_regions_at(
    placements: Sequence[InterfacePlacement], equations: Sequence[Equation], light: RegionSources
) -> FittedRegions:
    """Fit the strengths of charges of all regions at given positions."""
    regions = range(len(equations))
    charges = [np.vstack([np.zeros((0, 3)), *(_charges_at(each, region) for each in placements)]) for region in regions]
    mine = [light.regions == region for region in regions]
    sources, powers = [light.points[own] for own in mine], [light.powers[own] for own in mine]
    matrix, right = [], []
    for each in placements:
        samples = each.placement.fitted
        scale = np.tile(each.placement.weights, 1 if each.interface.outside is None else 2)[:, None]
        matrix.append(scale * np.hstack(boundary_equations(each.interface, samples, equations, charges)))
        given = boundary_equations(each.interface, samples, equations, sources)
        right.append(-scale * sum(some @ power for some, power in zip(given, powers, strict=True)))
    strengths = factorise(np.vstack(matrix)).solve(np.vstack(right))
    parts = np.split(strengths, np.cumsum([len(some) for some in charges])[:-1])
    fields = tuple(
        ChargeField(equation, np.vstack([points, some]), np.vstack([power, part]))
        for equation, points, some, power, part in zip(equations, sources, charges, powers, parts, strict=True)
    )
    sums = [replace(field, strengths=field.strengths.sum(axis=1)) for field in fields]
    checked = placements[0].placement.checked
    exitance, residual = sums[0].exitance_and_residual(checked.points, checked.normals)
    jumps = tuple(_jumps_at(each, sums) for each in placements[1:])
    errors = _estimate_errors(sums, placements, exitance, residual, jumps)
    return FittedRegions(fields, tuple(placements), residual, jumps, errors)


def _jumps_at(each: InterfacePlacement, fields: Sequence[ChargeField]) -> Jumps:
    """Jumps at the checked points of the surface of a region."""
    inside, outside, checked = each.interface.inside, each.interface.outside, each.placement.checked
    assert outside is not None
    return jumps_of(fields[inside], fields[outside], checked, EQUATION_REFINEMENT * checked.spacing)


def _charges_at(each: InterfacePlacement, region: int) -> FloatArray:
    """Charges of a region at an interface, (c, 3)."""
    if region == each.interface.inside:
        return each.placement.charges
    return each.charges_inside if region == each.interface.outside else np.zeros((0, 3))


def _estimate_errors(
    fields: Sequence[ChargeField],
    placements: Sequence[InterfacePlacement],
    exitance: NumberArray,
    residual: NumberArray,
    jumps: Sequence[Jumps],
) -> ErrorEstimates:
    """No bound, and an estimate from the residuals at points that were not fitted.

    A jump of phi across an inner interface changes phi by half of the jump on either side. A jump of the flux changes
    phi as a sheet of charges does, by ``1/(2 D q)`` of the jump for a wave number q. Both fade as ``exp(-q l)`` on the
    way to the body's surface, a distance l away.
    """
    body, *others = placements
    outer, checked = fields[0].equation, body.placement.checked
    total = norm(checked.areas, exitance_error(outer, residual, EQUATION_REFINEMENT * checked.spacing))
    for each, jump in zip(others, jumps, strict=True):
        assert each.interface.outside is not None
        ripple = residual_wave_number(outer, INNER_RIPPLE_FACTOR * jump.spacing)
        depth = body.interface.surface.distances(jump.samples.points)
        sheet = outer.robin / (2.0 * fields[each.interface.outside].equation.diffusion * ripple)
        errors = np.exp(-ripple * depth) * np.hypot(0.5 * np.abs(jump.fluence), np.abs(jump.flux) * sheet)
        total = float(np.hypot(total, norm(jump.samples.areas, errors)))
    return ErrorEstimates(np.nan, total / norm(checked.areas, exitance))
