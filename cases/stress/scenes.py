"""Scenes of the stress map: a body, a medium and a light, by the values on the two axes of a panel."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tetlux.cases.chart.benchmark import Samples, on_true_sphere
from tetlux.cases.chart.measure import surface_samples
from tetlux.cases.stress.meshes import ball_of_layers, spoiled
from tetlux.cases.stress.shapes import SHAPES
from tetlux.fem import CollimatedBeam, DiffuseLight, Emission, Light, Medium, PencilBeam, PointSource, Region
from tetlux.fem.exact import concentric, slab, sphere, sphere_light
from tetlux.fem.grading import lit_points
from tetlux.meshing import shapes
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh

TOLERANCE = 0.05
# The ball of all panels where a mesh is given, by its radius in mean edges of that mesh.
SUBDIVISIONS, LAYERS, CORE_LAYERS = 2, 5, 3
INDEX = 1.4
# Depth of a point on a mesh of unit edges: not that of a node.
OFF_NODES = 0.5


@dataclass(frozen=True, eq=False)
class Scene:
    """What is solved for, and what is known of it.

    Attributes
    ----------
    surface : Surface
    medium : Medium
    light : Light
    regions : tuple of Region
    mesh : TetMesh or None
        If given, the scene is solved on it as it is.
    truth : (Samples, (n,) ndarray) or None
        Places on the true surface, and the exitance there in closed form, W/unit².
    bound : float or None
        What the fluence may not exceed by the maximum principle, W/unit².
    dips : bool
        Whether the equation itself may dip below zero: its source has a first moment.
    alike : Scene or None
        The same scene at scale 1.
    """

    surface: Surface
    medium: Medium
    light: Light
    regions: tuple[Region, ...] = ()
    mesh: TetMesh | None = None
    truth: tuple[Samples, FloatArray] | None = None
    bound: float | None = None
    dips: bool = False
    alike: "Scene | None" = None


def turbid(albedo: float, eta: float = INDEX, free_path: float = 1.0) -> Medium:
    """A medium by its reduced albedo and its mean free path."""
    return Medium(sigma_a=(1.0 - albedo) / free_path, sigma_s_prime=albedo / free_path, eta=eta)


def decaying(albedo: float, sigma_tr: float) -> Medium:
    """A medium by its reduced albedo, less than 1, and its sigma_tr."""
    return turbid(albedo, free_path=float(np.sqrt(3.0 * (1.0 - albedo))) / sigma_tr)


def in_range(decay: float) -> Medium:
    """A medium by the sigma_tr h of a mesh of unit edges, whose ball is neither too small nor too large."""
    return decaying(0.97 if decay < 1.0 else 0.5, decay)


def _samples(surface: Surface, medium: Medium, light: Light) -> Samples:
    deposit = light.deposit_in(surface, medium)
    return Samples(*surface_samples(surface, *lit_points([deposit], medium)))


def _on_ball(
    surface: Surface, medium: Medium, light: Light, radius: float, exitance: Callable[[FloatArray], FloatArray | float]
) -> tuple[Samples, FloatArray]:
    """A closed form on a ball around the origin, by the angle at the centre from +z."""
    samples = on_true_sphere(_samples(surface, medium, light), np.zeros(3), radius)
    gamma = np.arctan2(np.hypot(*samples.points[:, :2].T), samples.points[:, 2])
    return samples, np.broadcast_to(exitance(gamma), len(gamma))


def point_in_ball(medium: Medium, radius: float, depth: float, mesh: TetMesh | None = None) -> Scene:
    """A point source of 1 W below the pole of a ball."""
    surface, light = shapes.sphere(radius), PointSource((0.0, 0.0, radius - depth))
    truth = _on_ball(
        surface,
        medium,
        light,
        radius,
        lambda gamma: sphere.point_exitance(medium, radius=radius, source_radius=radius - depth, gamma=gamma),
    )
    return Scene(surface, medium, light, mesh=mesh, truth=truth)


def ball_in_diffuse_light(medium: Medium, radius: float, mesh: TetMesh | None = None) -> Scene:
    """A ball that 1 W/unit² of diffuse light falls on from everywhere."""
    surface, light = shapes.sphere(radius), DiffuseLight(1.0)
    passed = light.deposit_in(surface, medium).transmitted_irradiance
    value = passed * sphere_light.diffuse_exitance(medium, radius=radius)
    truth = _on_ball(surface, medium, light, radius, lambda _: value)
    # 4 E_t/(1 - 2 C1), with E_t = eta² (1 - 2 C1).
    return Scene(surface, medium, light, mesh=mesh, truth=truth, bound=4.0 * medium.eta**2)


def point_by_decay_and_albedo(decay: float, albedo: float) -> Scene:
    """A point in a ball on a given mesh, by its reduced albedo and the sigma_tr h of that mesh, of mean edge h = 1."""
    mesh = mesh_of_unit_edges()
    radius = float(np.linalg.norm(mesh.points, axis=1).max())
    return point_in_ball(decaying(albedo, decay), radius, OFF_NODES, mesh)


def diffuse_by_decay_and_albedo(decay: float, albedo: float) -> Scene:
    """The same ball in diffuse light."""
    mesh = mesh_of_unit_edges()
    radius = float(np.linalg.norm(mesh.points, axis=1).max())
    return ball_in_diffuse_light(decaying(albedo, decay), radius, mesh)


def glow_by_decay_and_albedo(decay: float, albedo: float) -> Scene:
    """The same ball, glowing throughout, 1 W/unit³."""
    mesh, medium = mesh_of_unit_edges(), decaying(albedo, decay)
    radius = float(np.linalg.norm(mesh.points, axis=1).max())
    surface, light = shapes.sphere(radius), Emission(1.0)
    value = sphere_light.glow_exitance(medium, radius=radius)
    return Scene(surface, medium, light, mesh=mesh, truth=_on_ball(surface, medium, light, radius, lambda _: value))


def beam_by_radius_and_albedo(radius: float, albedo: float) -> Scene:
    """A ball in a beam as wide as itself from above, of matched index."""
    surface, medium, light = shapes.sphere(radius), turbid(albedo, eta=1.0), CollimatedBeam((0.0, 0.0, -1.0))
    truth = _on_ball(
        surface, medium, light, radius, lambda gamma: sphere_light.beam_exitance(medium, radius=radius, gamma=gamma)
    )
    return Scene(surface, medium, light, truth=truth)


def diffuse_by_core(absorption: float, radius: float) -> Scene:
    """A ball of radius 10 and albedo .99 with a core, by its radius and its absorption times its scattering."""
    shell, core = turbid(0.99), Medium(sigma_a=absorption, sigma_s_prime=1.0, eta=INDEX)
    surface, light, outer = shapes.sphere(10.0), DiffuseLight(1.0), 10.0
    passed = light.deposit_in(surface, shell).transmitted_irradiance
    value = passed * concentric.diffuse_exitance(core, shell, core_radius=radius, radius=outer)
    truth = _on_ball(surface, shell, light, outer, lambda _: value)
    regions = (Region(shapes.sphere(radius), core),)
    return Scene(surface, shell, light, regions, truth=truth, bound=4.0 * INDEX**2)


def by_decay_and_quality(decay: float, quality: float) -> Scene:
    """A ball with slivers and needles in its mesh, by the worst one's quality and the sigma_tr h of that mesh."""
    mesh = mesh_of_unit_edges()
    radius = float(np.linalg.norm(mesh.points, axis=1).max())
    return point_in_ball(in_range(decay), radius, OFF_NODES, spoiled(mesh, quality))


