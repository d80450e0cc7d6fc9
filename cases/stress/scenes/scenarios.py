"""Scenarios of the stress map: functions that make a body, a medium and a light from the values of two axes."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tetlux.cases.chart.samples import Samples, project_to_sphere, surface_samples
from tetlux.cases.stress.scenes.bodies import BODIES
from tetlux.cases.stress.scenes.meshes import degrade, layered_ball
from tetlux.cases.stress.scenes.readout import Readout
from tetlux.fem import CollimatedBeam, DiffuseLight, Emission, Light, Medium, PencilBeam, PointSource, Region
from tetlux.fem.body.body import Body
from tetlux.fem.exact import concentric, slab, sphere_light
from tetlux.fem.exact.registry import closed_forms
from tetlux.fem.grading import places_to_resolve
from tetlux.fem.outcome.detector_kinds import PointDetector
from tetlux.meshing import shapes
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.surface.solids import Sphere
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

TOLERANCE = 0.05
# The mesh of the ball on a given mesh: subdivisions of its icospheres, number of layers, and of layers in the core.
SUBDIVISIONS, LAYERS, CORE_LAYERS = 2, 5, 3
INDEX = 1.4
# Depth of a point source on a mesh of unit edges, between nodes.
OFF_NODES = 0.5

# Samples of the true surface, and the exitance there in closed form, W/unit².
Truth = tuple[Samples, FloatArray]


@dataclass(frozen=True, eq=False)
class Scenario:
    """A problem, and what is known of its solution.

    Attributes
    ----------
    surface : Surface
    medium : Medium
    light : Light
    regions : tuple of Region
    mesh : TetMesh or None
        A mesh that the scenario is solved on as it is.
    truth : (Samples, (n,) ndarray) or None
        Samples of the true surface, and the exitance there in closed form, W/unit².
    bound : float or None
        Upper bound of the fluence by the maximum principle, W/unit².
    may_be_negative : bool
        Whether the exact fluence may be negative, since the source has a first moment.
    unit_scale : Scenario or None
        The same scenario with all lengths divided by its radius.
    readings : ((d, 3), (n,) ndarray) or None
        Positions of point detectors, and the exitance there in closed form; the run is then for them alone.
    read : callable or None
        Finds what the closed form of `readings` is of, where that is not the exitance of steady light.
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
    readings: tuple[FloatArray, NumberArray] | None = None
    read: "Callable[[Scenario], Readout] | None" = None

    @property
    def detectors(self) -> list[PointDetector]:
        """The detectors whose readings are known."""
        places = [] if self.readings is None else self.readings[0].tolist()
        return [PointDetector((x, y, z)) for x, y, z in places]


def medium_of_albedo(albedo: float, eta: float = INDEX, free_path: float = 1.0) -> Medium:
    """A medium with a reduced albedo and a transport mean free path."""
    return Medium(sigma_a=(1.0 - albedo) / free_path, sigma_s_prime=albedo / free_path, eta=eta)


def medium_of_decay(albedo: float, sigma_tr: float) -> Medium:
    """A medium with a reduced albedo, less than 1, and a sigma_tr."""
    return medium_of_albedo(albedo, free_path=float(np.sqrt(3.0 * (1.0 - albedo))) / sigma_tr)


def medium_for_decay(decay: float) -> Medium:
    """A medium with a sigma_tr h on a mesh of unit edges, whose albedo keeps the ball within the allowed sizes."""
    return medium_of_decay(0.97 if decay < 1.0 else 0.5, decay)


def _samples(surface: Surface, medium: Medium, light: Light) -> Samples:
    """Sample a surface; samples of a ball are moved from its triangles to the exact sphere."""
    samples = surface_samples(surface, *places_to_resolve([light.deposit_in(Body(surface, (medium,)))]))
    return project_to_sphere(samples, surface.shape) if isinstance(surface.shape, Sphere) else samples


def _truth_from_registry(surface: Surface, medium: Medium, light: Light) -> Truth:
    """The truth for a ball by the closed form in the registry."""
    samples = _samples(surface, medium, light)
    forms = closed_forms(surface.shape, medium, [light.deposit_in(Body(surface, (medium,)))])
    return samples, forms["series"].exitance(samples.points)


def _truth_by_angle(samples: Samples, exitance: Callable[[FloatArray], FloatArray]) -> Truth:
    """The truth by a closed form over the polar angle of a ball around the origin."""
    return samples, exitance(np.arctan2(np.hypot(*samples.points[:, :2].T), samples.points[:, 2]))


def _uniform_truth(samples: Samples, exitance: float) -> Truth:
    return samples, np.full(len(samples.points), exitance)


