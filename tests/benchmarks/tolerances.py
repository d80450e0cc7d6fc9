"""Is the tolerance met, and at what cost? ``python -m tests.benchmarks.tolerances [TOLERANCE...]``.

For scenes with a closed form: seconds from the triangle surface to the exitance, without the cache, the true error,
and the estimate. Below each scene, the exponent with which nodes grow as the tolerance shrinks.
"""

import sys
import time

import numpy as np

from tests.benchmarks.scenes import SCENES
from tetlux.fem import solve

TOLERANCES = [float(argument) for argument in sys.argv[1:]] or [0.05, 0.02, 0.01, 0.005]


def main() -> None:
    """Print a row for each scene and tolerance."""
    print("| scene | tolerance | seconds | of which meshing | nodes | true error | estimated | ratio | exited power |")
    print("|---|---|---|---|---|---|---|---|---|")
    warm = SCENES["sphere"]("sphere")
    solve(warm.surface, warm.medium, [warm.light], cache=False)
    for name, make in SCENES.items():
        scene = make(name)
        nodes = []
        for tolerance in TOLERANCES:
            started = time.perf_counter()
            solution = solve(scene.surface, scene.medium, [scene.light], tolerance=tolerance, cache=False)
            seconds = time.perf_counter() - started
            error, estimate = scene.error(solution), solution.error_estimate
            nodes.append(len(solution.mesh.points))
            print(
                f"| {name} | {tolerance:g} | {seconds:.2f} | {solution.seconds['mesh']:.2f} | {nodes[-1]:,} | "
                f"{error:.3%}{'' if error <= tolerance else ' (missed)'} | {estimate:.3%} | {estimate / error:.2f} | "
                f"{solution.power.exited:.5f} |",
                flush=True,
            )
        if len(nodes) > 2:
            slope = np.polyfit(np.log(TOLERANCES), np.log(nodes), 1)[0]
            print(f"| {name} | | | | nodes ~ tolerance^{slope:.2f} | | | | |")


if __name__ == "__main__":
    main()
