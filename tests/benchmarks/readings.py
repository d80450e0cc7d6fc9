"""Readings far from the light: are error bars honest, and tolerances met? ``python -m tests.benchmarks.readings``.

Without arguments: random scenes of ten detectors each, `--scenes` of them from number `--first` on, at a detector
tolerance of .01: a ball, a plate, a cylinder or a ball in a ball, a source .3 to 10 mean free paths deep, detectors 1
to 40 away, reduced albedo .8 to .9999, index 1 to 1.5; the truth is their series. A line says for each scene the median
and largest true error, the largest bar, and how many readings are off by more than twice their bar or the tolerance.

`--fibres` reads ten points 5 to 50 mm from a beam on a ball of radius 80 mm to 1 %. `--cube` is the fluence in the
middle of a dark ball in a cube. `--fits` fits absorption and scattering to ten noiseless readings of a ball.

Seconds are of the processor, of all threads, from surface to readings; nothing is remembered.
"""

import argparse
import time
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from tetlux.fem import Medium, PencilBeam, PointDetector, PointSource, Region, solve
from tetlux.fem.exact import cylinder as exact_cylinder
from tetlux.fem.exact import layered, layered_ball
from tetlux.fem.exact import sphere as exact_sphere
from tetlux.meshing import RunError, Surface, box, cylinder, slab, sphere
from tetlux.meshing.arrays import FloatArray

TOLERANCE = 0.01
EACH = 10
PLATE, ROD = 160.0, 200.0


@dataclass(frozen=True, eq=False)
class Scene:
    """A body, a source of unit power, places on the surface, and the exitance there."""

    name: str
    surface: Surface
    medium: Medium
    regions: list[Region]
    source: tuple[float, float, float]
    places: FloatArray
    truth: FloatArray


def random_scene(number: int) -> Scene:
    """A scene by its number, in mean free paths."""
    rng = np.random.default_rng(number)
    albedo, eta = 1.0 - 10.0 ** rng.uniform(-4.0, np.log10(0.2)), rng.uniform(1.0, 1.5)
    medium = Medium(sigma_a=1.0 - albedo, sigma_s_prime=albedo, eta=eta)
    depth, away = 10.0 ** rng.uniform(np.log10(0.3), 1.0), 10.0 ** rng.uniform(0.0, np.log10(40.0), EACH)
    make = (_ball, _plate, _rod, _ball_in_ball)[number % 4]
    return make(rng, medium, depth, away)