def mesh_of_unit_edges(core: int = 0) -> TetMesh:
    """The ball of layers whose edges have a mean length of 1."""
    mesh = ball_of_layers(1.0, SUBDIVISIONS, LAYERS, core)
    return TetMesh(mesh.points / mesh.edge_lengths.mean(), mesh.tetrahedra, regions=mesh.regions)


def by_index_and_albedo(eta: float, albedo: float) -> Scene:
    """A point one mean free path below the surface of a ball of radius 10 mean free paths."""
    return point_in_ball(turbid(albedo, eta), 10.0, 1.0)


def by_radius_and_depth(radius: float, depth: float) -> Scene:
    """A point in a ball; mean free paths."""
    return point_in_ball(turbid(0.99), radius, depth)


def by_peak_and_index(g: float, eta: float) -> Scene:
    """A pencil beam across a ball of radius 5 mean free paths; its exitance is compared a mean free path off."""
    radius = 5.0
    medium = Medium(sigma_a=0.01, sigma_s=0.99 / (1.0 - g), g=g, eta=eta)
    surface = shapes.sphere(radius)
    light = PencilBeam((0.0, 0.0, 2.0 * radius), (0.0, 0.0, -1.0), deposit="line")
    deposit = light.deposit_in(surface, medium)
    passed = deposit.incident - deposit.specular
    samples = on_true_sphere(_samples(surface, medium, light), np.zeros(3), radius)
    away = np.hypot(*samples.points[:, :2].T) > medium.mean_free_path
    samples = Samples(samples.points[away], samples.normals[away], samples.weights[away])
    gamma = np.arctan2(np.hypot(*samples.points[:, :2].T), samples.points[:, 2])
    exitance = passed * sphere_light.pencil_exitance(medium, radius=radius, gamma=gamma)
    return Scene(surface, medium, light, truth=(samples, exitance), dips=True)


