"""What light that covers a body costs, and its error: ``python -m tests.benchmarks.wide_light [RADIUS...]``.

Balls in an index-matched parallel beam (sigma_a .01, sigma_s' 1 1/mm), at tolerances of .02 and .005, against their
series: nodes, CPU seconds from a surface to its exitance with the mesher's mesh in the cache, the relative L2 error of
the exitance and its estimate, that of the exited power, and the largest relative errors at points of the lit side, and
where it is within four decades of the brightest, of 200 all over the ball. To compare with another commit, run this
file in its worktree.
"""

import sys
import time

import numpy as np

from tests.benchmarks.scenes import SAMPLES, lit_ball
from tetlux.fem import Medium, solve
from tetlux.fem.exact.sphere_light import beam_total
from tetlux.meshing.mesher.api import tetrahedralize

RADII, TOLERANCES, POINTS = (3.0, 7.0, 10.0, 30.0, 100.0), (0.02, 0.005), 200
# At a tolerance of .005 larger balls take minutes.
LARGEST_AT_LEAST_TOLERANCE = 10.0


def print_ball(radius: float, tolerance: float) -> None:
    """Print the row of a ball."""
    ball = lit_ball("", Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.0), radius=radius)
    tetrahedralize(ball.surface)
    started = time.process_time()
    solution = solve(ball.surface, ball.medium, [ball.light], tolerance=tolerance)
    seconds = time.process_time() - started
    power = solution.power.exited / beam_total(ball.medium, radius=radius) - 1.0
    some, truth = ball.points[:: SAMPLES // POINTS], ball.truth[:: SAMPLES // POINTS]
    relative = np.abs(solution.exitance_at(some) / truth - 1.0)
    lit, seen = some[:, 2] > 0, truth > 1e-4 * truth.max()
    print(
        f"| {radius:g} | {tolerance:g} | {len(solution.mesh.points):,} | {seconds:.1f} | {ball.error(solution):.2%} | "
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
