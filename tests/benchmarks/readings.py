"""Readings far from the light: are error bars honest, and tolerances met? ``python -m tests.benchmarks.readings``.

Without arguments: random scenes of ten detectors each, `--scenes` of them from number `--first` on, at a detector
tolerance of .01: see `tests.benchmarks.reading_scenes`; a source .3 to 10 mean free paths deep, detectors 1 to 40 away,
reduced albedo .8 to .9999, index 1 to 1.5. A line says for each scene the median and largest true error, the largest
bar, and how many readings are off by more than twice their bar or the tolerance. A truth that is no series may be off
by its own error, which is added to twice the bar. `--charges` solves by charges; `--even` draws scenes of one medium
only; `--each` prints every reading.

`--fibres` reads ten points 5 to 50 mm from a beam on a ball of radius 80 mm to 1 %. `--cube` is the fluence in the
middle of a dark ball in a cube. `--fits` fits absorption and scattering to ten noiseless readings of a ball. The first
and the last take `--charges` too. `--all` prints everything: these for finite elements and for charges, then random
scenes of both.

Seconds are of the processor, of all threads, from surface to readings; nothing is remembered.
"""

import argparse
import itertools
import time
from collections.abc import Iterable, Sequence

import numpy as np
from scipy.optimize import least_squares

from tests.benchmarks.reading_scenes import EACH, Scene, places_on_ball, random_scene
from tetlux.fem import ChargeSolution, Medium, PencilBeam, PointDetector, PointSource, Region, Solution, solve
from tetlux.fem.exact import sphere as exact_sphere
from tetlux.meshing import TetluxError, box, sphere
from tetlux.meshing.arrays import BoolArray, FloatArray

TOLERANCE = 0.01
# A truth that is no series, and less certain than this, is left out.
LEAST_CERTAIN = 0.003
# How meshes of fits are made.
FITS = ("kept mesh", "meshes made anew", "charges")


def measure(scene: Scene, tolerance: float, *, charges: bool = False) -> tuple[FloatArray, FloatArray, float, str]:
    """True relative errors and bars, seconds, and the size of the solution."""
    lights, regions = [PointSource(scene.source, 1.0)], scene.regions
    detectors = [PointDetector(tuple(place)) for place in scene.places.tolist()]
    started = time.process_time()
    solution: Solution | ChargeSolution
    if charges:
        solution = solve(
            scene.surface,
            scene.medium,
            lights,
            regions=regions,
            model="charges",
            tolerance=None,
            detectors=detectors,
            detector_tolerance=tolerance,
        )
    else:
        solution = solve(
            scene.surface,
            scene.medium,
            lights,
            regions=regions,
            tolerance=None,
            detectors=detectors,
            detector_tolerance=tolerance,
            cache=False,
        )
    seconds = time.process_time() - started
    errors = np.array([reading.exitance for reading in solution.readings]) / scene.truth - 1.0
    bars = np.array([reading.relative_error for reading in solution.readings], dtype=float)
    if isinstance(solution, ChargeSolution):
        size = f"{solution.charges} charges"
    else:
        size = f"{len(solution.mesh.tetrahedra):,}"
    return np.abs(errors), bars, seconds, size


def print_scenes(numbers: Iterable[int], tolerance: float, *, charges: bool, each: bool) -> None:
    """A line for each scene, and what all have in common."""
    errors, bars, uncertain = np.zeros(0), np.zeros(0), np.zeros(0)
    print("| scene | tetrahedra | seconds | median error | largest | largest bar | beyond 2 bars | beyond tolerance |")
    print("|---|---|---|---|---|---|---|---|")
    for number in numbers:
        name = str(number)
        try:
            scene = random_scene(number)
            name = f"{number} {scene.name}, albedo {scene.medium.albedo:.4f}"
            error, bar, seconds, size = measure(scene, tolerance, charges=charges)
        except TetluxError as failure:
            print(f"| {name} | {failure} |", flush=True)
            continue
        sure = scene.truth_error <= LEAST_CERTAIN
        error, bar, own = error[sure], bar[sure], scene.truth_error[sure]
        errors, bars, uncertain = np.append(errors, error), np.append(bars, bar), np.append(uncertain, own)
        off = "" if sure.all() else f" ({int((~sure).sum())} left out)"
        print(
            f"| {name}{off} | {size} | {seconds:.1f} | {np.median(error):.3%} | {error.max():.2%} | {bar.max():.2%} "
            f"| {int((error > 2 * bar + own).sum())} | {int((error > tolerance).sum())} |"
            if len(error)
            else f"| {name}{off} | {size} | {seconds:.1f} |",
            flush=True,
        )
        if each:
            for place, off_by, given in zip(scene.places[sure].tolist(), error, bar, strict=True):
                print(f"    {np.round(place, 2).tolist()}: error {off_by:.3%}, bar {given:.3%}")
    honest = errors <= 2 * bars + uncertain
    print(_summary(errors, bars, honest, tolerance))
    for least in (1e-4, 1e-3):
        beyond = errors > least
        if beyond.any():
            within = honest[beyond].mean()
            print(f"of {beyond.sum()} that are off by more than {least:g}: within twice the bar {within:.1%}")


