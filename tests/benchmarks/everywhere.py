"""Are tolerances of exitance everywhere and of fluence inside met? ``python -m tests.benchmarks.everywhere``.

Random balls and balls in balls of `tests.benchmarks.readings` at ``everywhere_tolerance=.1``, against their series at
2,000 points, half of them near the light; and the fluence in a dark ball in a cube at ``volume_tolerance=.03``, against
`Solution.fluence_with_error`. Seconds are of the processor, without the cache of meshes.
"""

import argparse
import time

import numpy as np

from tests.benchmarks.reading_scenes import Scene, random_scene
from tetlux.fem import Medium, PencilBeam, PointSource, Region, solve
from tetlux.fem.exact import layered_ball
from tetlux.fem.exact import sphere as exact_sphere
from tetlux.fem.quadratic.field_error import DARKEST
from tetlux.meshing import box, sphere
from tetlux.meshing.arrays import FloatArray

TOLERANCE = 0.1
POINTS = 1000
# Scenes of these remainders by six are balls, and balls in balls.
BALLS = (2, 4)


def _points(radius: float, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Angles from the light, half of them uniform in their logarithm, and points there."""
    gamma = np.concatenate([np.arccos(rng.uniform(-1.0, 1.0, POINTS)), np.pi * 10.0 ** rng.uniform(-2.0, 0.0, POINTS)])
    around = rng.uniform(0.0, 2.0 * np.pi, len(gamma))
    return gamma, radius * np.column_stack(
        [np.sin(gamma) * np.cos(around), np.sin(gamma) * np.sin(around), np.cos(gamma)]
    )


def _truth(scene: Scene, radius: float, gamma: FloatArray) -> FloatArray:
    depth = scene.source[2]
    if not scene.regions:
        return exact_sphere.point_exitance(scene.medium, radius=radius, source_radius=depth, gamma=gamma)
    core = scene.regions[0]
    assert isinstance(core.medium, Medium)
    inner = float(np.linalg.norm(core.surface.points[0]))
    return layered_ball.point_exitance([core.medium, scene.medium], [inner, radius], source_radius=depth, gamma=gamma)


def print_scene(number: int) -> None:
    """A line for one scene."""
    scene = random_scene(number)
    radius = float(np.linalg.norm(scene.surface.points[0]))
    gamma, points = _points(radius, np.random.default_rng(number))
    started = time.process_time()
    solution = solve(
        scene.surface,
        scene.medium,
        [PointSource(scene.source, 1.0)],
        regions=scene.regions,
        tolerance=None,
        everywhere_tolerance=TOLERANCE,
        cache=False,
    )
    seconds = time.process_time() - started
    truth = _truth(scene, radius, gamma)
    errors = np.abs(solution.exitance_at(points) - truth) / np.maximum(truth, DARKEST * truth.max())
    print(
        f"{number} {scene.name}, albedo {scene.medium.albedo:.4f}, radius {radius:.1f}: "
        f"{len(solution.mesh.tetrahedra):,} tetrahedra, {seconds:.1f} s; estimated {solution.everywhere_error:.2%}; "
        f"within the tolerance {np.mean(errors <= TOLERANCE):.1%}, 95 % within {np.percentile(errors, 95):.2%}, "
        f"all within {errors.max():.1%}",
        flush=True,
    )


def print_cube() -> None:
    """Fluence in the middle of a dark ball in a cube."""
    inside = Region(sphere(10.0), Medium(sigma_a=0.05, sigma_s_prime=0.5, eta=1.37))
    body, medium = box((60.0, 60.0, 60.0)), Medium(sigma_a=0.002, sigma_s_prime=0.99, eta=1.37)
    beam = PencilBeam((0.0, 0.0, 50.0), (0.0, 0.0, -1.0))
    started = time.process_time()
    solution = solve(body, medium, [beam], regions=[inside], tolerance=None, volume_tolerance=0.03, cache=False)
    seconds = time.process_time() - started
    middle = np.zeros((1, 3))
    (value,), (error,) = solution.fluence_with_error(middle)
    print(
        f"cube: {len(solution.mesh.tetrahedra):,} tetrahedra, {seconds:.1f} s; estimated {solution.volume_error:.2%}; "
        f"in the middle {solution.fluence_at(middle)[0]:.5g}, by a dual of its own {value:.5g} ± {error:.2%}"
    )


def main() -> None:
    """Print a line for each scene, and one for the cube."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", type=int, default=[2, 4, 8, 10, 14, 16, 20, 22, 26])
    numbers = parser.parse_args().scenes
    if not all(number % 6 in BALLS for number in numbers):
        parser.error(f"scenes are balls and balls in balls: give numbers of remainder {BALLS[0]} or {BALLS[1]} by 6")
    for number in numbers:
        print_scene(number)
    print_cube()


if __name__ == "__main__":
    main()
