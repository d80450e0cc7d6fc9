"""Positions of charges: above the surface, outside the body, closest together where light enters."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.charges.samples import LEAST_SEPARATION, Samples, Spacing, cells_of, scaled, spread, thin
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.surface.surface import Surface

# Height of charges above the surface, in spacings, where the field is rough. Error in % by 300 charges for 1.5 / 2 /
# 2.5: hare's ear .49 / .93 / .93, its side .21 / .28 / .29, spot 1.1 / 1.3 / 1.5.
HEIGHT_ROUGH = 1.5
# Height of charges above the surface, in spacings, where the field is smooth.
HEIGHT_SMOOTH = 3.0
# A charge is lowered if another part of the body is nearer to it than this share of its height.
CLEARANCE_SHARE = 0.7
# Factor by which the height of such a charge is reduced each time.
HEIGHT_REDUCTION = 0.8
# Most reductions of the height of a charge.
MOST_REDUCTIONS = 10
# A charge lower than this, in spacings, is left out: equations are too far apart to resolve its field.
LEAST_HEIGHT = 0.3
# Spacing of charges over the spacing of equations.
EQUATION_REFINEMENT = 2.0
# Charges in each square of their spacing (measured: .89 to .95, less those that are left out).
CHARGES_PER_SQUARE = 0.92
# Charges are placed anew, so often, while they are more than this multiple of their number: where the spacing varies
# within the cells by which they are counted. A rod of radius 10 and length 200 had 4,600 charges in place of 100.
MOST_PLACEMENTS, MOST_EXCESS = 3, 1.5
# Longest side of the cells by which charges are counted, in spacings.
COUNTING_CELL = 2.5
# Equations are weighted by this power of the distance from the light, so that faint light far away counts too. By 300
# charges, relative L2 error, and median relative error where the exitance is below 1 % of its maximum, both in %, for 0
# / .75 / 1.5: torus .011, .17 / .012, .25 / .017, .24; hare .25, 2.2 / .26, 2.5 / 2.3, 5.6; spot 1.1, 8.3 / 1.2, 4.6 /
# 8.3, 8.2; rocker-arm .32, 9.2 / .30, 5.4 / .85, 8.1.
DISTANCE_EXPONENT = 0.75
# The spacing at the surface point nearest to a source, over the depth of the source; far away the spacing is the
# distance from the source, both up to one factor.
DEPTH_FACTOR = 0.6

# Where light fades within less than its distance from the source, charges are this many of the lengths 1/k apart, up to
# one factor.
SPACING_OF_FADING = 3.0
# Light that has faded by more than this factor does not weigh more.
MOST_FADING = 1e6

# The weight of equations at points (n, 3) of the surface, up to a factor, (n,).
Weight = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class ChargePlacement:
    """Positions of charges, and the points of the surface at which they are fitted and checked.

    Attributes
    ----------
    charges : (c, 3) ndarray
        Outside the body.
    feet : Samples
        The points of the surface above which charges were placed; some of these charges were left out.
    fitted, checked : Samples
        Disjoint sets of points of the surface.
    weights : (f,) ndarray
        Of the equations at the points that are fitted.
    """

    charges: FloatArray
    feet: Samples
    fitted: Samples
    weights: FloatArray
    checked: Samples


def distance_from(surface: Surface, sources: FloatArray) -> Spacing:
    """The distance from the nearest source, to which the spacing of the first fit is proportional.

    On a flat surface it is ``sqrt(d² + (DEPTH_FACTOR z0)²)`` at a distance d from the point nearest to a source of
    depth z0.

    Parameters
    ----------
    surface : Surface
    sources : (s, 3) ndarray

    Returns
    -------
    callable
        1 everywhere if there is no source.
    """
    if len(sources) == 0:
        return lambda points: np.ones(len(points))
    depths = surface.distances(sources)

    def distance(points: FloatArray) -> FloatArray:
        square = np.square(points[:, None] - sources).sum(axis=2) - (1.0 - DEPTH_FACTOR**2) * depths**2
        # Points of large triangles may be nearer to a source than its depth below the smooth surface.
        return np.asarray(np.sqrt(np.maximum(square, (DEPTH_FACTOR * depths) ** 2).min(axis=1)))

    return distance


def weight_by_distance(distance: Spacing, exponent: float = DISTANCE_EXPONENT) -> Weight:
    """Weights of equations that grow with the distance from the light, so that faint light far away counts too."""
    return lambda points: distance(points) ** exponent


def spacing_by_fading(distance: Spacing, fading: float) -> Spacing:
    """Spacing of charges, up to a factor, that follows faint light too, which fades at that rate, 1/unit."""

    def spacing(points: FloatArray) -> FloatArray:
        away = distance(points)
        return np.asarray(away / (1.0 + fading * away / SPACING_OF_FADING))

    return spacing


def weight_by_fading(distance: Spacing, fading: float) -> Weight:
    """Weights of equations that grow as light fades with the distance d, as ``e^{k d}``."""

    def weight(points: FloatArray) -> FloatArray:
        exponents = fading * distance(points)
        return np.asarray(np.exp(np.minimum(exponents - exponents.min(), np.log(MOST_FADING))))

    return weight


def place_charges(
    surface: Surface, spacing: Spacing, weight: Weight, count: int, height: float = HEIGHT_ROUGH
) -> ChargePlacement:
    """Positions of about `count` charges.

    Parameters
    ----------
    surface : Surface
    spacing : callable
        Of charges, up to a factor, which follows from the count.
    weight : callable
        Of equations, up to a factor.
    count : int
    height : float
        Of charges above the surface, in spacings.
    """
    scale = spacing_scale([surface], [spacing], count)
    for _ in range(MOST_PLACEMENTS):
        placement = place_charges_at(surface, scaled(spacing, scale), weight, np.random.default_rng(0), height)
        excess = len(placement.feet) / count
        if excess <= MOST_EXCESS:
            break
        scale *= np.sqrt(excess)
    return placement


def place_charges_at(
    surface: Surface, spacing: Spacing, weight: Weight, rng: np.random.Generator, height: float
) -> ChargePlacement:
    """Positions of charges a spacing apart."""
    fitted, others = spread(cells_of(surface, scaled(spacing, 1.0 / EQUATION_REFINEMENT)), rng)
    feet = fitted[thin(fitted, EQUATION_REFINEMENT * LEAST_SEPARATION * fitted.spacing)]
    charges, clear = place_above_surface(surface, feet, EQUATION_REFINEMENT * feet.spacing, height)
    return ChargePlacement(charges[clear], feet, fitted, _weights(fitted, weight), _checked(others, fitted))


def spacing_scale(surfaces: Sequence[Surface], spacings: Sequence[Spacing], count: float) -> float:
    """The factor of the spacings for which surfaces together hold about `count` charges."""
    scale = 1.0
    for _ in range(3):
        # The spacing is better known by cells of about its own size.
        cells = [
            cells_of(surface, scaled(spacing, scale), COUNTING_CELL)
            for surface, spacing in zip(surfaces, spacings, strict=True)
        ]
        scale *= float(np.sqrt(CHARGES_PER_SQUARE * sum(each.sample_count for each in cells) / count))
    return scale


def _checked(others: Samples, fitted: Samples) -> Samples:
    """At most twice as many points as are fitted, with areas that sum to that of the surface."""
    some = others[np.arange(min(len(others), 2 * len(fitted)))]
    return replace(some, areas=some.areas * (fitted.areas.sum() / some.areas.sum()))


def place_above_surface(
    surface: Surface, feet: Samples, spacing: FloatArray, height: float
) -> tuple[FloatArray, BoolArray]:
    """Positions above points of the surface (n, 3), and whether each is clear of the body (n,)."""
    heights = height * spacing
    # Limits the height to the width of a gap between parts of the body. A ray from a point of the smooth surface below
    # its triangle leaves the body first, which does not count.
    gaps, met = surface.rays.first(feet.points, feet.normals)
    enters = (met >= 0) & (np.einsum("ij,ij->i", surface.normals[met], feet.normals) < 0.0)
    heights[enters] = np.minimum(heights[enters], gaps[enters] / (1.0 + CLEARANCE_SHARE))
    positions, clear = np.empty((len(feet), 3)), np.zeros(len(feet), dtype=bool)
    some = np.arange(len(feet))
    for _ in range(MOST_REDUCTIONS):
        positions[some] = feet.points[some] + heights[some, None] * feet.normals[some]
        nearest, normals = surface.project(positions[some])
        offset = positions[some] - nearest
        outside = np.einsum("ij,ij->i", offset, normals) > 0.0
        clear[some] = outside & (np.linalg.norm(offset, axis=1) >= CLEARANCE_SHARE * heights[some])
        some = some[~clear[some]]
        heights[some] *= HEIGHT_REDUCTION
    return positions, clear & (heights >= LEAST_HEIGHT * spacing)


def _weights(samples: Samples, weight: Weight) -> FloatArray:
    """Weights (n,) of equations at samples: the root of the area times the weight there, at most 1."""
    weights = weight(samples.points)
    return np.asarray(np.sqrt(samples.areas) * (weights / weights.max()))
