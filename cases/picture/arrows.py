"""How a picture draws lights: as arrows that end where they meet the body, and as points."""

import numpy as np

from tetlux.cases.picture.view import Ray
from tetlux.fem.lights import Light
from tetlux.fem.lights.arrows import HasArrows
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.surface.surface import Surface

# Of an arrow, as a share of the body's diagonal.
LENGTH = 0.3
# So far from the middle of what is lit they stand at most, as a share of its extent: not at its rim.
SPREAD = 0.6


def rays(light: Light, surface: Surface) -> tuple[Ray, ...]:
    """Arrows or points of a light; light from everywhere and light of the volume have none."""
    if not isinstance(light, HasArrows):
        return ()
    arrows = light.arrows(surface)
    if arrows.direction is None:
        return tuple(Ray(_vector(place), _vector(place)) for place in arrows.places[: arrows.count])
    back = LENGTH * surface.diagonal * arrows.direction
    ends = _spread(arrows.places, arrows.direction, arrows.count)
    return tuple(Ray(_vector(end - back), _vector(end)) for end in ends)


def _spread(places: FloatArray, along: FloatArray, count: int) -> FloatArray:
    """The place nearest to the middle of all, and others far from it and from each other, seen along the light."""
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