def point_in_ball(medium: Medium, radius: float, depth: float, mesh: TetMesh | None = None) -> Scenario:
    """A point source of 1 W below the pole of a ball."""
    surface, light = shapes.sphere(radius), PointSource((0.0, 0.0, radius - depth))
    return Scenario(surface, medium, light, mesh=mesh, truth=_truth_from_registry(surface, medium, light))


def ball_in_diffuse_light(medium: Medium, radius: float, mesh: TetMesh | None = None) -> Scenario:
    """A ball in diffuse light of 1 W/unit²."""
    surface, light = shapes.sphere(radius), DiffuseLight(1.0)
    # 4 E_t/(1 - 2 C1), with E_t = eta² (1 - 2 C1).
    bound = 4.0 * medium.eta**2
    return Scenario(surface, medium, light, mesh=mesh, truth=_truth_from_registry(surface, medium, light), bound=bound)


def point_by_decay_and_albedo(decay: float, albedo: float) -> Scenario:
    """A point in a ball on a mesh of mean edge length h = 1, by sigma_tr h and reduced albedo."""
    mesh = mesh_of_unit_edges()
    return point_in_ball(medium_of_decay(albedo, decay), _radius(mesh), OFF_NODES, mesh)


def diffuse_by_decay_and_albedo(decay: float, albedo: float) -> Scenario:
    """The ball of `point_by_decay_and_albedo` in diffuse light."""
    mesh = mesh_of_unit_edges()
    return ball_in_diffuse_light(medium_of_decay(albedo, decay), _radius(mesh), mesh)


def glow_by_decay_and_albedo(decay: float, albedo: float) -> Scenario:
    """The ball of `point_by_decay_and_albedo`, which emits 1 W/unit³ everywhere."""
    mesh, medium = mesh_of_unit_edges(), medium_of_decay(albedo, decay)
    surface, light = shapes.sphere(_radius(mesh)), Emission(1.0)
    return Scenario(surface, medium, light, mesh=mesh, truth=_truth_from_registry(surface, medium, light))


def beam_by_radius_and_albedo(radius: float, albedo: float) -> Scenario:
    """An index-matched ball in a beam from above that covers it."""
    surface, medium, light = shapes.sphere(radius), medium_of_albedo(albedo, eta=1.0), CollimatedBeam((0.0, 0.0, -1.0))
    samples = _samples(surface, medium, light)
    truth = _truth_by_angle(samples, lambda gamma: sphere_light.beam_exitance(medium, radius=radius, gamma=gamma))
    return Scenario(surface, medium, light, truth=truth)


def diffuse_by_core_absorption_and_radius(absorption: float, radius: float) -> Scenario:
    """A ball of radius 10 and albedo .99 with a core, by the core's sigma_a over sigma_s' and its radius."""
    shell, core = medium_of_albedo(0.99), Medium(sigma_a=absorption, sigma_s_prime=1.0, eta=INDEX)
    surface, light, outer = shapes.sphere(10.0), DiffuseLight(1.0), 10.0
    transmitted = light.deposit_in(Body(surface, (shell,))).terms.transmitted_irradiance
    value = transmitted * concentric.diffuse_exitance(core, shell, core_radius=radius, radius=outer)
    truth = _uniform_truth(_samples(surface, shell, light), float(value))
    regions = (Region(shapes.sphere(radius), core),)
    return Scenario(surface, shell, light, regions, truth=truth, bound=4.0 * INDEX**2)


def point_by_decay_and_quality(decay: float, quality: float) -> Scenario:
    """A point in a ball on a mesh with slivers and needles, by sigma_tr h and the quality of the worst."""
    mesh = mesh_of_unit_edges()
    return point_in_ball(medium_for_decay(decay), _radius(mesh), OFF_NODES, degrade(mesh, quality))


def mesh_of_unit_edges(core: int = 0) -> TetMesh:
    """The layered ball, scaled to a mean edge length of 1."""
    mesh = layered_ball(1.0, SUBDIVISIONS, LAYERS, core)
    return TetMesh(mesh.points / mesh.edge_lengths.mean(), mesh.tetrahedra, regions=mesh.regions)


def _radius(mesh: TetMesh) -> float:
    return float(np.linalg.norm(mesh.points, axis=1).max())


def point_by_index_and_albedo(eta: float, albedo: float) -> Scenario:
    """A point 1 mean free path below the surface of a ball of radius 10 mean free paths."""
    return point_in_ball(medium_of_albedo(albedo, eta), 10.0, 1.0)


def point_by_radius_and_depth(radius: float, depth: float) -> Scenario:
    """A point in a ball; lengths in mean free paths."""
    return point_in_ball(medium_of_albedo(0.99), radius, depth)


