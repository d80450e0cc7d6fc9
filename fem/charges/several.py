"""Charges in a body of several even regions: each region has its own, outside it.

Charges of a region lie beyond its outer surface and within its inner ones, so that they obey its equation inside it.
On the body's surface they are fitted to ``D dphi/dn + phi/(2A) = 0``, on the surface of an inner region to phi and
``D dphi/dn`` being the same on both sides. Rows of phi are divided by 2A, so that all are W/unit².
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.charges.adapt import FIRST, GROWTH, MOST, SMOOTH
from tetlux.fem.charges.check import Quality, damped, norm, ripple_of
from tetlux.fem.charges.field import ChargeField
from tetlux.fem.charges.fit import factorise
from tetlux.fem.charges.kernel import Equation, NumberArray
from tetlux.fem.charges.places import FINER, HIGH, LOW, Places, above, distance_from, fitting_cells, places_at, scaled
from tetlux.fem.charges.samples import Samples
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.surface import Surface

# Light that went deep is faint: rows far from the source weigh more than in one medium. Reading at 30° of a four-layer
# head by 1,050 charges, error in % and that of the whole for powers of .75 / 1.25 / 1.5: -.99, .0045 / -.75, .0047 /
# -.66, .0049; at 45° 1.0 / .03 / -.19.
FAR = 1.25
# What reaches the surface from an inner wall is the longer part of its ripples: so many times as long as at the body's.
# The estimate over the error on 24 random balls of two or three layers: .26 to 1.9 with 1, .89 to 3.8 with 3.
DEEPER = 3.0
# A last step to the most charges is taken if that is so many times more.
WORTHWHILE = 1.2


@dataclass(frozen=True, eq=False)
class Wall:
    """The outer surface of a region.

    Attributes
    ----------
    surface : Surface
    inside : int
        The region.
    outside : int or None
        The region round it; none of the body itself.
    """

    surface: Surface
    inside: int
    outside: int | None


@dataclass(frozen=True, eq=False)
class WallPlaces:
    """Places at a wall.

    Attributes
    ----------
    wall : Wall
    places : Places
        Of charges of the region inside, which lie beyond the wall.
    within : (c, 3) ndarray
        Charges of the region outside, which lie within it.
    """

    wall: Wall
    places: Places
    within: FloatArray


@dataclass(frozen=True, eq=False)
class RegionLight:
    """Point sources: places (p, 3), the region of each (p,), and their powers (p, s) by s lights, W."""

    points: FloatArray
    regions: IntArray
    powers: NumberArray


@dataclass(frozen=True, eq=False)
class RegionFit:
    """Charges of each region, fitted.

    Attributes
    ----------
    fields : tuple of ChargeField
        Of each region, the body's own first: its sources, then its charges.
    places : tuple of WallPlaces
    quality : Quality
    """

    fields: tuple[ChargeField, ...]
    places: tuple[WallPlaces, ...]
    quality: Quality


def wall_places(
    walls: Sequence[Wall], light: RegionLight, count: int, height: float = LOW, seed: int = 0
) -> list[WallPlaces]:
    """Places of about `count` charges of all regions together."""
    rng = np.random.default_rng(seed)
    spacings = [distance_from(wall.surface, light.points) for wall in walls]
    inner = sum(wall.outside is not None for wall in walls)
    # An inner wall has charges on both sides.
    share = len(walls) / (len(walls) + inner)
    surfaces = [wall.surface for wall in walls]
    all_cells, scale = fitting_cells(surfaces, spacings, share * count)
    found = []
    for wall, cells, spacing in zip(walls, all_cells, spacings, strict=True):
        places = places_at(wall.surface, cells, scaled(spacing, scale), spacing, rng, height, FAR)
        within = np.zeros((0, 3))
        if wall.outside is not None:
            turned = replace(wall.surface, faces=wall.surface.faces[:, ::-1])
            feet = replace(places.feet, normals=-places.feet.normals)
            inward, clear = above(turned, feet, FINER * feet.spacing, height)
            within = inward[clear]
        found.append(WallPlaces(wall, places, within))
    return found


def rows_at(
    wall: Wall, samples: Samples, equations: Sequence[Equation], charges: Sequence[FloatArray]
) -> list[NumberArray]:
    """What unit charges of each region, (c, 3) each, violate at samples (m,) of a wall, W/unit².

    Returns
    -------
    list of (m, c) or (2 m, c) ndarray
        On the body's surface what does not flow out, and on an inner one the steps of ``phi/(2A)`` and ``D dphi/dn``.
    """
    rows = 1 if wall.outside is None else 2
    found: list[NumberArray] = []
    for region, (equation, positions) in enumerate(zip(equations, charges, strict=True)):
        if region not in (wall.inside, wall.outside):
            found.append(np.zeros((rows * len(samples), len(positions))))
            continue
        fluence, flux = equation.traces_of_each(samples.points, samples.normals, positions)
        fluence *= equation.robin
        if wall.outside is None:
            found.append(fluence + flux)
        else:
            found.append((1.0 if region == wall.inside else -1.0) * np.vstack([fluence, flux]))
    return found


def fit_regions(
    walls: Sequence[Wall], equations: Sequence[Equation], light: RegionLight, *, tolerance: float, most: int = MOST
) -> RegionFit:
    """Fit charges until the estimated error of the exitance is within the tolerance, or there are enough.

    Parameters
    ----------
    walls : sequence of Wall
        The body's surface first, then those of regions 1, 2, ...
    equations : sequence of Equation
        Of the body's own region, 0, and of the others.
    light : RegionLight
    tolerance : float
        Relative L2 error of the exitance.
    most : int
        Charges at which it ends in any case, about.
    """
    count = min(FIRST * (2 * len(walls) - 1), most)
    best = fit_regions_at(wall_places(walls, light, count), equations, light)
    while best.quality.estimate > tolerance and WORTHWHILE * count <= most:
        count = min(round(GROWTH * count), most)
        height = HIGH if best.quality.estimate <= SMOOTH else LOW
        fitted = fit_regions_at(wall_places(walls, light, count, height), equations, light)
        if fitted.quality.estimate < best.quality.estimate:
            best = fitted
    return best


def fit_regions_at(places: Sequence[WallPlaces], equations: Sequence[Equation], light: RegionLight) -> RegionFit:
    """Fit charges of all regions at given places."""
    regions = range(len(equations))
    charges = [np.vstack([np.zeros((0, 3)), *(_charges_at(each, region) for each in places)]) for region in regions]
    mine = [light.regions == region for region in regions]
    sources, powers = [light.points[own] for own in mine], [light.powers[own] for own in mine]
    table, right = [], []
    for each in places:
        samples = each.places.fitted
        scale = np.tile(each.places.weights, 1 if each.wall.outside is None else 2)[:, None]
        table.append(scale * np.hstack(rows_at(each.wall, samples, equations, charges)))
        given = rows_at(each.wall, samples, equations, sources)
        right.append(-scale * sum(some @ power for some, power in zip(given, powers, strict=True)))
    strengths = factorise(np.vstack(table)).solve(np.vstack(right))
    parts = np.split(strengths, np.cumsum([len(some) for some in charges])[:-1])
    fields = tuple(
        ChargeField(equation, np.vstack([points, some]), np.vstack([power, part]))
        for equation, points, some, power, part in zip(equations, sources, charges, powers, parts, strict=True)
    )
    return RegionFit(fields, tuple(places), _quality(fields, places))


def _charges_at(each: WallPlaces, region: int) -> FloatArray:
    """Charges of a region at a wall, (c, 3)."""
    if region == each.wall.inside:
        return each.places.charges
    return each.within if region == each.wall.outside else np.zeros((0, 3))


def _quality(fields: Sequence[ChargeField], places: Sequence[WallPlaces]) -> Quality:
    """No bound, and an estimate from what is violated at points that were not fitted.

    At an inner wall a step of phi makes half of it on either side, and one of the flux as much as a sheet of charges
    does, ``1/(2 D q)`` for a ripple of wave number q; on the way to the body's surface it fades as ``exp(-q l)``.
    """
    body = places[0]
    outer = fields[0].equation
    total, size = 0.0, 0.0
    for each in places:
        samples, wall = each.places.checked, each.wall
        spacing = FINER * samples.spacing
        if wall.outside is None:
            exitance, residual = fields[0].exitance_and_residual(samples.points, samples.normals)
            size = norm(samples.areas, exitance.sum(axis=1))
            errors = damped(outer, residual.sum(axis=1), spacing)
        else:
            inside, outside = (
                fields[region].exitance_and_residual(samples.points, samples.normals)
                for region in (wall.inside, wall.outside)
            )
            step = (inside[0] - outside[0]).sum(axis=1)
            flux = (inside[1] - outside[1]).sum(axis=1) - step
            ripple = ripple_of(outer, DEEPER * spacing)
            depth = np.linalg.norm(body.wall.surface.project(samples.points)[0] - samples.points, axis=1)
            sheet = outer.robin / (2.0 * fields[wall.outside].equation.diffusion * ripple)
            errors = np.exp(-ripple * depth) * np.hypot(0.5 * np.abs(step), np.abs(flux) * sheet)
        total = float(np.hypot(total, norm(samples.areas, errors)))
    return Quality(np.nan, total / size)
