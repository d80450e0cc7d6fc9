"""Scenarios of the stress map: a body, a medium and a light, by the values on the two axes of a panel."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tetlux.cases.chart.samples import Samples, project_to_sphere, surface_samples
from tetlux.cases.stress.bodies import BODIES
from tetlux.cases.stress.meshes import ball_of_layers, degrade
from tetlux.fem import CollimatedBeam, DiffuseLight, Emission, Light, Medium, PencilBeam, PointSource, Region
from tetlux.fem.body.body import Body
from tetlux.fem.exact import concentric, slab, sphere_light
from tetlux.fem.exact.registry import closed_forms
from tetlux.fem.grading import places_to_resolve
from tetlux.meshing import shapes
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.solids import Sphere
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

TOLERANCE = 0.05
# The ball of all panels where a mesh is given: subdivisions of its icospheres, and how many of these are nested.
SUBDIVISIONS, LAYERS, CORE_LAYERS = 2, 5, 3
INDEX = 1.4
# Depth of a point on a mesh of unit edges: between nodes.
OFF_NODES = 0.5

# Samples of the true surface, and the exitance there in closed form, W/unit².
Truth = tuple[Samples, FloatArray]


@dataclass(frozen=True, eq=False)
class Scenario:
    """What is solved for, and what is known of it.

    Attributes
    ----------
    surface : Surface
    medium : Medium
    light : Light
    regions : tuple of Region
    mesh : TetMesh or None
        If given, the scenario is solved on it as it is.
    truth : (Samples, (n,) ndarray) or None
        Samples of the true surface, and the exitance there in closed form, W/unit².
    bound : float or None
        Upper bound of the fluence by the maximum principle, W/unit².
    may_be_negative : bool
        Whether the equation itself may have a fluence below zero: its source has a first moment.
    unit_scale : Scenario or None
        The same scenario with all lengths divided by its radius.
    """

    surface: Surface
    medium: Medium
    light: Light
    regions: tuple[Region, ...] = ()
    mesh: TetMesh | None = None
    truth: Truth | None = None
    bound: float | None = None
    may_be_negative: bool = False
    unit_scale: "Scenario | None" = None


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
    """Samples of the triangles of a surface; those of a ball are moved to the ball itself."""
    samples = surface_samples(surface, *places_to_resolve([light.deposit_in(Body(surface, (medium,)))]))
    return project_to_sphere(samples, surface.shape) if isinstance(surface.shape, Sphere) else samples


def _in_registry(surface: Surface, medium: Medium, light: Light) -> Truth:
    """The exitance by the closed form that the registry holds for a ball."""
    samples = _samples(surface, medium, light)
    forms = closed_forms(surface.shape, medium, [light.deposit_in(Body(surface, (medium,)))])
    return samples, forms["series"].exitance(samples.points)


def _by_angle(samples: Samples, exitance: Callable[[FloatArray], FloatArray]) -> Truth:
    """A closed form by the angle at the centre of a ball around the origin, from +z."""
    return samples, exitance(np.arctan2(np.hypot(*samples.points[:, :2].T), samples.points[:, 2]))


def _uniform(samples: Samples, exitance: float) -> Truth:
    return samples, np.full(len(samples.points), exitance)


def point_in_ball(medium: Medium, radius: float, depth: float, mesh: TetMesh | None = None) -> Scenario:
    """A point source of 1 W below the pole of a ball."""
    surface, light = shapes.sphere(radius), PointSource((0.0, 0.0, radius - depth))
    return Scenario(surface, medium, light, mesh=mesh, truth=_in_registry(surface, medium, light))


def ball_in_diffuse_light(medium: Medium, radius: float, mesh: TetMesh | None = None) -> Scenario:
    """A ball that 1 W/unit² of diffuse light falls on from everywhere."""
    surface, light = shapes.sphere(radius), DiffuseLight(1.0)
    # 4 E_t/(1 - 2 C1), with E_t = eta² (1 - 2 C1).
    bound = 4.0 * medium.eta**2
    return Scenario(surface, medium, light, mesh=mesh, truth=_in_registry(surface, medium, light), bound=bound)


def point_by_decay_and_albedo(decay: float, albedo: float) -> Scenario:
    """A point in a ball on a given mesh, by its reduced albedo and the sigma_tr h of that mesh, of mean edge h = 1."""
    mesh = mesh_of_unit_edges()
    return point_in_ball(decaying(albedo, decay), _radius(mesh), OFF_NODES, mesh)


def diffuse_by_decay_and_albedo(decay: float, albedo: float) -> Scenario:
    """The same ball in diffuse light."""
    mesh = mesh_of_unit_edges()
    return ball_in_diffuse_light(decaying(albedo, decay), _radius(mesh), mesh)


def glow_by_decay_and_albedo(decay: float, albedo: float) -> Scenario:
    """The same ball, which emits 1 W/unit³ throughout."""
    mesh, medium = mesh_of_unit_edges(), decaying(albedo, decay)
    surface, light = shapes.sphere(_radius(mesh)), Emission(1.0)
    return Scenario(surface, medium, light, mesh=mesh, truth=_in_registry(surface, medium, light))


def beam_by_radius_and_albedo(radius: float, albedo: float) -> Scenario:
    """A ball in a beam as wide as itself from above, of matched index."""
    surface, medium, light = shapes.sphere(radius), turbid(albedo, eta=1.0), CollimatedBeam((0.0, 0.0, -1.0))
    samples = _samples(surface, medium, light)
    truth = _by_angle(samples, lambda gamma: sphere_light.beam_exitance(medium, radius=radius, gamma=gamma))
    return Scenario(surface, medium, light, truth=truth)


def diffuse_by_core(absorption: float, radius: float) -> Scenario:
    """A ball of radius 10 and albedo .99 with a core, by its radius and its absorption times its scattering."""
    shell, core = turbid(0.99), Medium(sigma_a=absorption, sigma_s_prime=1.0, eta=INDEX)
    surface, light, outer = shapes.sphere(10.0), DiffuseLight(1.0), 10.0
    transmitted = light.deposit_in(Body(surface, (shell,))).terms.transmitted_irradiance
    value = transmitted * concentric.diffuse_exitance(core, shell, core_radius=radius, radius=outer)
    truth = _uniform(_samples(surface, shell, light), float(value))
    regions = (Region(shapes.sphere(radius), core),)
    return Scenario(surface, shell, light, regions, truth=truth, bound=4.0 * INDEX**2)


def by_decay_and_quality(decay: float, quality: float) -> Scenario:
    """A ball with slivers and needles in its mesh, by the worst one's quality and the sigma_tr h of that mesh."""
    mesh = mesh_of_unit_edges()
    return point_in_ball(in_range(decay), _radius(mesh), OFF_NODES, degrade(mesh, quality))


