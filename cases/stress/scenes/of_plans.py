"""Scenarios of the panels of truncation and of the plan."""

from collections.abc import Callable

import numpy as np

from tetlux.cases.chart.samples import surface_samples
from tetlux.cases.stress.scenes.of_points import MOST_SAMPLES
from tetlux.cases.stress.scenes.point_bodies import PointBody, ball, block, layers, plate
from tetlux.cases.stress.scenes.scenarios import (
    Scenario,
    ball_in_diffuse_light,
    beam_by_radius_and_albedo,
    medium_of_albedo,
    two_balls,
)
from tetlux.fem import PointSource
from tetlux.fem.media.medium import Medium

# Bodies are compared within so many mean free paths of the source, where their light is.
NEAR = 12.0
# Depth of the source.
DEPTH = 1.0

TRUNCATED_BODIES: dict[str, Callable[[Medium], PointBody]] = {
    "ball of 60": lambda medium: ball(medium, 60.0, DEPTH),
    "ball of 300": lambda medium: ball(medium, 300.0, DEPTH),
    "thin plate of 2": lambda medium: plate(medium, 2.0, DEPTH, 300.0),
    "plate of 1,000": lambda medium: plate(medium, 1000.0, DEPTH, 1e4),
    "box, by an edge": lambda medium: block(medium, 60.0, (29.0, 0.3, 29.0)),
    "core of 10 σ_a": lambda medium: layers(medium, 200.0, DEPTH, ((0.98, 10.0, 1.0),)),
}
FEW_TRUNCATED_BODIES = ("ball of 300", "thin plate of 2", "box, by an edge")


def part_by_body_and_albedo(body: str, albedo: float) -> Scenario:
    """A point source 1 mean free path deep in a body, most of which is dark; lengths in mean free paths."""
    return _near_the_source(TRUNCATED_BODIES[body](medium_of_albedo(albedo)))


def _near_the_source(made: PointBody) -> Scenario:
    samples = surface_samples(made.surface, np.array([made.source]), np.array([DEPTH]))
    samples = samples.where(np.linalg.norm(samples.points - made.source, axis=1) < NEAR)
    # A sum over modes takes long.
    step = max(1, len(samples.points) // MOST_SAMPLES)
    samples = samples.where(np.arange(len(samples.points)) % step == 0)
    source = PointSource(made.source)
    return Scenario(made.surface, made.medium, source, made.regions, truth=(samples, made.exitance(samples.points)))


PLANNED: dict[str, Callable[[Medium], Scenario]] = {
    "ball, point": lambda medium: _near_the_source(ball(medium, 10.0, DEPTH)),
    "plate, point": lambda medium: _near_the_source(plate(medium, 6.0, DEPTH, 60.0)),
    "box, by an edge, point": lambda medium: _near_the_source(block(medium, 20.0, (9.0, 0.3, 9.0))),
    "core of 10 σ_a, point": lambda medium: _near_the_source(layers(medium, 15.0, DEPTH, ((0.7, 10.0, 1.0),))),
    "ball, diffuse": lambda medium: ball_in_diffuse_light(medium, 10.0),
    "ball, wide beam": lambda medium: beam_by_radius_and_albedo(5.0, 1.0 - medium.sigma_a),
    "ball, glowing core": lambda medium: two_balls("glow", medium, 1.0, 10.0, 10.0),
}
FEW_PLANNED = ("ball, point", "box, by an edge, point", "ball, diffuse")


def plan_by_scene_and_albedo(scene: str, albedo: float) -> Scenario:
    """A scene that several models can solve; lengths in mean free paths."""
    return PLANNED[scene](medium_of_albedo(albedo))