def beam_by_g_and_index(g: float, eta: float) -> Scenario:
    """A pencil beam through a ball of radius 5 mean free paths, compared beyond 1 mean free path from it."""
    radius = 5.0
    medium = Medium(sigma_a=0.01, sigma_s=0.99 / (1.0 - g), g=g, eta=eta)
    surface = shapes.sphere(radius)
    light = PencilBeam((0.0, 0.0, 2.0 * radius), (0.0, 0.0, -1.0), deposit="line")
    deposit = light.deposit_in(Body(surface, (medium,)))
    entered = deposit.ledger.incident - deposit.ledger.specular
    samples = _samples(surface, medium, light)
    samples = samples.where(np.hypot(*samples.points[:, :2].T) > medium.mean_free_path)
    truth = _truth_by_angle(
        samples, lambda gamma: entered * sphere_light.pencil_exitance(medium, radius=radius, gamma=gamma)
    )
    return Scenario(surface, medium, light, truth=truth, may_be_negative=True)


def point_by_thickness_and_albedo(thickness: float, albedo: float) -> Scenario:
    """A point 1 mean free path below the upper face of a slab, or half-way through a thin one.

    Lengths are in mean free paths. The slab is wide enough for its rim not to matter where exitance is compared.
    """
    medium, depth = medium_of_albedo(albedo), min(1.0, 0.5 * thickness)
    width = 14.0 + min(6.0 * thickness, 46.0)
    surface, light = shapes.slab(width, thickness), PointSource((0.0, 0.0, -depth))
    samples = _samples(surface, medium, light)
    rho = np.hypot(*samples.points[:, :2].T)
    near = (rho < 0.2 * width) & (samples.normals[:, 2] > 0.5)
    exitance = slab.point_exitance(medium, thickness=thickness, depth=depth, rho=rho[near])
    return Scenario(surface, medium, light, truth=(samples.where(near), exitance))


def diffuse_by_contrast_and_decay(contrast: float, decay: float) -> Scenario:
    """Concentric balls on a given mesh in diffuse light: the core has `contrast` times the shell's coefficients."""
    mesh = mesh_of_unit_edges(CORE_LAYERS)
    return two_balls("diffuse", medium_for_decay(decay), contrast, contrast, _radius(mesh), mesh)


def glow_by_contrasts(scattering: float, absorption: float) -> Scenario:
    """Concentric balls of radius 10 and 6 mean free paths whose core emits."""
    return two_balls("glow", medium_of_albedo(0.99), scattering, absorption, 10.0)


def two_balls(
    light_kind: str, shell: Medium, scattering: float, absorption: float, radius: float, mesh: TetMesh | None = None
) -> Scenario:
    """A ball with a core of 0.6 of its radius, whose coefficients are given as multiples of the shell's."""
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
    return Scenario(surface, shell, light, regions, mesh, _uniform_truth(samples, float(value)), bound)


def _light_of_two_balls(kind: str) -> DiffuseLight | Emission:
    return DiffuseLight(1.0) if kind == "diffuse" else Emission(1.0, region=1)


LENGTH_KINDS = ("point", "diffuse light", "pencil beam", "glowing core", "point, meshed anew")


def ball_by_length_and_light(length: float, kind: str) -> Scenario:
    """Balls of radius 10 mean free paths in various units of length: dimensionless results must be the same."""
    scenario = _of_length(length, kind)
    return scenario if scenario.mesh is None else replace(scenario, unit_scale=_of_length(1.0, kind))


def _of_length(length: float, kind: str) -> Scenario:
    medium = medium_of_albedo(0.99, free_path=0.1 * length)
    if kind == "point, meshed anew":
        return point_in_ball(medium, length, 0.1 * length)
    ball = layered_ball(1.0, SUBDIVISIONS, LAYERS, CORE_LAYERS if kind == "glowing core" else 0)
    mesh = replace(ball, points=length * ball.points)
    if kind == "point":
        return point_in_ball(medium, length, 0.1 * length, mesh)
    if kind == "diffuse light":
        return ball_in_diffuse_light(medium, length, mesh)
    if kind == "glowing core":
        return two_balls("glow", medium, 0.1, 10.0, length, mesh)
    # Off the axis, so that the beam does not run along edges of the mesh.
    beam = PencilBeam((0.01 * length, 0.02 * length, 2.0 * length), (0.0, 0.0, -1.0), deposit="line")
    return Scenario(shapes.sphere(length), medium, beam, mesh=mesh, may_be_negative=True)


SHAPE_LIGHTS = ("point, albedo 0.1", "point, albedo 1", "diffuse, albedo 0.1", "diffuse, albedo 1")


def body_by_shape_and_light(body: str, light: str) -> Scenario:
    """A body that is hard to mesh, a few mean free paths large."""
    make, place = BODIES[body]
    surface, (kind, albedo) = make(), light.split(", albedo ")
    medium = medium_of_albedo(float(albedo))
    if kind == "point":
        return Scenario(surface, medium, PointSource(place))
    return Scenario(surface, medium, DiffuseLight(1.0), bound=4.0 * medium.eta**2)