def mesh_of_unit_edges(core: int = 0) -> TetMesh:
    """The ball of layers whose edges have a mean length of 1."""
    mesh = ball_of_layers(1.0, SUBDIVISIONS, LAYERS, core)
    return TetMesh(mesh.points / mesh.edge_lengths.mean(), mesh.tetrahedra, regions=mesh.regions)


def _radius(mesh: TetMesh) -> float:
    return float(np.linalg.norm(mesh.points, axis=1).max())


def by_index_and_albedo(eta: float, albedo: float) -> Scenario:
    """A point one mean free path below the surface of a ball of radius 10 mean free paths."""
    return point_in_ball(turbid(albedo, eta), 10.0, 1.0)


def by_radius_and_depth(radius: float, depth: float) -> Scenario:
    """A point in a ball; mean free paths."""
    return point_in_ball(turbid(0.99), radius, depth)


def by_peak_and_index(g: float, eta: float) -> Scenario:
    """A pencil beam across a ball of radius 5 mean free paths; its exitance is compared a mean free path off."""
    radius = 5.0
    medium = Medium(sigma_a=0.01, sigma_s=0.99 / (1.0 - g), g=g, eta=eta)
    surface = shapes.sphere(radius)
    light = PencilBeam((0.0, 0.0, 2.0 * radius), (0.0, 0.0, -1.0), deposit="line")
    deposit = light.deposit_in(Body(surface, (medium,)))
    entered = deposit.ledger.incident - deposit.ledger.specular
    samples = _samples(surface, medium, light)
    samples = samples.where(np.hypot(*samples.points[:, :2].T) > medium.mean_free_path)
    truth = _by_angle(samples, lambda gamma: entered * sphere_light.pencil_exitance(medium, radius=radius, gamma=gamma))
    return Scenario(surface, medium, light, truth=truth, may_be_negative=True)


