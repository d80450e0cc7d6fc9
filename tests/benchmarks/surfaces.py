"""Seconds from a triangle surface to the exitance: ``python -m tests.benchmarks.surfaces [FILE...]``.

Without files, the hare that ships and one of 100,000 triangles made of it. The beam comes from above, along z; bodies
are taken to be 60 mean free paths from corner to corner. Cold: no mesh is remembered; warm: it is.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tetlux.cases.shipped import library_folder
from tetlux.fem import Medium, PencilBeam, solve
from tetlux.meshing import Surface, read_surface
from tetlux.meshing.surface.subdivide import mark_longest_edges, number_triangle_edges, split_edges

ACROSS = 60.0


def refined(surface: Surface, faces: int) -> Surface:
    """A surface of at least so many triangles, its new vertices on the curved surface."""
    points, triangles, parents = surface.points, surface.faces, np.arange(len(surface.faces))
    flat = points
    while len(triangles) < faces:
        edges = ends, edge = number_triangle_edges(triangles)
        owner = np.empty(len(ends), dtype=np.int64)
        owner[edge.ravel()] = np.repeat(parents, 3)
        marked = mark_longest_edges(flat, edges, np.ones(len(ends), dtype=bool))
        flat, triangles, origin = split_edges(flat, triangles, edges, marked)
        points = np.vstack([points, surface.on_curve(owner[marked], flat[len(points) :])[0]])
        parents = parents[origin]
    return Surface(points, triangles, surface.unit, f"{surface.name}, refined")


def main() -> None:
    """Print a row for each surface."""
    given = [Path(argument) for argument in sys.argv[1:]]
    print("| surface | triangles | reading | cold | of which meshing | warm | tetrahedra | estimated error |")
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["TETLUX_CACHE_DIR"] = folder
        for path in given or [library_folder() / "hare.stl"]:
            started = time.perf_counter()
            surface = read_surface(path)
            report(surface, f"{time.perf_counter() - started:.2f} s")
        if not given:
            report(refined(surface, 100_000), "-")


def report(surface: Surface, reading: str) -> None:
    """Solve twice, and print a row."""
    scale = ACROSS / surface.diagonal
    medium = Medium(sigma_a=0.01 * scale, sigma_s_prime=scale, eta=1.4)
    x, y, z = surface.points[surface.points[:, 2].argmax()].tolist()
    start = (x, y, z + surface.diagonal)
    u, v, w = (surface.points.mean(axis=0) - start).tolist()
    seconds, meshing = [], []
    for _ in range(2):
        started = time.perf_counter()
        solution = solve(surface, medium, [PencilBeam(start, (u, v, w))])
        seconds.append(time.perf_counter() - started)
        meshing.append(solution.seconds["mesh"])
    print(
        f"| {surface.name} | {len(surface.faces):,} | {reading} | {seconds[0]:.2f} s | {meshing[0]:.2f} s "
        f"| {seconds[1]:.2f} s | {len(solution.mesh.tetrahedra):,} | {solution.error_estimate:.2%} |",
        flush=True,
    )


if __name__ == "__main__":
    main()
