"""Does the plan choose the fastest model? ``python -m tests.benchmarks.plans [SCENES] [SEED]``.

Random scenes are solved by their plan and by each model that suits, without the cache. Regret is the CPU seconds by the
plan over those of the fastest model that meets the tolerance, planning and vain trials included.
"""

import resource
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from tetlux.fem import CollimatedBeam, DiffuseLight, Disc, Light, Medium, PencilBeam, Region, plan, solve
from tetlux.meshing import Surface, box, cylinder, slab, sphere, torus

SCENES = int(sys.argv[1]) if len(sys.argv) > 1 else 20
SEED = int(sys.argv[2]) if len(sys.argv) > 2 else 1
# The plan's predictions are for one core, so that CPU seconds, also of the mesher's process, are compared.
Scene = tuple[Surface, Medium, list[Light], list[Region], float]


def random_scene(rng: np.random.Generator) -> Scene:
    """Draw a body of 10 to 60 mean free paths, a light on its top, sometimes a ball in it, and a tolerance."""
    size = float(np.exp(rng.uniform(np.log(10.0), np.log(60.0))))
    bodies = (
        sphere(0.5 * size),
        slab(2.0 * size, 0.4 * size),
        box((size, size, size)),
        cylinder(0.4 * size, size),
        torus(0.4 * size, 0.2 * size),
    )
    surface = bodies[int(rng.integers(len(bodies)))]
    x = 0.4 * size if surface is bodies[-1] else 0.1 * size
    top = float(surface.points[:, 2].max())
    down = (0.0, 0.0, -1.0)
    beam = PencilBeam((x, 0.0, top + 10.0), down)
    spot = CollimatedBeam(down, 1.0, spot=Disc((x, 0.0, top), 0.08 * size))
    kinds: Sequence[Light] = (beam, beam, spot, CollimatedBeam(down, 1.0), DiffuseLight(1.0))
    light = kinds[int(rng.integers(len(kinds)))]
    medium = Medium(sigma_a=float(np.exp(rng.uniform(np.log(1e-3), np.log(0.1)))), sigma_s_prime=1.0, eta=1.4)
    regions = []
    if rng.random() < 0.3:
        dark = Medium(sigma_a=0.2, sigma_s_prime=1.0, eta=1.4)
        regions = [Region(sphere(0.08 * size, center=(x, 0.0, top - 0.2 * size)), dark)]
    return surface, medium, [light], regions, float(rng.choice([0.05, 0.02, 0.01]))


def cpu_seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of some work in this process and the processes that it starts, and its result."""

    def now() -> float:
        return time.process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime

    started = now()
    found = work()
    return now() - started, found


def main() -> None:
    """Print a row for each scene, and what they are together."""
    solver: Any = solve
    rng, regrets, factors = np.random.default_rng(SEED), [], []
    print("| body | light | regions | tolerance | plan | predicted | measured | best | regret |")
    print("|---|---|---|---|---|---|---|---|---|")
    for _ in range(SCENES):
        surface, medium, lights, regions, tolerance = random_scene(rng)
        common: dict[str, Any] = {"regions": regions, "tolerance": tolerance, "cache": False}
        made = plan(surface, medium, lights, regions=regions, tolerance=tolerance)
        seconds, auto = cpu_seconds(partial(solver, surface, medium, lights, model="auto", **common))
        best, fastest = seconds, auto.model
        for candidate in made.candidates:
            if not candidate.suits or candidate.model == auto.model:
                continue
            options = {k: v for k, v in common.items() if k != "cache" or candidate.model in ("full", "truncated")}
            if candidate.model == "closed-form":
                del options["regions"]
            taken, found = cpu_seconds(partial(solver, surface, medium, lights, model=candidate.model, **options))
            negative = any(getattr(note, "code", "") == "exitance-negative" for note in found.warnings)
            if taken < best and found.error_estimate <= tolerance and not negative:
                best, fastest = taken, candidate.model
        regrets.append(seconds / best)
        factors.append(max(made.best.seconds / seconds, seconds / made.best.seconds))
        print(
            f"| {surface.name} | {type(lights[0]).__name__} | {len(regions)} | {tolerance:g} | {auto.model} | "
            f"{made.best.seconds:.2f} | {seconds:.2f} | {fastest} {best:.2f} | {regrets[-1]:.2f} |",
            flush=True,
        )
    print(f"regret: median {np.median(regrets):.2f}, 95 % {np.quantile(regrets, 0.95):.2f}")
    print(f"predicted within a factor of 2: {np.mean(np.array(factors) <= 2.0):.0%}")


if __name__ == "__main__":
    main()
