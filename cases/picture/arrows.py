"""Rays by which a picture shows lights: arrows that end where they meet the body, and points."""

import numpy as np

from tetlux.cases.picture.view import Ray
from tetlux.fem.lights import Light
from tetlux.fem.lights.arrows import HasArrows
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.surface.surface import Surface

# Length of an arrow, as a share of the body's diagonal.
LENGTH = 0.3
# Arrows keep off the rim of the lit places: largest distance from their middle, as a share of their extent.
SPREAD = 0.6


def light_rays(light: Light, surface: Surface) -> tuple[Ray, ...]:
    """The rays that show a light; diffuse, environment and volume light have none."""
    if not isinstance(light, HasArrows):
        return ()
    arrows = light.arrows(surface)
    if arrows.direction is None:
        return tuple(Ray(_vector(place), _vector(place)) for place in arrows.places[: arrows.count])
    back = LENGTH * surface.diagonal * arrows.direction
    ends = _choose_spread(arrows.places, arrows.direction, arrows.count)
    return tuple(Ray(_vector(end - back), _vector(end)) for end in ends)


def _choose_spread(places: FloatArray, along: FloatArray, count: int) -> FloatArray:
    """Choose the place nearest to the middle, then others by farthest-point sampling, as seen along the light."""
    flat = places - np.outer(places @ along, along)
    away = np.linalg.norm(flat - flat.mean(axis=0), axis=1)
    near = away <= SPREAD * away.max()
    places, flat = places[near], flat[near]
    chosen = [int(np.argmin(away[near]))]
    while len(chosen) < min(count, len(places)):
        apart = np.linalg.norm(flat[:, None] - flat[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(apart)))
    return places[chosen]


def _vector(point: FloatArray) -> Vector:
    x, y, z = point.tolist()
    return x, y, z
