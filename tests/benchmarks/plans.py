"""Does the plan choose the fastest model? ``python -m tests.benchmarks.plans FILE [FIRST LAST]``.

Random scenes FIRST to LAST (0 to 200) are solved by their plan, and by each other model that suits and is not predicted
to take more than `HOPELESS` times as long; a row of JSON for each is appended to FILE, which is read again: begun once
more, the benchmark goes on, and it ends after `MOST_SECONDS`, or as many as ``TETLUX_MOST_SECONDS`` says. Regret is CPU
seconds by the plan over those of the fastest model that meets the tolerance, planning and vain trials included. Of
every `CHECKED`-th scene all models are run, and differences of their exitance held against what they say of their
errors.

The plan learns from the scenes before, in a directory beside FILE, as it does on a user's machine; no mesh is kept.
What it would have predicted without is printed too.
"""

import json
import os
import resource
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tetlux.fem import CollimatedBeam, DiffuseLight, Disc, Light, Medium, PencilBeam, Region, plan, solve
from tetlux.fem.outcome.plan import Plan
from tetlux.fem.planner.costs import FILE, SWITCH
from tetlux.meshing import Surface, box, cylinder, read_surface, slab, sphere, torus
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.repair.pipeline import surface_from_arrays

HOPELESS, MOST_SECONDS, CHECKED = 8.0, 270.0, 5
# Seconds by which a prediction may be off in any case.
NEGLIGIBLE = 0.02
# The plan's predictions are for one core, so that CPU seconds, also of the mesher's process, are compared.
HARE = Path(__file__).parents[2] / "cases" / "library" / "hare.stl"
Scene = tuple[Surface, Medium, list[Light], list[Region], float]


def random_scene(rng: np.random.Generator) -> Scene:
    """Draw a body, a light on its top, sometimes a ball in it, and a tolerance.

    The body is 10 to 60 mean free paths wide, and up to 200 for lights that do not enter everywhere.
    """
    kind = int(rng.integers(5))
    size = float(np.exp(rng.uniform(np.log(10.0), np.log(200.0 if kind < 3 else 60.0))))
    bodies = (
        sphere(0.5 * size),
        slab(2.0 * size, 0.4 * size),
        box((size, size, size)),
        cylinder(0.4 * size, size),
        torus(0.4 * size, 0.2 * size),
        _hare(size),
    )
    surface = bodies[int(rng.integers(len(bodies)))]
    x = 0.4 * size if surface is bodies[-2] else 0.0 if surface is bodies[-1] else 0.1 * size
    top = float(surface.points[:, 2].max())
    if surface is bodies[-1]:
        # Where light from above meets it, below its ears.
        top -= float(surface.rays.first(np.array([[x, 0.0, top]]), np.array([[0.0, 0.0, -1.0]]))[0][0])
    down = (0.0, 0.0, -1.0)
    beam = PencilBeam((x, 0.0, top + size), down)
    spot = CollimatedBeam(down, 1.0, spot=Disc((x, 0.0, top), 0.08 * size))
    kinds: Sequence[Light] = (beam, beam, spot, CollimatedBeam(down, 1.0), DiffuseLight(1.0))
    light = kinds[kind]
    medium = Medium(sigma_a=float(np.exp(rng.uniform(np.log(1e-3), np.log(0.1)))), sigma_s_prime=1.0, eta=1.4)
    regions = []
    if rng.random() < 0.3:
        dark = Medium(sigma_a=0.2, sigma_s_prime=1.0, eta=1.4)
        regions = [Region(sphere(0.08 * size, center=(x, 0.0, top - 0.2 * size)), dark)]
    return surface, medium, [light], regions, float(rng.choice([0.05, 0.02, 0.01]))


def _hare(size: float) -> Surface:
    """A scan, `size` from corner to corner, with the middle of its box at the origin."""
    hare = read_surface(HARE)
    middle = 0.5 * (hare.points.min(axis=0) + hare.points.max(axis=0))
    return surface_from_arrays((hare.points - middle) * (size / hare.diagonal), hare.faces, name="hare")