def _round(radius: float, away: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Angles from the pole, and places on a sphere."""
    gamma = np.minimum(away / radius, 0.99 * np.pi)
    return gamma, radius * np.column_stack([np.sin(gamma), 0.0 * gamma, np.cos(gamma)])


def _ball(rng: np.random.Generator, medium: Medium, depth: float, away: FloatArray) -> Scene:
    radius = rng.uniform(max(5.0, 1.2 * depth), 40.0)
    gamma, places = _round(radius, away)
    truth = exact_sphere.point_exitance(medium, radius=radius, source_radius=radius - depth, gamma=gamma)
    return Scene("ball", sphere(radius), medium, [], (0.0, 0.0, radius - depth), places, truth)


def _ball_in_ball(rng: np.random.Generator, medium: Medium, depth: float, away: FloatArray) -> Scene:
    radius = rng.uniform(max(8.0, 2.0 * depth), 30.0)
    inner = rng.uniform(0.3, 0.95) * (radius - 1.3 * depth)
    core = Medium(
        sigma_a=medium.sigma_a * 10.0 ** rng.uniform(-1.0, 1.0),
        sigma_s_prime=medium.sigma_s_prime * 10.0 ** rng.uniform(-0.5, 0.5),
        eta=medium.eta,
    )
    gamma, places = _round(radius, away)
    truth = layered_ball.point_exitance([core, medium], [inner, radius], source_radius=radius - depth, gamma=gamma)
    regions = [Region(sphere(inner), core)]
    return Scene("ball in a ball", sphere(radius), medium, regions, (0.0, 0.0, radius - depth), places, truth)


def _plate(rng: np.random.Generator, medium: Medium, depth: float, away: FloatArray) -> Scene:
    thickness, rho = rng.uniform(1.2 * depth + 1.0, 20.0), np.minimum(away, 25.0)
    back, angle = rng.random(EACH) < 0.3, rng.uniform(0.0, 2.0 * np.pi, EACH)
    places = np.column_stack([rho * np.cos(angle), rho * np.sin(angle), np.where(back, -thickness, 0.0)])
    front, rear = (
        layered.point_exitance([medium], [thickness], depth=depth, rho=rho, face=face) for face in ("front", "back")
    )
    truth = np.where(back, rear, front)
    return Scene("plate", slab(PLATE, thickness), medium, [], (0.0, 0.0, -depth), places, truth)


def _rod(rng: np.random.Generator, medium: Medium, depth: float, away: FloatArray) -> Scene:
    radius = rng.uniform(max(5.0, 1.3 * depth), 15.0)
    z, theta = away * rng.uniform(0.0, 1.0, EACH), np.minimum(away / radius, 3.1) * rng.uniform(0.0, 1.0, EACH)
    places = np.column_stack([radius * np.cos(theta), radius * np.sin(theta), z])
    truth = exact_cylinder.point_exitance(medium, radius=radius, source_radius=radius - depth, theta=theta, z=z)
    return Scene("cylinder", cylinder(radius, ROD), medium, [], (radius - depth, 0.0, 0.0), places, truth)


def measure(scene: Scene, tolerance: float) -> tuple[FloatArray, FloatArray, float, int]:
    """True relative errors and bars, seconds, and tetrahedra."""
    started = time.process_time()
    solution = solve(
        scene.surface,
        scene.medium,
        [PointSource(scene.source, 1.0)],
        regions=scene.regions,
        tolerance=None,
        detectors=[PointDetector(tuple(place)) for place in scene.places.tolist()],
        detector_tolerance=tolerance,
        cache=False,
    )
    seconds = time.process_time() - started
    errors = np.array([reading.exitance for reading in solution.readings]) / scene.truth - 1.0
    bars = np.array([reading.relative_error for reading in solution.readings], dtype=float)
    return np.abs(errors), bars, seconds, len(solution.mesh.tetrahedra)


def print_scenes(first: int, count: int, tolerance: float) -> None:
    """A line for each scene, and what all have in common."""
    errors, bars = np.zeros(0), np.zeros(0)
    print("| scene | tetrahedra | seconds | median error | largest | largest bar | beyond 2 bars | beyond tolerance |")
    print("|---|---|---|---|---|---|---|---|")
    for number in range(first, first + count):
        scene = random_scene(number)
        try:
            error, bar, seconds, tetrahedra = measure(scene, tolerance)
        except RunError as failure:
            print(f"| {number} {scene.name} | {failure} |")
            continue
        errors, bars = np.append(errors, error), np.append(bars, bar)
        name = f"{number} {scene.name}, albedo {scene.medium.albedo:.4f}"
        print(
            f"| {name} | {tetrahedra:,} | {seconds:.1f} | {np.median(error):.3%} | {error.max():.2%} | {bar.max():.2%} "
            f"| {int((error > 2 * bar).sum())} | {int((error > tolerance).sum())} |",
            flush=True,
        )
    ratios = bars / np.maximum(errors, 1e-12)
    print(
        f"{len(errors)} readings: within twice the bar {np.mean(errors <= 2 * bars):.1%}, bar over error median "
        f"{np.median(ratios):.2f}, 5th and 95th percentile {np.percentile(ratios, 5):.2f}, "
        f"{np.percentile(ratios, 95):.1f}; within the tolerance of {tolerance:g}: {np.mean(errors <= tolerance):.1%}"
    )


def print_fibres() -> None:
    """Ten points on a ball."""
    radius, medium = 80.0, Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4)
    arcs = np.arange(5.0, 51.0, 5.0)
    gamma, places = _round(radius, arcs)
    depth = medium.mean_free_path
    truth = exact_sphere.point_exitance(medium, radius=radius, source_radius=radius - depth, gamma=gamma)
    scene = Scene("fibres", sphere(radius), medium, [], (0.0, 0.0, radius - depth), places, truth)
    error, bar, seconds, tetrahedra = measure(scene, TOLERANCE)
    print(f"ten readings on a ball of 80 mm: {tetrahedra:,} tetrahedra, {seconds:.1f} s")
    for arc, off, own in zip(arcs, error, bar, strict=True):
        print(f"  {arc:g} mm: error {off:.3%}, bar {own:.3%}")


def print_fits(kept: bool) -> None:
    """Absorption and scattering from ten readings of a ball, from a start a factor of two off."""
    radius, right = 20.0, np.array([0.012, 1.1])
    gamma, places = _round(radius, np.linspace(2.0, 20.0, EACH))
    detectors = [PointDetector(tuple(place)) for place in places.tolist()]
    beam = PencilBeam((0.0, 0.0, 50.0), (0.0, 0.0, -1.0))

    def truth(sigma_a: float, sigma_s: float) -> FloatArray:
        medium = Medium(sigma_a=sigma_a, sigma_s_prime=sigma_s, eta=1.4)
        share = medium.albedo * (1.0 - (0.4 / 2.4) ** 2)
        depth = radius - medium.mean_free_path
        return share * exact_sphere.point_exitance(medium, radius=radius, source_radius=depth, gamma=gamma)

    given = np.log(truth(*right))
    start = right * np.array([2.0, 0.5])
    surface, mesh = sphere(radius), None

    def residuals(logarithms: FloatArray) -> FloatArray:
        sigma_a, sigma_s = np.exp(logarithms)
        medium = Medium(sigma_a=sigma_a, sigma_s_prime=sigma_s, eta=1.4)
        solution = solve(
            surface, medium, [beam], mesh=mesh, tolerance=None, detectors=detectors, detector_tolerance=0.005
        )
        return np.log([max(reading.exitance, 1e-300) for reading in solution.readings]) - given

    if kept:
        medium = Medium(sigma_a=start[0], sigma_s_prime=start[1], eta=1.4)
        mesh = solve(surface, medium, [beam], tolerance=None, detectors=detectors, detector_tolerance=0.005).mesh
    started = time.process_time()
    found = least_squares(residuals, np.log(start), diff_step=[0.02, 0.02], x_scale=1.0, xtol=1e-4)
    off = np.exp(found.x) / right - 1.0
    how = "kept mesh" if kept else "meshes made anew"
    print(
        f"{how}: absorption {off[0]:+.2%}, scattering {off[1]:+.2%}, {found.nfev} steps, "
        f"{time.process_time() - started:.0f} s"
    )


def print_cube() -> None:
    """Fluence in the middle of a dark ball in a cube."""
    inside = Region(sphere(10.0), Medium(sigma_a=0.05, sigma_s_prime=0.5, eta=1.37))
    body, medium = box((60.0, 60.0, 60.0)), Medium(sigma_a=0.002, sigma_s_prime=0.99, eta=1.37)
    beam = PencilBeam((0.0, 0.0, 50.0), (0.0, 0.0, -1.0))
    for tolerance in (0.02, 0.005):
        started = time.process_time()
        solution = solve(body, medium, [beam], regions=[inside], tolerance=tolerance)
        value, error = solution.fluence_with_error([[0.0, 0.0, 0.0]])
        print(
            f"tolerance {tolerance}: {value[0]:.5g} ± {error[0]:.2%} (linear elements "
            f"{solution.fluence_at(np.zeros((1, 3)))[0]:.5g}), {time.process_time() - started:.1f} s"
        )


def main() -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--tolerance", type=float, default=TOLERANCE)
    parser.add_argument("--fibres", action="store_true")
    parser.add_argument("--cube", action="store_true")
    parser.add_argument("--fits", action="store_true")
    given = parser.parse_args()
    if given.fibres:
        print_fibres()
    elif given.cube:
        print_cube()
    elif given.fits:
        print_fits(kept=True)
        print_fits(kept=False)
    else:
        print_scenes(given.first, given.scenes, given.tolerance)


if __name__ == "__main__":
    main()
