"""What a part of a body saves beside the whole: ``python -m tests.benchmarks.truncation FILE [HEIGHT]``.

A surface, for instance a scan, is scaled to HEIGHT (300 mm) and lit from the front by a laser pointer: as a wide spot,
as a narrow beam above a dark ball, and as a wide spot above it, so that finite elements are needed. Each is
solved on the part that light reaches and on the whole body, and the exitance of both compared on the surface. Seconds
are of the processor, of this process and of the mesher's, from a surface whose trees are built; nothing is cached. With
one core for the mesher and one thread (``OPENBLAS_NUM_THREADS=1``) they are those of a clock.
"""

import argparse
from functools import partial

import numpy as np

from tests.benchmarks.plans import cpu_seconds
from tetlux.fem import CollimatedBeam, Disc, Light, Medium, PencilBeam, Region, plan, solve
from tetlux.meshing import Surface, read_surface, sphere
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.repair.pipeline import surface_from_arrays

SKIN = Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4)
DARK = Medium(sigma_a=0.2, sigma_s_prime=1.0, eta=1.4)
# Radius of the wide spot and of the ball, and the depth of its middle, mm.
SPOT, BALL, DEPTH = 4.0, 5.0, 8.0


def scenes(surface: Surface) -> list[tuple[str, Light, list[Region]]]:
    """Lights and regions at the place that a ray through the middle of the body meets first."""
    top, down = _front(surface)
    ball = Region(sphere(BALL, center=tuple((top + DEPTH * down).tolist())), DARK)
    direction = (float(down[0]), float(down[1]), float(down[2]))
    start = top - 50.0 * down
    beam = PencilBeam((float(start[0]), float(start[1]), float(start[2])), direction)
    spot = CollimatedBeam(direction, 1.0, spot=Disc((float(top[0]), float(top[1]), float(top[2])), SPOT))
    return [("wide spot", spot, []), ("pointer, ball in it", beam, [ball]), ("wide spot, ball in it", spot, [ball])]


def _front(surface: Surface) -> tuple[FloatArray, FloatArray]:
    """Where a ray along the shortest side of the body's box meets it, and its direction."""
    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    down = -np.eye(3)[int((high - low).argmin())]
    start = 0.5 * (low + high) - surface.diagonal * down
    distance = float(surface.rays.first(start[None], down[None])[0][0])
    return start + distance * down, down


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file")
    parser.add_argument("height", type=float, nargs="?", default=300.0)
    given = parser.parse_args()
    read = read_surface(given.file)
    size = np.ptp(read.points, axis=0).max()
    surface = surface_from_arrays(read.points * (given.height / size), read.faces, name=read.name)
    print(
        "| light | triangles | cut out | seconds, part | whole | share | predicted, part | whole | "
        "estimate, part | whole | apart |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for name, light, regions in scenes(surface):
        made = plan(surface, SKIN, [light], regions=regions)
        surface.rays.first(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))
        surface.project(surface.points[:1])
        taken, part = cpu_seconds(
            partial(solve, surface, SKIN, [light], regions=regions, model="truncated", cache=False)
        )
        whole_taken, whole = cpu_seconds(partial(solve, surface, SKIN, [light], regions=regions, cache=False))
        places, roots = whole.mesh.points[whole.mesh.boundary_faces].mean(axis=1), np.sqrt(whole.mesh.boundary_areas)
        first, second = roots * part.exitance_at(places), roots * whole.exitance_at(places)
        apart = float(np.linalg.norm(first - second) / np.linalg.norm(second))
        print(
            f"| {name} | {len(surface.faces):,} | {len(part.part.surface.faces):,} | {taken:.2f} | {whole_taken:.2f} | "
            f"{taken / whole_taken:.2f} | {made['truncated'].seconds:.2f} | {made['full'].seconds:.2f} | "
            f"{part.error_estimate:.2%} | {whole.error_estimate:.2%} | {apart:.2%} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
