"""Scenes with a closed form for the exitance, and how far a solution is from it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tetlux.fem import CollimatedBeam, DiffuseLight, Light, Medium, PointSource, Solution
from tetlux.fem.body.body import Body
from tetlux.fem.exact import cylinder as exact_cylinder
from tetlux.fem.exact import slab as exact_slab
from tetlux.fem.exact import sphere as exact_sphere
from tetlux.fem.exact import sphere_light as exact_sphere_light
from tetlux.meshing import Surface, cylinder, slab, sphere
from tetlux.meshing.arrays import FloatArray

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
SAMPLES = 6000
# The golden angle: no two samples on one ray from the entry.
TURN = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True, eq=False)
class Scene:
    """A body, a medium and a light, with the exitance known at sample points of the true surface.

    Attributes
    ----------
    name : str
    surface : Surface
    medium : Medium
    light : Light
    points : (s, 3) ndarray
    weights : (s,) ndarray
        Areas that the points stand for.
    truth : (s,) ndarray
        The closed form there.
    """

    name: str
    surface: Surface
    medium: Medium
    light: Light
    points: FloatArray
    weights: FloatArray
    truth: FloatArray

    def error(self, solution: Solution) -> float:
        """Relative L2 error of a solution's exitance over the surface."""
        gap = solution.exitance_at(self.points) - self.truth
        return float(np.sqrt(self.weights @ gap**2 / (self.weights @ self.truth**2)))


def ball(name: str, *, radius: float = 10.0, depth: float = 1.0 / 1.01, medium: Medium = TISSUE) -> Scene:
    """A point source below the pole of a sphere of 5,120 triangles."""
    share = (np.arange(SAMPLES) + 0.5) / SAMPLES
    # Most samples near the pole, where the light is.
    gamma = np.pi * share**3
    weights = np.sin(gamma) * 3.0 * share**2
    around = TURN * np.arange(SAMPLES)
    out = np.column_stack([np.sin(gamma) * np.cos(around), np.sin(gamma) * np.sin(around), np.cos(gamma)])
    truth = exact_sphere.point_exitance(medium, radius=radius, source_radius=radius - depth, gamma=gamma)
    light = PointSource((0.0, 0.0, radius - depth))
    return Scene(name, sphere(radius), medium, light, radius * out, weights, truth)


def plate(name: str, *, thickness: float, depth: float = 1.0) -> Scene:
    """A point source below the upper face of a slab, of which that face is compared."""
    share = (np.arange(SAMPLES) + 0.5) / SAMPLES
    rho = 20.0 * share**2
    around = TURN * np.arange(SAMPLES)
    points = np.column_stack([rho * np.cos(around), rho * np.sin(around), np.zeros(SAMPLES)])
    truth = exact_slab.point_exitance(TISSUE, thickness=thickness, depth=depth, rho=rho)
    light = PointSource((0.0, 0.0, -depth))
    return Scene(name, slab(60.0, thickness), TISSUE, light, points, rho * share, truth)


def rod(name: str, *, radius: float = 5.0) -> Scene:
    """A point source below the wall of a cylinder, so long that its ends do not matter."""
    share = (np.arange(SAMPLES) + 0.5) / SAMPLES
    # Side by side in z and around: a two-dimensional set of low discrepancy, drawn towards the source.
    other = np.modf(np.arange(SAMPLES) * 0.6180339887498949)[0] * 2.0 - 1.0
    theta, z = np.pi * (2.0 * share - 1.0) ** 3, 15.0 * other**3
    weights = (2.0 * share - 1.0) ** 2 * other**2
    points = np.column_stack([radius * np.cos(theta), radius * np.sin(theta), z])
    truth = exact_cylinder.point_exitance(TISSUE, radius=radius, source_radius=radius - 1.0, theta=theta, z=z)
    light = PointSource((radius - 1.0, 0.0, 0.0))
    body = cylinder(radius, 60.0, segments=96)
    return Scene(name, body, TISSUE, light, points, weights, truth)


def furnace(name: str, medium: Medium) -> Scene:
    """Diffuse light on a sphere: the exitance is the same everywhere."""
    scene = ball(name, depth=1.0, medium=medium)
    light = DiffuseLight(irradiance=1.0)
    deposit = light.deposit_in(Body(scene.surface, (medium,)))
    k, zb, a = medium.sigma_tr, medium.extrapolation_length, 10.0
    # phi + zb phi' = 4 E_t/(1 - 2 C1) at r = a for phi = c sinh(k r)/r; what flows in, -D phi', does not come out.
    growth = k / np.tanh(k * a) - 1.0 / a
    passed = deposit.terms.transmitted_irradiance
    inside = 4.0 * medium.eta**2 / (1.0 + zb * growth)
    truth = np.full(SAMPLES, passed - medium.diffusion * growth * inside)
    return Scene(name, scene.surface, medium, light, scene.points, scene.weights, truth)


def lit_ball(name: str, medium: Medium, *, radius: float) -> Scene:
    """Parallel light on a sphere; indices match."""
    scene = ball(name, radius=radius, depth=radius, medium=medium)
    share = (np.arange(SAMPLES) + 0.5) / SAMPLES
    # Evenly over the sphere.
    gamma, around = np.arccos(1.0 - 2.0 * share), TURN * np.arange(SAMPLES)
    out = np.column_stack([np.sin(gamma) * np.cos(around), np.sin(gamma) * np.sin(around), np.cos(gamma)])
    truth = exact_sphere_light.beam_exitance(medium, radius=radius, gamma=gamma)
    light = CollimatedBeam((0.0, 0.0, -1.0))
    return Scene(name, scene.surface, medium, light, radius * out, np.ones(SAMPLES), truth)


def turbid(albedo: float, eta: float = 1.4) -> Medium:
    """A medium of one mean free path per unit."""
    return Medium(sigma_a=1.0 - albedo, sigma_s_prime=albedo, eta=eta)


SCENES: dict[str, Callable[[str], Scene]] = {
    "sphere": ball,
    "sphere, source .5 deep": lambda name: ball(name, depth=0.5),
    "sphere, source 2 deep": lambda name: ball(name, depth=2.0),
    "sphere, source at the centre": lambda name: ball(name, depth=10.0),
    "sphere of radius 3": lambda name: ball(name, radius=3.0, depth=1.0),
    "sphere of radius 30": lambda name: ball(name, radius=30.0, depth=1.0),
    "sphere, n 1": lambda name: ball(name, depth=1.0, medium=turbid(0.99, 1.0)),
    "sphere, n 1.5": lambda name: ball(name, depth=1.0, medium=turbid(0.99, 1.5)),
    "sphere, alpha' .8": lambda name: ball(name, depth=1.0, medium=turbid(0.8)),
    "sphere, alpha' .9999": lambda name: ball(name, depth=1.0, medium=turbid(0.9999)),
    "slab of 10": lambda name: plate(name, thickness=10.0),
    "slab of 3": lambda name: plate(name, thickness=3.0),
    "cylinder": rod,
    "sphere in diffuse light": lambda name: furnace(name, TISSUE),
    "sphere of radius 10 in a beam": lambda name: lit_ball(name, turbid(0.99, 1.0), radius=10.0),
    "sphere of radius 2 in a beam": lambda name: lit_ball(name, turbid(0.99, 1.0), radius=2.0),
    "sphere in a beam, g .8": lambda name: lit_ball(
        name, Medium(sigma_a=0.01, sigma_s=5.0, g=0.8, eta=1.0), radius=5.0
    ),
}
