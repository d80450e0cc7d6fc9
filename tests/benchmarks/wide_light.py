"""What light that covers a body costs, and its error: ``python -m tests.benchmarks.wide_light [RADIUS...]``.

Balls in an index-matched parallel beam (sigma_a .01, sigma_s' 1 1/mm), at tolerances of .02 and .005, against their
series: nodes, CPU seconds from a surface to its exitance with the mesher's mesh in the cache, the relative L2 error of
the exitance and its estimate, that of the exited power, and the largest relative errors at 200 random points of the lit
side, and at those within four decades of the brightest. To compare with another commit, run this file in its worktree.
"""

import sys
import time

import numpy as np

from tetlux.fem import CollimatedBeam, Medium, solve
from tetlux.fem.exact.sphere_light import beam_exitance, beam_total
from tetlux.meshing import sphere
from tetlux.meshing.mesher.api import tetrahedralize

RADII, TOLERANCES, POINTS, SEED = (3.0, 7.0, 10.0, 30.0, 100.0), (0.02, 0.005), 200, 3
# At a tolerance of .005 larger balls take minutes.
LARGEST_AT_LEAST_TOLERANCE = 10.0


def print_ball(radius: float, tolerance: float) -> None:
    """Print the row of a ball."""
    medium, ball = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.0), sphere(radius)
    tetrahedralize(ball)
    started = time.process_time()
    beam = CollimatedBeam(direction=(0.0, 0.0, -1.0), irradiance=1.0)
    solution = solve(ball, medium, [beam], tolerance=tolerance)
    seconds = time.process_time() - started
    directions = np.random.default_rng(SEED).normal(size=(20 * POINTS, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    exact = beam_exitance(medium, radius=radius, gamma=np.arccos(directions[:, 2]))
    found = solution.exitance_at(radius * directions)
    error = np.linalg.norm(found - exact) / np.linalg.norm(exact)
    power = solution.power.exited / beam_total(medium, radius=radius) - 1.0
    relative = np.abs(found / exact - 1.0)[:POINTS]
    lit, seen = directions[:POINTS, 2] > 0, exact[:POINTS] > 1e-4 * exact.max()
    print(
        f"| {radius:g} | {tolerance:g} | {len(solution.mesh.points):,} | {seconds:.1f} | {error:.2%} | "
        f"{solution.error_estimate:.2%} | {power:+.2%} | {relative[lit].max():.1%} | {relative[seen].max():.1%} |",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    print("| radius, mm | tolerance | nodes | CPU s | error | estimate | power | lit side | four decades |")
    print("|---|---|---|---|---|---|---|---|---|")
    for tolerance in TOLERANCES:
        for radius in [float(each) for each in sys.argv[1:]] or RADII:
            if tolerance > min(TOLERANCES) or radius <= LARGEST_AT_LEAST_TOLERANCE:
                print_ball(radius, tolerance)


if __name__ == "__main__":
    main()
