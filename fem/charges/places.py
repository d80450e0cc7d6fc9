"""Where charges go: above the surface, outside the body, closest together where light enters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tetlux.fem.charges.samples import LEAST_SEPARATION, Cells, Samples, Spacing, cells_of, spread, thin
from tetlux.meshing.arrays import BoolArray, FloatArray
from tetlux.meshing.surface.surface import Surface

# A charge is this many spacings above the surface, where the field is rough and where it is smooth; ...
HEIGHT_ROUGH, HEIGHT_SMOOTH = 2.0, 3.0
# ... or lower, if another part of the body is nearer to it than this share of its height: by this factor, so often; ...
CLEARANCE_SHARE, HEIGHT_REDUCTION, MOST_REDUCTIONS = 0.7, 0.8, 10
# ... and is left out if it would be lower than this many spacings, where equations are too far apart to see it.
LEAST_HEIGHT = 0.3
# Equations for each charge, by the ratio of their spacings.
EQUATION_REFINEMENT = 2.0
# Charges to each square of their spacing (measured: .89 to .95; those that are left out come off).
CHARGES_PER_SQUARE = 0.92
# Rows are weighted by this power of the distance from the light, so that what is far and faint counts too. By 300
# charges, error and its median below 1 % of the brightest, both in %, for 0 / .75 / 1.5: torus .011, .17 / .012, .25 /
# .017, .24; hare .25, 2.2 / .26, 2.5 / 2.3, 5.6; spot 1.1, 8.3 / 1.2, 4.6 / 8.3, 8.2; rocker-arm .32, 9.2 / .30, 5.4 /
# .85, 8.1.
DISTANCE_EXPONENT = 0.75
# Unit spacing at the foot of a source, by its depth; far away it is the distance from it.
DEPTH_FACTOR = 0.6


@dataclass(frozen=True, eq=False)
class Places:
    """Where charges are, and the points of the surface at which they are fitted and checked.

    Attributes
    ----------
    charges : (c, 3) ndarray
        Outside the body.
    feet : Samples
        The points of the surface that charges were put above; some of these charges were left out.
    fitted, checked : Samples
        No point is in both.
    weights : (f,) ndarray
        Of the equations at the points that are fitted.
    """

    charges: FloatArray
    feet: Samples
    fitted: Samples
    weights: FloatArray
    checked: Samples


def distance_from(surface: Surface, sources: FloatArray) -> Spacing:
    """The distance from the nearest source, with which the spacing grows.

    Over a flat surface it is ``sqrt(d² + (.6 z0)²)`` for a source z0 deep, d away from the point below which it lies.

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
    depths = np.linalg.norm(surface.project(sources)[0] - sources, axis=1)

    def distance(points: FloatArray) -> FloatArray:
        square = np.square(points[:, None] - sources).sum(axis=2) - (1.0 - DEPTH_FACTOR**2) * depths**2
        # No point of the surface is nearer than the depth, but points of large triangles may be.
        return np.asarray(np.sqrt(np.maximum(square, (DEPTH_FACTOR * depths) ** 2).min(axis=1)))

    return distance


def places_for(
    surface: Surface, spacing: Spacing, distance: Spacing, count: int, height: float = HEIGHT_ROUGH
) -> Places:
    """Places of about `count` charges.

    Parameters
    ----------
    surface : Surface
    spacing : callable
        Up to a factor, which follows from the count.
    distance : callable
        From the light, up to a factor.
    count : int
    height : float
        Of charges above the surface, spacings.
    """
    rng = np.random.default_rng(0)
    (cells,), scale = fitting_cells([surface], [spacing], count)
    return places_at(surface, cells, scaled(spacing, scale), distance, rng, height)


def places_at(
    surface: Surface,
    cells: Cells,
    spacing: Spacing,
    distance: Spacing,
    rng: np.random.Generator,
    height: float,
    far: float = DISTANCE_EXPONENT,
) -> Places:
    """Places of charges a spacing apart, from cells of that spacing."""
    fitted, others = spread(
        surface, cells.scaled(1.0 / EQUATION_REFINEMENT).cut(scaled(spacing, 1.0 / EQUATION_REFINEMENT)), rng
    )
    feet = fitted[thin(fitted, EQUATION_REFINEMENT * LEAST_SEPARATION * fitted.spacing)]
    charges, clear = place_above_surface(surface, feet, EQUATION_REFINEMENT * feet.spacing, height)
    return Places(charges[clear], feet, fitted, _weights(fitted, distance, far), _checked(others, fitted))


def fitting_cells(surfaces: Sequence[Surface], spacings: Sequence[Spacing], count: float) -> tuple[list[Cells], float]:
    """Cells of surfaces that together hold about `count` charges, and the factor of their spacings."""
    all_cells, scale = [cells_of(*each) for each in zip(surfaces, spacings, strict=True)], 1.0
    for _ in range(2):
        # Cells as fine as the points: their number says how many points there would be.
        change = float(np.sqrt(CHARGES_PER_SQUARE * sum(cells.sample_count for cells in all_cells) / count))
        scale *= change
        all_cells = [
            cells.scaled(change).cut(scaled(spacing, scale)) for cells, spacing in zip(all_cells, spacings, strict=True)
        ]
    return all_cells, scale


def scaled(spacing: Spacing, scale: float) -> Spacing:
    """A spacing, so many times as large."""
    return lambda points: scale * spacing(points)


def _checked(others: Samples, fitted: Samples) -> Samples:
    """At most twice as many points as are fitted, which stand for the whole surface."""
    some = others[np.arange(min(len(others), 2 * len(fitted)))]
    return replace(some, areas=some.areas * (fitted.areas.sum() / some.areas.sum()))


def place_above_surface(
    surface: Surface, feet: Samples, spacing: FloatArray, height: float
) -> tuple[FloatArray, BoolArray]:
    """Places above points of the surface (n, 3), and which of them are clear of the body (n,)."""
    heights = height * spacing
    # More of the body may lie across a gap; a ray from a curve that is sunk below its triangle leaves that first.
    gaps, met = surface.rays.first(feet.points, feet.normals)
    enters = (met >= 0) & (np.einsum("ij,ij->i", surface.normals[met], feet.normals) < 0.0)
    heights[enters] = np.minimum(heights[enters], gaps[enters] / (1.0 + CLEARANCE_SHARE))
    places, clear = np.empty((len(feet), 3)), np.zeros(len(feet), dtype=bool)
    some = np.arange(len(feet))
    for _ in range(MOST_REDUCTIONS):
        places[some] = feet.points[some] + heights[some, None] * feet.normals[some]
        nearest, normals = surface.project(places[some])
        way = places[some] - nearest
        outside = np.einsum("ij,ij->i", way, normals) > 0.0
        clear[some] = outside & (np.linalg.norm(way, axis=1) >= CLEARANCE_SHARE * heights[some])
        some = some[~clear[some]]
        heights[some] *= HEIGHT_REDUCTION
    return places, clear & (heights >= LEAST_HEIGHT * spacing)


def _weights(samples: Samples, distance: Spacing, far: float) -> FloatArray:
    """Weights (n,) of equations at samples: the root of area, times a power of the distance from the light."""
    away = distance(samples.points)
    return np.asarray(np.sqrt(samples.areas) * (away / away.max()) ** far)
