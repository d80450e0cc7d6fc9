"""Bodies with a point source whose exitance is known in closed form: for the panels of charges and of readings.

Lengths are in mean free paths of the outermost medium.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tetlux.cases.stress.scenes.scenarios import INDEX
from tetlux.fem.exact import box, cylinder, layered_ball, slab, sphere
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region
from tetlux.meshing import shapes
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.surface.surface import Surface

# Length of a rod over its radius, so that its ends do not matter.
ROD_LENGTH = 14.0
# Radii of a ball of four layers over the outermost, with absorption and scattering over those of the outermost: skull,
# a clear layer and brain within the scalp (Okada & Delpy 2003).
LAYERS = ((0.95, 0.9, 0.85), (0.87, 0.22, 0.16), (0.848, 2.0, 1.16))


@dataclass(frozen=True, eq=False)
class PointBody:
    """A body, a point source in it, and its exitance.

    Attributes
    ----------
    surface : Surface
    medium : Medium
        Of the body.
    regions : tuple of Region
    source : (3,) floats
        Position of the source of 1 W.
    exitance : callable
        Exitance (n,) at points (n, 3) of the true surface, W/unit².
    """

    surface: Surface
    medium: Medium
    regions: tuple[Region, ...]
    source: Vector
    exitance: Callable[[FloatArray], FloatArray]


def ball(medium: Medium, radius: float, depth: float) -> PointBody:
    """A ball, the source below its pole."""
    r0 = radius - depth

    def exitance(points: FloatArray) -> FloatArray:
        return sphere.point_exitance(medium, radius=radius, source_radius=r0, gamma=_polar(points))

    return PointBody(shapes.sphere(radius), medium, (), (0.0, 0.0, r0), exitance)


def layers(medium: Medium, radius: float, depth: float, inner: tuple[tuple[float, float, float], ...]) -> PointBody:
    """A ball of layers: radius, absorption and scattering of each, outside inward, as shares of the outermost one's."""
    assert medium.sigma_s_prime is not None
    media = [
        Medium(sigma_a=absorption * medium.sigma_a, sigma_s_prime=scattering * medium.sigma_s_prime, eta=INDEX)
        for _, absorption, scattering in inner
    ]
    radii = [share * radius for share, _, _ in inner]
    r0 = radius - depth

    def exitance(points: FloatArray) -> FloatArray:
        return layered_ball.point_exitance(
            [*media[::-1], medium], [*radii[::-1], radius], source_radius=r0, gamma=_polar(points)
        )

    regions = tuple(Region(shapes.sphere(r), each) for r, each in zip(radii, media, strict=True))
    return PointBody(shapes.sphere(radius), medium, regions, (0.0, 0.0, r0), exitance)


def plate(medium: Medium, thickness: float, depth: float, width: float) -> PointBody:
    """A plate, the source below the middle of its upper face."""

    def exitance(points: FloatArray) -> FloatArray:
        rho, back = np.hypot(points[:, 0], points[:, 1]), points[:, 2] < -0.5 * thickness
        front, rear = (
            slab.point_exitance(medium, thickness=thickness, depth=depth, rho=rho, face=face)
            for face in ("front", "back")
        )
        return np.where(back, rear, front)

    return PointBody(shapes.slab(width, thickness), medium, (), (0.0, 0.0, -depth), exitance)


def block(medium: Medium, edge: float, source: Vector) -> PointBody:
    """A cube around the origin."""
    size = (edge, edge, edge)
    return PointBody(
        shapes.box(size),
        medium,
        (),
        source,
        lambda points: box.point_exitance(medium, size=size, source=source, points=points),
    )


def rod(medium: Medium, radius: float, depth: float) -> PointBody:
    """A long cylinder, the source below the middle of its side."""
    r0 = radius - depth

    def exitance(points: FloatArray) -> FloatArray:
        theta = np.arctan2(points[:, 1], points[:, 0])
        return cylinder.point_exitance(medium, radius=radius, source_radius=r0, theta=theta, z=points[:, 2])

    return PointBody(shapes.cylinder(radius, ROD_LENGTH * radius), medium, (), (r0, 0.0, 0.0), exitance)


def _polar(points: FloatArray) -> FloatArray:
    return np.arctan2(np.hypot(points[:, 0], points[:, 1]), points[:, 2])


def round_places(radius: float, angles: FloatArray) -> FloatArray:
    """Places (n, 3) on a ball at angles (n,) from its pole, at various longitudes."""
    longitude = math.radians(137.5) * np.arange(len(angles))
    flat = np.sin(angles)
    return radius * np.column_stack([flat * np.cos(longitude), flat * np.sin(longitude), np.cos(angles)])
