"""What one more source on one mesh costs: ``python -m tests.benchmarks.many_sources``.

The first run is the sphere with one source, from its triangle surface and without the cache; then a hundred sources,
each on its own, on the mesh of that run.
"""

import time

import numpy as np

from tests.benchmarks.scenes import SCENES
from tetlux.fem import PointSource, System, solve

COUNT = 100


def main() -> None:
    """Print the seconds of the first run and of the hundredth source."""
    scene = SCENES["sphere"]("sphere")
    solve(scene.surface, scene.medium, [scene.light], cache=False)
    started = time.perf_counter()
    first = solve(scene.surface, scene.medium, [scene.light], cache=False)
    whole = time.perf_counter() - started
    outward = np.random.default_rng(0).normal(size=(COUNT, 3))
    outward *= (10.0 - 1.0 / 1.01) / np.linalg.norm(outward, axis=1, keepdims=True)
    system = System(first.mesh, scene.medium, scene.surface, expected=COUNT)
    seconds = []
    for x, y, z in outward.tolist():
        started = time.perf_counter()
        system.solve([PointSource((x, y, z))])
        seconds.append(time.perf_counter() - started)
    more = float(np.median(seconds[-10:]))
    print(f"first run {whole:.2f} s; sources 91 to 100: {more:.4f} s each, {more / whole:.1%} of that")
    print(f"({len(first.mesh.tetrahedra):,} tetrahedra; all hundred in {sum(seconds):.2f} s)")


if __name__ == "__main__":
    main()
