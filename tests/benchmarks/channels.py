"""What a second channel, a third and a second light cost: ``python -m tests.benchmarks.channels``.

Seconds from the triangle surface to the exitance, without the cache, the least of several runs; the rest as multiples.
"""

import time
from collections.abc import Callable, Sequence
from functools import partial

from tetlux.fem import CollimatedBeam, Light, Medium, PencilBeam, solve
from tetlux.meshing import sphere

RUNS = 4
# As different as red, green and blue are in skin or marble.
CHANNELS = [
    Medium(sigma_a=sigma_a, sigma_s_prime=sigma_s_prime, eta=1.4)
    for sigma_a, sigma_s_prime in ((0.01, 1.0), (0.02, 1.1), (0.005, 0.9))
]


def seconds(run: Callable[[], object]) -> float:
    """The least of several runs."""
    taken = []
    for _ in range(RUNS):
        started = time.perf_counter()
        run()
        taken.append(time.perf_counter() - started)
    return min(taken)


def main() -> None:
    """Print a row for each light."""
    ball = sphere(10.0)
    pencil, other = PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0)), PencilBeam((20.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    lights: dict[str, Sequence[Light]] = {"pencil": [pencil], "daylight": [CollimatedBeam((0.0, 0.0, -1.0))]}
    print("| light | one channel | two | three | with a second light |")
    print("|---|---|---|---|---|")
    for name, light in lights.items():
        one = seconds(partial(solve, ball, CHANNELS[0], light, cache=False))
        more = [seconds(partial(solve, ball, CHANNELS[:n], light, cache=False)) for n in (2, 3)]
        more.append(seconds(partial(solve, ball, CHANNELS[0], [*light, other], cache=False)))
        print(f"| {name} | {one:.2f} s | " + " | ".join(f"{each / one:.2f}" for each in more) + " |", flush=True)


if __name__ == "__main__":
    main()
