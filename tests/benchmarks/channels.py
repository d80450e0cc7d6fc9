"""What a second channel, a third and a second light cost: ``python -m tests.benchmarks.channels``.

Seconds from the triangle surface to the exitance, and what more is solved for, as multiples of that. All are the least
of several runs, taken in turn. The first is with a new mesh each time; the others go on from one, since no two of the
mesher's meshes take the same time. The second light is a pencil beam where the mesh is fine, beside a pencil beam one
from another side, and beside light from all sides more of that: it needs no finer mesh than the first.
"""

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from tetlux.fem import CollimatedBeam, DiffuseLight, Disc, EnvironmentLight, Image, Light, Medium, PencilBeam, solve
from tetlux.meshing import sphere

RUNS = 10
# The first is the one that needs the finest mesh.
CHANNELS = [
    Medium(sigma_a=sigma_a, sigma_s_prime=sigma_s_prime, eta=1.4)
    for sigma_a, sigma_s_prime in ((0.02, 1.1), (0.01, 1.0), (0.005, 0.9))
]
DOWN = (0.0, 0.0, -1.0)
PENCIL, OTHER = PencilBeam((0.0, 0.0, 20.0), DOWN), PencilBeam((20.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
NOISE = np.random.default_rng(0)
LIGHTS: dict[str, Light] = {
    "pencil": PENCIL,
    "daylight": CollimatedBeam(DOWN),
    "even light": DiffuseLight(1.0),
    "a sky": EnvironmentLight(NOISE.random((32, 64))),
    "a round spot": CollimatedBeam(DOWN, spot=Disc((0.0, 0.0, 20.0), 4.0)),
    "an image": CollimatedBeam(DOWN, spot=Image((0.0, 0.0, 20.0), 12.0, NOISE.random((64, 64)))),
}


def least(runs: Sequence[Callable[[], object]]) -> list[float]:
    """The least seconds that each of these takes, taken in turn."""
    taken = np.full(len(runs), np.inf)
    for _ in range(RUNS):
        for number, run in enumerate(runs):
            started = time.perf_counter()
            run()
            taken[number] = min(taken[number], time.perf_counter() - started)
    return list(map(float, taken))


def main() -> None:
    """Print a row for each light."""
    ball = sphere(10.0)
    print("| light | one channel | two | three | with a second light |")
    print("|---|---|---|---|---|")
    for name, light in LIGHTS.items():
        scenes: list[tuple[list[Medium], list[Light]]] = [(CHANNELS[:n], [light]) for n in (1, 2, 3)]
        even = isinstance(light, DiffuseLight | EnvironmentLight)
        second = DiffuseLight(0.5) if even else OTHER if light is PENCIL else PENCIL
        scenes.append((CHANNELS[:1], [light, second]))
        with tempfile.TemporaryDirectory() as meshes:
            os.environ["TETLUX_CACHE_DIR"] = meshes
            runs = [partial(solve, ball, *scene) for scene in scenes]
            for run in runs:
                run()
            whole, *times = least([partial(solve, ball, *scenes[0], cache=False), *runs])
        costs = [1.0 + (more - times[0]) / whole for more in times[1:]]
        print(f"| {name} | {whole:.2f} s | " + " | ".join(f"{cost:.2f}" for cost in costs) + " |", flush=True)


if __name__ == "__main__":
    main()
