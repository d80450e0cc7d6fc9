"""How a picture draws lights: as arrows that end where they meet the body, and as points."""

import numpy as np

from tetlux.cases.picture.view import Ray
from tetlux.fem.lights import CollimatedBeam, Light, PencilBeam, PointSource
from tetlux.fem.lights.point import unit_vector
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.surface.surface import Surface

# Of an arrow, as a share of the body's diagonal.
LENGTH = 0.3
# Light on the whole body is drawn as so many arrows.
ARROWS = 3
# So far from the middle of what is lit they stand at most, as a share of its extent: not at its rim.
SPREAD = 0.6


def rays(light: Light, surface: Surface) -> tuple[Ray, ...]:
    """Arrows or points of a light; light from everywhere and light of the volume have none."""
    if isinstance(light, PencilBeam):
        end = light.entry(surface)
        start = end - LENGTH * surface.diagonal * unit_vector(light.direction, "direction")
        return (Ray(_vector(start), _vector(end)),)
    if isinstance(light, PointSource):
        return (Ray(light.position, light.position),)
    if isinstance(light, CollimatedBeam):
        along = unit_vector(light.direction, "direction")
        ends = _spread(light.entries(surface), along, ARROWS if light.spot is None else 1)
        return tuple(Ray(_vector(end - LENGTH * surface.diagonal * along), _vector(end)) for end in ends)
    return ()


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
