"""Scenarios of the panels of charges and of readings."""

import numpy as np

from tetlux.cases.chart.samples import project_to_sphere, surface_samples
from tetlux.cases.stress.scenes.point_bodies import LAYERS, PointBody, ball, block, layers, plate, rod, round_places
from tetlux.cases.stress.scenes.scenarios import Scenario, medium_of_albedo
from tetlux.fem import PointSource
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.solids import Slab, Sphere

# The most samples of a box; the rest is left out evenly.
MOST_SAMPLES = 200

CHARGE_BODIES = (
    *("ball of 3", "ball of 30", "thin plate of 1", "plate of 6", "box of 10", "box, by an edge", "box, by a corner"),
    *("core of 30 σ_a", "core of .1 σ_s'", "four layers"),
)
FEW_CHARGE_BODIES = ("ball of 30", "thin plate of 1", "box, by an edge", "core of .1 σ_s'")
# Depth and albedo.
CHARGE_LIGHTS = {
    "1 deep": (1.0, 0.99),
    "shallow, 0.2": (0.2, 0.99),
    "deep, 5": (5.0, 0.99),
    "albedo 0.5": (1.0, 0.5),
    "albedo 0.9999": (1.0, 0.9999),
}
FEW_CHARGE_LIGHTS = ("shallow, 0.2", "albedo 0.5")
READING_BODIES = ("ball", "plate", "rod", "box, by an edge", "core of 30 σ_a", "core of .1 σ_s'", "four layers")
FEW_READING_BODIES = ("ball", "box, by an edge", "core of .1 σ_s'")
PLACES = ("near", "far", "behind")
FEW_PLACES = ("near", "far")
# Detectors: distances from the entry along the surface, and angles from the point behind the body.
NEAR, FAR, BEHIND = np.array([0.3, 1.0, 2.0, 3.0]), np.array([9.0, 14.0, 19.0, 25.0]), np.array([0.0, 0.3, 0.6, 1.0])


def charges_by_body_and_light(body: str, light: str) -> Scenario:
    """A point source in a body; lengths in mean free paths."""
    depth, albedo = CHARGE_LIGHTS[light]
    made = _charge_body(body, albedo, depth)
    surface = made.surface
    samples = surface_samples(surface, np.array([made.source]), np.array([depth]))
    if isinstance(surface.shape, Sphere):
        samples = project_to_sphere(samples, surface.shape)
    elif isinstance(surface.shape, Slab):
        # Away from the rim, which the closed form does not have.
        samples = samples.where(np.hypot(*samples.points[:, :2].T) < 0.2 * surface.shape.width)
    else:
        # The sum over modes takes long.
        step = max(1, len(samples.points) // MOST_SAMPLES)
        samples = samples.where(np.arange(len(samples.points)) % step == 0)
    truth = samples, made.exitance(samples.points)
    return Scenario(surface, made.medium, PointSource(made.source), made.regions, truth=truth)


def _charge_body(body: str, albedo: float, depth: float) -> PointBody:
    medium = medium_of_albedo(albedo)
    if body.startswith("box"):
        off = 5.0 - min(depth, 4.0)
        return block(medium, 10.0, (off if "by" in body else 0.0, off if "corner" in body else 0.3, off))
    if "plate" in body:
        thickness = float(body.split("of ")[1])
        return plate(medium, thickness, min(depth, 0.5 * thickness), 20.0 + 6.0 * thickness)
    if body.startswith("ball"):
        radius = float(body.split("of ")[1])
        return ball(medium, radius, min(depth, 0.9 * radius))
    return _layered(body, albedo, 15.0, depth)


def _layered(body: str, albedo: float, radius: float, depth: float) -> PointBody:
    """A ball with a core, or of four layers; a core begins well below the source."""
    medium = medium_of_albedo(albedo)
    if body == "four layers":
        return layers(medium, 4.0 * radius, min(depth, 2.0), LAYERS)
    core = {"core of 30 σ_a": (30.0, 1.0), "core of .1 σ_s'": (1.0, 0.1)}[body]
    return layers(medium, radius, depth, ((0.6, *core),))


def readings_by_body_and_place(body: str, place: str) -> Scenario:
    """A point source 1 mean free path deep, and four detectors."""
    made, places = _reading_body(body, place)
    source = PointSource(made.source)
    return Scenario(made.surface, made.medium, source, made.regions, readings=(places, made.exitance(places)))


def _reading_body(body: str, place: str) -> tuple[PointBody, FloatArray]:
    medium = medium_of_albedo(0.99)
    if body == "plate":
        rho = {"near": NEAR, "far": FAR, "behind": 8.0 * BEHIND}[place]
        flat = round_places(1.0, np.full(len(rho), 0.5 * np.pi))[:, :2] * rho[:, None]
        return plate(medium, 6.0, 1.0, 100.0), np.column_stack([flat, np.full(len(rho), -6.0 * (place == "behind"))])
    if body == "rod":
        z = {"near": NEAR, "far": FAR, "behind": 8.0 * BEHIND}[place]
        theta = {"near": np.zeros(4), "far": np.array([0.0, 1.0, 2.0, 3.0]), "behind": np.full(4, np.pi)}[place]
        return rod(medium, 6.0, 1.0), np.column_stack([6.0 * np.cos(theta), 6.0 * np.sin(theta), z])
    if body.startswith("box"):
        return block(medium, 12.0, (5.0, 0.5, 5.0)), _box_places(place)
    made = ball(medium, 15.0, 1.0) if body == "ball" else _layered(body, 0.99, 15.0, 1.0)
    assert isinstance(made.surface.shape, Sphere)
    radius = made.surface.shape.radius
    angles = {"near": NEAR / radius, "far": FAR / radius, "behind": np.pi - BEHIND}[place]
    return made, round_places(radius, angles)


def _box_places(place: str) -> FloatArray:
    """Near: at the edge by the source, on both faces; far: along other edges; behind: on the faces opposite."""
    found = {
        "near": [(6.0, 0.5, 5.9), (5.9, 1.5, 6.0), (6.0, 2.5, 5.0), (4.0, 0.0, 6.0)],
        "far": [(-5.9, 0.0, 6.0), (6.0, 5.9, -5.0), (-4.0, 6.0, 5.9), (5.9, -6.0, -3.0)],
        "behind": [(-6.0, 0.5, 0.0), (0.0, 0.0, -6.0), (-6.0, 3.0, -5.9), (-5.9, -5.9, -6.0)],
    }
    return np.array(found[place])
