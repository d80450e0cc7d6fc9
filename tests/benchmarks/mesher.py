"""CPU seconds of the mesher, its process included: ``python -m tests.benchmarks.mesher``.

Nested bodies with thin layers, and a ball with a second one that it shares an edge with, beside the plain ball. No mesh
is remembered. A row gives the worst of the regions: the change of its volume against its surfaces', and the two-sided
distance between the mesh and an inner surface.
"""

import os
from collections.abc import Sequence

import numpy as np

from tetlux.meshing import Surface, TetMesh, sphere, surface_from_arrays, tetrahedralize
from tetlux.meshing.mesher.deviation import surface_deviation
from tetlux.meshing.repair.topology import compact
from tetlux.meshing.tets.nesting import nesting
from tetlux.meshing.tets.regions import own_volumes


def ellipsoid(*radii: float) -> Surface:
    """An ellipsoid about the origin, of 5,120 triangles."""
    ball = sphere(1.0)
    return surface_from_arrays(ball.points * radii, ball.faces, name="ellipsoid")


def pinched(radius: float) -> Surface:
    """Two balls that share an edge."""
    ball = sphere(radius)
    middle = ball.points[ball.faces[7, :2]].mean(axis=0)
    normal = middle / np.linalg.norm(middle)
    image = ball.points - 2.0 * ((ball.points - middle) @ normal)[:, None] * normal
    faces = np.concatenate([ball.faces, ball.faces[:, ::-1] + len(image)])
    return surface_from_arrays(np.concatenate([ball.points, image]), faces, name="two balls")


def cpu_seconds() -> float:
    """Of this process and of its children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def worst_deviation(mesh: TetMesh, surface: Surface, regions: Sequence[Surface]) -> float:
    """Largest distance, unit, between a surface of the scene and the mesh's."""
    lie = nesting(surface, regions)
    found = [surface_deviation(mesh, surface)]
    for i, inner in enumerate(regions, 1):
        held = mesh.tetrahedra[np.isin(mesh.regions, lie.within(i))]
        found.append(surface_deviation(TetMesh(*compact(mesh.points, held)), inner))
    return max(found)


def report(name: str, surface: Surface, regions: Sequence[Surface] = ()) -> None:
    """Mesh once, and print a row."""
    started = cpu_seconds()
    mesh = tetrahedralize(surface, regions, cache=False)
    seconds = cpu_seconds() - started
    volumes = np.bincount(mesh.regions, mesh.volumes, len(regions) + 1)
    change = volumes / own_volumes(surface, tuple(regions)) - 1.0
    print(
        f"| {name} | {seconds:.1f} | {len(mesh.tetrahedra):,} | {mesh.quality.min():.2f} "
        f"| {change[np.abs(change).argmax()]:+.1%} | {worst_deviation(mesh, surface, regions):.2f} |",
        flush=True,
    )


def main() -> None:
    """Print a row for each scene."""
    print("| scene | CPU seconds | tetrahedra | worst quality | volume | deviation |")
    print("|---|---|---|---|---|---|")
    report("ball", sphere(10.0))
    report("two balls that share an edge", pinched(10.0))
    report("four spheres", sphere(40.0), [sphere(r) for r in (36.0, 34.0, 30.0)])
    report("three ellipsoids", ellipsoid(40, 36, 34), [ellipsoid(35, 31, 29), ellipsoid(25, 21, 19)])
    report("head of four layers", sphere(36.8), [sphere(r) for r in (34.8, 32.0, 31.2)])


if __name__ == "__main__":
    main()