def _summary(errors: FloatArray, bars: FloatArray, honest: BoolArray, tolerance: float) -> str:
    ratios = bars / np.maximum(errors, 1e-12)
    return (
        f"{len(errors)} readings: within twice the bar {honest.mean():.1%}, bar over error median "
        f"{np.median(ratios):.2f}, 5th and 95th percentile {np.percentile(ratios, 5):.2f}, "
        f"{np.percentile(ratios, 95):.1f}; within the tolerance of {tolerance:g}: {np.mean(errors <= tolerance):.1%}"
    )


def print_fibres(*, charges: bool) -> None:
    """Ten points on a ball."""
    radius, medium = 80.0, Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4)
    arcs = np.arange(5.0, 51.0, 5.0)
    gamma, places = places_on_ball(radius, arcs)
    depth = medium.mean_free_path
    truth = exact_sphere.point_exitance(medium, radius=radius, source_radius=radius - depth, gamma=gamma)
    scene = Scene("fibres", sphere(radius), medium, [], (0.0, 0.0, radius - depth), places, truth)
    error, bar, seconds, size = measure(scene, TOLERANCE, charges=charges)
    print(f"ten readings on a ball of 80 mm: {size}, {seconds:.1f} s")
    for arc, off, own in zip(arcs, error, bar, strict=True):
        print(f"  {arc:g} mm: error {off:.3%}, bar {own:.3%}")


def print_fits(how: str) -> None:
    """Absorption and scattering from ten readings of a ball, from a start a factor of two off."""
    radius, right = 20.0, np.array([0.012, 1.1])
    gamma, places = places_on_ball(radius, np.linspace(2.0, 20.0, EACH))
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
        solution: Solution | ChargeSolution
        if how == "charges":
            solution = solve(
                surface, medium, [beam], model="charges", tolerance=None, detectors=detectors, detector_tolerance=0.005
            )
        else:
            solution = solve(
                surface, medium, [beam], mesh=mesh, tolerance=None, detectors=detectors, detector_tolerance=0.005
            )
        return np.log([max(reading.exitance, 1e-300) for reading in solution.readings]) - given

    if how == "kept mesh":
        medium = Medium(sigma_a=start[0], sigma_s_prime=start[1], eta=1.4)
        mesh = solve(surface, medium, [beam], tolerance=None, detectors=detectors, detector_tolerance=0.005).mesh
    started = time.process_time()
    found = least_squares(residuals, np.log(start), diff_step=[0.02, 0.02], x_scale=1.0, xtol=1e-4)
    off = np.exp(found.x) / right - 1.0
    print(
        f"{how}: absorption {off[0]:+.2%}, scattering {off[1]:+.2%}, {found.nfev} steps, "
        f"{time.process_time() - started:.0f} s"
    )


def print_cube() -> None:
    """Fluence in the middle of a dark ball in a cube."""
    inside = Region(sphere(10.0), Medium(sigma_a=0.05, sigma_s_prime=0.5, eta=1.37))
    body, medium = box((60.0, 60.0, 60.0)), Medium(sigma_a=0.002, sigma_s_prime=0.99, eta=1.37)
    beam = PencilBeam((0.0, 0.0, 50.0), (0.0, 0.0, -1.0))
    wanted: tuple[tuple[float | None, float | None], ...] = ((0.02, None), (0.005, None), (None, 0.03))
    for tolerance, of_volume in wanted:
        started = time.process_time()
        solution = solve(body, medium, [beam], regions=[inside], tolerance=tolerance, volume_tolerance=of_volume)
        value, error = solution.fluence_with_error([[0.0, 0.0, 0.0]])
        print(
            f"tolerance {tolerance or f'{of_volume} of the volume'}: {value[0]:.5g} ± {error[0]:.2%} (linear elements "
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
    parser.add_argument("--charges", action="store_true")
    parser.add_argument("--even", action="store_true")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--each", action="store_true")
    given = parser.parse_args()
    if given.all:
        for charges in (False, True):
            print_fibres(charges=charges)
        print_cube()
        print_all_fits(FITS)
        _print_scenes(given, charges=False)
        _print_scenes(given, charges=True)
    elif given.fibres:
        print_fibres(charges=given.charges)
    elif given.cube:
        print_cube()
    elif given.fits:
        print_all_fits(FITS[-1:] if given.charges else FITS[:-1])
    else:
        _print_scenes(given, charges=given.charges)


def _print_scenes(given: argparse.Namespace, *, charges: bool) -> None:
    print(f"random scenes by {'charges' if charges else 'finite elements'}")
    # Two of six kinds have regions.
    numbers = (number for number in itertools.count(given.first) if not (given.even and number % 6 > 3))
    scenes = itertools.islice(numbers, given.scenes)
    print_scenes(scenes, given.tolerance, charges=charges, each=given.each)


def print_all_fits(ways: Sequence[str]) -> None:
    """Fits, one after another."""
    for how in ways:
        print_fits(how)


if __name__ == "__main__":
    main()