def by_thickness_and_albedo(thickness: float, albedo: float) -> Scenario:
    """A point a mean free path below the upper face of a slab, or half-way through a thinner one; mean free paths.

    The slab is so wide that its rim does not matter where it is compared.
    """
    medium, depth = turbid(albedo), min(1.0, 0.5 * thickness)
    width = 14.0 + min(6.0 * thickness, 46.0)
    surface, light = shapes.slab(width, thickness), PointSource((0.0, 0.0, -depth))
    samples = _samples(surface, medium, light)
    rho = np.hypot(*samples.points[:, :2].T)
    near = (rho < 0.2 * width) & (samples.normals[:, 2] > 0.5)
    exitance = slab.point_exitance(medium, thickness=thickness, depth=depth, rho=rho[near])
    return Scenario(surface, medium, light, truth=(samples.where(near), exitance))


def by_contrast_and_decay(contrast: float, decay: float) -> Scenario:
    """Concentric balls on a given mesh in diffuse light: sigma_a and sigma_s' of the core are `contrast` times."""
    mesh = mesh_of_unit_edges(CORE_LAYERS)
    return two_balls("diffuse", in_range(decay), contrast, contrast, _radius(mesh), mesh)


def by_contrasts(scattering: float, absorption: float) -> Scenario:
    """Concentric balls of radius 10 and 6 mean free paths, whose core glows."""
    return two_balls("glow", turbid(0.99), scattering, absorption, 10.0)


def two_balls(
    light_kind: str, shell: Medium, scattering: float, absorption: float, radius: float, mesh: TetMesh | None = None
) -> Scenario:
    """A ball with a core of .6 of its radius, whose coefficients are so many times the ball's."""
    assert shell.sigma_s_prime is not None
    core = Medium(sigma_a=absorption * shell.sigma_a, sigma_s_prime=scattering * shell.sigma_s_prime, eta=shell.eta)
    inner = CORE_LAYERS / LAYERS * radius
    surface, light, bound = shapes.sphere(radius), _light_of_two_balls(light_kind), None
    if light_kind == "diffuse":
        transmitted = light.deposit_in(Body(surface, (shell,))).terms.transmitted_irradiance
        value = transmitted * concentric.diffuse_exitance(core, shell, core_radius=inner, radius=radius)
        bound = 4.0 * shell.eta**2
    else:
        value = concentric.glow_exitance(core, shell, core_radius=inner, radius=radius)
    assert isinstance(surface.shape, Sphere)
    samples = project_to_sphere(surface_samples(surface, np.zeros((0, 3)), np.zeros(0)), surface.shape)
    regions = (Region(shapes.sphere(inner), core),)
    return Scenario(surface, shell, light, regions, mesh, _uniform(samples, float(value)), bound)


def _light_of_two_balls(kind: str) -> DiffuseLight | Emission:
    return DiffuseLight(1.0) if kind == "diffuse" else Emission(1.0, region=1)


LENGTH_KINDS = ("point", "diffuse light", "pencil beam", "glowing core", "point, meshed anew")


def by_length(length: float, kind: str) -> Scenario:
    """Balls of ten mean free paths by their radius: figures must not depend on it but for their units."""
    scenario = _of_length(length, kind)
    return scenario if scenario.mesh is None else replace(scenario, unit_scale=_of_length(1.0, kind))


def _of_length(length: float, kind: str) -> Scenario:
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
    # Not along an edge of the mesh.
    beam = PencilBeam((0.01 * length, 0.02 * length, 2.0 * length), (0.0, 0.0, -1.0), deposit="line")
    return Scenario(shapes.sphere(length), medium, beam, mesh=mesh, may_be_negative=True)


SHAPE_LIGHTS = ("point, albedo 0.1", "point, albedo 1", "diffuse, albedo 0.1", "diffuse, albedo 1")


def by_shape_and_light(body: str, light: str) -> Scenario:
    """A body that is hard to mesh, some mean free paths large."""
    make, place = BODIES[body]
    surface, (kind, albedo) = make(), light.split(", albedo ")
    medium = turbid(float(albedo))
    if kind == "point":
        return Scenario(surface, medium, PointSource(place))
    return Scenario(surface, medium, DiffuseLight(1.0), bound=4.0 * medium.eta**2)