def by_thickness_and_albedo(thickness: float, albedo: float) -> Scene:
    """A point a mean free path below the upper face of a slab, or half-way through a thinner one; mean free paths.

    The slab is so wide that its rim does not matter where it is compared.
    """
    medium, depth = turbid(albedo), min(1.0, 0.5 * thickness)
    width = 14.0 + min(6.0 * thickness, 46.0)
    surface, light = shapes.slab(width, thickness), PointSource((0.0, 0.0, -depth))
    samples = _samples(surface, medium, light)
    rho = np.hypot(*samples.points[:, :2].T)
    near = (rho < 0.2 * width) & (samples.normals[:, 2] > 0.5)
    samples = Samples(samples.points[near], samples.normals[near], samples.weights[near])
    exitance = slab.point_exitance(medium, thickness=thickness, depth=depth, rho=rho[near])
    return Scene(surface, medium, light, truth=(samples, exitance))


def by_contrast_and_decay(contrast: float, decay: float) -> Scene:
    """Concentric balls on a given mesh in diffuse light: sigma_a and sigma_s' of the core are `contrast` times."""
    mesh = mesh_of_unit_edges(CORE_LAYERS)
    radius = float(np.linalg.norm(mesh.points, axis=1).max())
    return two_balls("diffuse", in_range(decay), contrast, contrast, radius, mesh)


def by_contrasts(scattering: float, absorption: float) -> Scene:
    """Concentric balls of radius 10 and 6 mean free paths, whose core glows."""
    return two_balls("glow", turbid(0.99), scattering, absorption, 10.0)


def two_balls(
    of: str, shell: Medium, scattering: float, absorption: float, radius: float, mesh: TetMesh | None = None
) -> Scene:
    """A ball with a core of .6 of its radius, whose coefficients are so many times the ball's."""
    assert shell.sigma_s_prime is not None
    core = Medium(sigma_a=absorption * shell.sigma_a, sigma_s_prime=scattering * shell.sigma_s_prime, eta=shell.eta)
    inner = CORE_LAYERS / LAYERS * radius
    light = DiffuseLight(1.0) if of == "diffuse" else Emission(1.0, region=1)
    surface = shapes.sphere(radius)
    if of == "diffuse":
        passed = DiffuseLight(1.0).deposit_in(surface, shell).transmitted_irradiance
        value = passed * concentric.diffuse_exitance(core, shell, core_radius=inner, radius=radius)
    else:
        value = concentric.glow_exitance(core, shell, core_radius=inner, radius=radius)
    samples = on_true_sphere(Samples(*surface_samples(surface, np.zeros((0, 3)), np.zeros(0))), np.zeros(3), radius)
    return Scene(
        surface,
        shell,
        light,
        (Region(shapes.sphere(inner), core),),
        mesh,
        (samples, np.full(len(samples.points), value)),
        4.0 * shell.eta**2 if of == "diffuse" else None,
    )


LENGTH_KINDS = ("point", "diffuse light", "pencil beam", "glowing core", "point, meshed anew")


def by_length(length: float, kind: str) -> Scene:
    """Balls of ten mean free paths whose radius is a length: they are to be the same but for that."""
    scene = _of_length(length, kind)
    return scene if scene.mesh is None else replace(scene, alike=_of_length(1.0, kind))


def _of_length(length: float, kind: str) -> Scene:
    medium = turbid(0.99, free_path=0.1 * length)
    if kind == "point, meshed anew":
        return point_in_ball(medium, length, 0.1 * length)
    ball = ball_of_layers(1.0, SUBDIVISIONS, LAYERS, CORE_LAYERS if kind == "glowing core" else 0)
    mesh = replace(ball, points=length * ball.points)
    if kind == "point":
        return point_in_ball(medium, length, 0.1 * length, mesh)
    if kind == "diffuse light":
        return ball_in_diffuse_light(medium, length, mesh)
    if kind == "glowing core":
        return two_balls("glow", medium, 0.1, 10.0, length, mesh)
    # Not along an edge.
    beam = PencilBeam((0.01 * length, 0.02 * length, 2.0 * length), (0.0, 0.0, -1.0), deposit="line")
    return Scene(shapes.sphere(length), medium, beam, mesh=mesh, dips=True)


SHAPE_LIGHTS = ("point, albedo 0.1", "point, albedo 1", "diffuse, albedo 0.1", "diffuse, albedo 1")


def by_shape_and_light(shape: str, lit: str) -> Scene:
    """A body that is hard to mesh, some mean free paths large."""
    make, place = SHAPES[shape]
    surface, (kind, albedo) = make(), lit.split(", albedo ")
    medium = turbid(float(albedo))
    if kind == "point":
        return Scene(surface, medium, PointSource(place))
    return Scene(surface, medium, DiffuseLight(1.0), bound=4.0 * medium.eta**2)
