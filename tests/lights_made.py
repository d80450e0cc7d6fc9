"""Lights of every kind, and what they leave on a mesh, for several tests."""

import numpy as np

from tetlux.fem import (
    CollimatedBeam,
    Deposit,
    DiffuseLight,
    DiffusePatch,
    Disc,
    Emission,
    EnvironmentLight,
    Gaussian,
    Image,
    Light,
    PencilBeam,
    PointSource,
    Rectangle,
)
from tetlux.fem.body.body import Body
from tetlux.fem.lights.spots import Spot
from tetlux.fem.media.coefficients import AnyMedium, coefficients_on
from tetlux.meshing import TetMesh
from tetlux.meshing.arrays import Vector

PIXELS = np.random.default_rng(4).random((5, 7))


def spots_of_every_kind(center: Vector, up: Vector = (0.0, 1.0, 0.0), scale: float = 1.0) -> dict[str, Spot]:
    """Spots by name, about as wide as `scale`."""
    return {
        "disc": Disc(center, 0.7 * scale),
        "gaussian": Gaussian(center, 0.5 * scale),
        "rectangle": Rectangle(center, 1.1 * scale, 0.6 * scale, up=up),
        "image": Image(center, 1.4 * scale, PIXELS, up=up),
    }


def lights_of_every_kind(
    inside: Vector, direction: Vector, *, brightness: float = 1.0, scale: float = 1.0
) -> dict[str, Light]:
    """Lights by name; those with a direction shine on a place inside the body from 12 times `scale` before it.

    Lengths are proportional to `scale`, powers to `brightness`, irradiances to ``brightness/scale²``.
    """
    unit = np.array(direction) / np.linalg.norm(direction)
    x, y, z = (float(value) for value in np.array(inside) - 12.0 * scale * unit)
    # An axis that the beam is not along.
    u, v, w = (float(value) for value in np.eye(3)[np.argmin(np.abs(unit))])
    origin, across, irradiance = (x, y, z), (u, v, w), brightness / scale**2
    lights: dict[str, Light] = {
        "point": PointSource(inside, brightness),
        "pencil": PencilBeam(origin, direction, brightness),
        "line": PencilBeam(origin, direction, brightness, deposit="line"),
        "round pencil": PencilBeam(origin, direction, brightness, radius=0.4 * scale),
        "round line": PencilBeam(origin, direction, brightness, radius=0.4 * scale, deposit="line"),
        "whole": CollimatedBeam(direction, irradiance),
        "diffuse": DiffuseLight(irradiance),
        "patch": DiffusePatch(inside, 2.5 * scale, irradiance),
        "environment": EnvironmentLight(irradiance * PIXELS, up=direction, front=across),
        "glow": Emission(brightness / scale**3),
        "glow of a region": Emission(brightness / scale**3, region=0),
    }
    spots = spots_of_every_kind(origin, across, scale)
    return lights | {name: CollimatedBeam(direction, irradiance, spot) for name, spot in spots.items()}


def deposit_on_mesh(light: Light, mesh: TetMesh, medium: AnyMedium) -> Deposit:
    """What a light leaves in a body of one medium that is exactly the mesh."""
    deposit = light.deposit_in(Body(mesh.surface, (medium,)))
    return deposit.evaluate_on(mesh, mesh.surface, coefficients_on(mesh, {0: medium}))
