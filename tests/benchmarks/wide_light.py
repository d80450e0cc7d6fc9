"""Balls in a wide beam: cost and error. ``python -m tests.benchmarks.wide_light [SURFACE...]``.

Balls of radius 3 to 100 mean free paths, reduced albedo .99, at matched indices against the series; with index 1.4
against itself at half the tolerance, with `--refracted`. Further arguments are files of surfaces, 60 mean free paths
from corner to corner, lit from above, held against half the tolerance too; for these the mesher's mesh is cached.

Columns: nodes; seconds of the processor, of all threads, without imports and with the mesher's mesh from the cache;
relative L2 error of the exitance and its estimate; error of the exited power; and the largest error at any of 200
random points of the lit side (more than ten degrees from its rim), and at any point within four decades.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from tetlux.fem import CollimatedBeam, Medium, Solution, solve
from tetlux.fem.exact import sphere_light
from tetlux.meshing import Surface, read_surface, sphere, tetrahedralize
from tetlux.meshing.arrays import FloatArray

RUNS = ((3.0, 0.02), (7.0, 0.02), (10.0, 0.02), (10.0, 0.005), (30.0, 0.02), (100.0, 0.02))
POINTS = 200
DOWN = (0.0, 0.0, -1.0)
# Mean free paths from corner to corner of a surface that is read.
DIAGONAL = 60.0


def random_directions(count: int) -> FloatArray:
    """Unit vectors (count, 3)."""
    vectors = np.random.default_rng(0).standard_normal((count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def timed(surface: Surface, medium: Medium, tolerance: float) -> tuple[Solution, float]:
    """A solution, and the seconds of the processor that it took."""
    start = time.process_time()
    solution = solve(surface, medium, [CollimatedBeam(DOWN)], tolerance=tolerance)
    return solution, time.process_time() - start


def row(
    name: str, surface: Surface, medium: Medium, tolerance: float, truth: Callable[[FloatArray], FloatArray]
) -> tuple[str, float]:
    """One line of the table, and the exited power; `truth` gives the exitance at points of the surface (q, 3)."""
    solution, seconds = timed(surface, medium, tolerance)
    mesh = solution.mesh
    nodes, exact = mesh.boundary_points, truth(mesh.boundary_points)
    areas = mesh.boundary_node_areas
    error = float(np.sqrt(areas @ (solution.exitance - exact) ** 2 / (areas @ exact**2)))
    places, normals = surface.project(nodes.mean(axis=0) + surface.diagonal * random_directions(POINTS))
    there = truth(places)
    off = np.abs(solution.exitance_at(places) / there - 1.0)
    lit, seen = normals[:, 2] > np.sin(np.radians(10.0)), there > 1e-4 * there.max()
    line = f"{name:>18} {tolerance:6g} {len(mesh.points):7,} {seconds:6.2f} {error:8.2%} {solution.error_estimate:8.2%}"
    return f"{line} {off[lit].max():7.1%} {off[seen].max():7.1%}", solution.power.exited


def against_series(radius: float, tolerance: float) -> str:
    """A ball at matched indices."""
    medium, surface = Medium(sigma_a=0.01, sigma_s_prime=0.99, eta=1.0), sphere(radius)

    def truth(points: FloatArray) -> FloatArray:
        cosine = points[:, 2] / np.linalg.norm(points, axis=1)
        return sphere_light.beam_exitance(medium, radius=radius, gamma=np.arccos(np.clip(cosine, -1.0, 1.0)))

    line, exited = row(f"ball {radius:g}", surface, medium, tolerance, truth)
    return f"{line} {exited / sphere_light.beam_total(medium, radius=radius) - 1.0:8.2%}"


def against_finer(name: str, surface: Surface, medium: Medium, tolerance: float) -> str:
    """Any body, against a solution at half the tolerance."""
    finer, _ = timed(surface, medium, 0.5 * tolerance)
    line, exited = row(name, surface, medium, tolerance, lambda points: np.asarray(finer.exitance_at(points)))
    return f"{line} {exited / finer.power.exited - 1.0:8.2%}"


def lines(files: list[Path], *, refracted: bool) -> Iterator[str]:
    """The table."""
    yield f"{'':>18} {'tol.':>6} {'nodes':>7} {'s':>6} {'error':>8} {'estimate':>8} {'lit':>7} {'seen':>7} {'power':>8}"
    for radius, tolerance in RUNS:
        tetrahedralize(sphere(radius))  # now its mesh is cached
        yield against_series(radius, tolerance)
        if refracted:
            medium = Medium(sigma_a=0.01, sigma_s_prime=0.99, eta=1.4)
            yield against_finer(f"ball {radius:g}, 1.4", sphere(radius), medium, tolerance)
    for file in files:
        surface = read_surface(file)
        scale = DIAGONAL / surface.diagonal
        medium = Medium(sigma_a=0.01 * scale, sigma_s_prime=0.99 * scale, eta=1.4)
        yield against_finer(file.stem, surface, medium, 0.02)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("surfaces", nargs="*", type=Path)
    parser.add_argument("--refracted", action="store_true", help="also with index 1.4")
    arguments = parser.parse_args()
    for line in lines(arguments.surfaces, refracted=arguments.refracted):
        print(line, flush=True)
