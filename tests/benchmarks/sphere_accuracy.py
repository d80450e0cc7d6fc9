"""Error and seconds on the sphere that has a closed form: ``python tests/benchmarks/sphere_accuracy.py``.

Radius 10, sigma_a 0.01, sigma_s' 1, eta 1.4, an isotropic point one mean free path below the pole. The whole
time is from the triangle surface to the exitance; the error is the relative L2 error of the exitance over
the surface against the series, and of the exited power against 0.790950.
"""

import sys
import time

import numpy as np

from tetlux.fem import Medium, PointSource, solve
from tetlux.fem.exact import sphere as exact
from tetlux.meshing import sphere

TOLERANCES = [float(argument) for argument in sys.argv[1:]] or [0.1, 0.02, 0.01]


def main() -> None:
    """Print a row for each tolerance."""
    medium = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    surface, source_radius = sphere(10.0), 10.0 - medium.mean_free_path
    total = exact.point_total(medium, radius=10.0, source_radius=source_radius)
    print("| tolerance | tetrahedra | seconds | true error | estimated | exited power |")
    print("|---|---|---|---|---|---|")
    for tolerance in TOLERANCES:
        started = time.perf_counter()
        solution = solve(surface, medium, [PointSource((0.0, 0.0, source_radius))], tolerance=tolerance)
        seconds = time.perf_counter() - started
        points, weights = solution.mesh.boundary_points, solution.mesh.boundary_node_areas
        gamma = np.arccos(np.clip(points[:, 2] / np.linalg.norm(points, axis=1), -1.0, 1.0))
        truth = exact.point_exitance(medium, radius=10.0, source_radius=source_radius, gamma=gamma)
        error = np.sqrt((weights @ (solution.exitance - truth) ** 2) / (weights @ truth**2))
        print(
            f"| {tolerance:g} | {len(solution.mesh.tetrahedra):,} | {seconds:.1f} | {error:.2%} | "
            f"{solution.error_estimate:.2%} | {solution.power.exited / total - 1:+.2%} |"
        )


if __name__ == "__main__":
    main()