def cpu_seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of some work in this process and the processes that it starts, and its result."""

    def now() -> float:
        return time.process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime

    started = now()
    found = work()
    return now() - started, found


def measure(number: int) -> dict[str, Any]:
    """Solve a scene by its plan and by other models that suit, and return what they took and were off by."""
    surface, medium, lights, regions, tolerance = random_scene(np.random.default_rng([1, number]))
    planner = partial(plan, surface, medium, lights, regions=regions, tolerance=tolerance)
    # What is made of a surface once, and needed by any solve, counts as solving.
    built_in = _plan_without_learning(planner)
    planning, made = cpu_seconds(planner)
    runs: dict[str, Any] = {}
    taken, auto = _solve(surface, medium, lights, regions, tolerance, "auto")
    runs["auto"] = _figures(taken, auto, tolerance)
    differences = []
    for each in made.candidates:
        is_hopeless = each.seconds > HOPELESS * max(taken, made.best.seconds) and number % CHECKED
        if not each.suits or each.model == auto.model or is_hopeless:
            continue
        seconds, found = _solve(surface, medium, lights, regions, tolerance, each.model)
        runs[each.model] = _figures(seconds, found, tolerance)
        difference = _difference(auto, found)
        if difference is not None:
            differences.append(difference / (auto.error_estimate + found.error_estimate))
    best = min(run["seconds"] for name, run in runs.items() if name == "auto" or run["meets"])
    return {
        "scene": number,
        "body": surface.name,
        "light": type(lights[0]).__name__,
        "regions": len(regions),
        "sigma_a": medium.sigma_a,
        "size": surface.diagonal,
        "tolerance": tolerance,
        "chosen": auto.model,
        "tried": auto.model != made.chosen,
        "kind": made.best.kind,
        "predicted": {each.model: each.seconds for each in made.candidates if each.suits},
        "built_in": {each.model: each.seconds for each in built_in.candidates if each.suits},
        "reasons": {each.model: each.reason for each in made.candidates},
        "planning": planning,
        "runs": runs,
        "regret": taken / best,
        "differences": differences,
    }


def _plan_without_learning(planner: Callable[[], Plan]) -> Plan:
    os.environ[SWITCH] = "0"
    try:
        return planner()
    finally:
        del os.environ[SWITCH]


def _difference(one: Any, other: Any) -> float | None:
    """Relative L2 difference of the exitance of two solutions on the facets of a mesh, which is fine near the light."""
    mesh = one.mesh if one.mesh is not None else other.mesh
    if mesh is None:
        return None
    places = mesh.points[mesh.boundary_faces].mean(axis=1)
    roots = np.sqrt(mesh.boundary_areas)
    first, second = roots * one.exitance_at(places), roots * other.exitance_at(places)
    return float(np.linalg.norm(first - second) / np.linalg.norm(first))


def _solve(
    surface: Surface, medium: Medium, lights: list[Light], regions: list[Region], tolerance: float, model: str
) -> tuple[float, Any]:
    options: dict[str, Any] = {"tolerance": tolerance}
    if model != "closed-form":
        options["regions"] = regions
    # What is learned is kept where meshes are.
    if model in ("full", "truncated"):
        options["cache"] = False
    solver: Any = solve
    return cpu_seconds(partial(solver, surface, medium, lights, model=model, **options))


def _figures(seconds: float, found: Any, tolerance: float) -> dict[str, Any]:
    """What a run took, and whether it meets the tolerance, misses it silently, or is below zero somewhere."""
    codes = {getattr(note, "code", "") for note in found.warnings}
    within = bool(found.error_estimate <= tolerance)
    return {
        "seconds": seconds,
        "error": found.error_estimate,
        "meets": within and "exitance-negative" not in codes,
        "silent": not within and "tolerance-missed" not in codes,
    }


def report(rows: Sequence[dict[str, Any]]) -> None:
    """Print what all rows are together."""
    regrets = np.array([row["regret"] for row in rows])
    taken = np.array([row["runs"]["auto"]["seconds"] for row in rows])
    planning = np.array([row["planning"] for row in rows])
    differences = np.array([each for row in rows for each in row["differences"]])
    print(f"{len(rows)} scenes; regret: median {np.median(regrets):.2f}, 95 % {np.quantile(regrets, 0.95):.2f}")
    for name, label in (("predicted", "as learned"), ("built_in", "built in")):
        ratios = np.array([min(row[name].values()) for row in rows]) / taken
        print(f"predicted {label} within a factor of 2: {_share_within(ratios, taken)} of {len(rows)} scenes,")
        print(f"  seconds predicted over seconds taken: {np.quantile(ratios, [0.05, 0.5, 0.95]).round(2)}")
    print(f"tried in vain first: {sum(row['tried'] for row in rows)}")
    print(f"planning at most 5 % of the run or 20 ms: {np.mean(planning <= np.maximum(0.05 * taken, 0.02)):.0%}")
    print(f"tolerance missed silently: {sum(row['runs']['auto']['silent'] for row in rows)}")
    print(f"two models differ by more than both errors: {np.mean(differences > 1.0):.1%} of {len(differences)}")
    for row in sorted(rows, key=lambda row: -row["regret"])[:10]:
        runs = ", ".join(f"{name} {run['seconds']:.2f} s" for name, run in row["runs"].items())
        print(f"  {row['scene']}: regret {row['regret']:.2f}, {row['body']}, {row['light']}, {row['chosen']}: {runs}")


def _share_within(ratios: FloatArray, taken: FloatArray) -> str:
    """How many predictions are within a factor of 2, or within `NEGLIGIBLE` seconds."""
    within = (np.maximum(ratios, 1.0 / ratios) <= 2.0) | (np.abs(ratios - 1.0) * taken <= NEGLIGIBLE)
    return f"{within.mean():.0%}"


def main() -> None:
    """Measure what the file does not have yet, and print what all of it amounts to."""
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        sys.exit("set OPENBLAS_NUM_THREADS=1: threads that wait for each other count as CPU seconds")
    file, end = Path(sys.argv[1]), time.monotonic() + float(os.environ.get("TETLUX_MOST_SECONDS", MOST_SECONDS))
    first, last = (int(sys.argv[2]), int(sys.argv[3])) if len(sys.argv) > 3 else (0, 200)
    learned = file.with_suffix(".learned")
    os.environ["TETLUX_CACHE_DIR"] = str(learned)
    file.touch()
    done = {json.loads(line)["scene"] for line in file.read_text(encoding="utf-8").splitlines()}
    for number in sorted(set(range(first, last)) - done):
        if time.monotonic() > end:
            break
        with file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(measure(number)) + "\n")
        _drop_meshes(learned)
    report([json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()])


def _drop_meshes(directory: Path) -> None:
    """Remove all but what was learned."""
    for path in directory.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name != FILE:
            path.unlink()


if __name__ == "__main__":
    main()
