"""What a batch saves, and whether it is right: ``python -m tests.benchmarks.batches [PART...]``.

Seconds are CPU seconds with those of all children, which other work on the machine changes least. Commands find modules
compiled, as those of an installed package are. The parts, all by default:

* ``hare``: single commands against a batch on the hare (10 sigma_a x 10 sigma_s' x 10 directions, tolerance .05);
* ``errors``: 20 of its runs, drawn with a fixed seed, against solutions at a tenth of the tolerance;
* ``tiny``: overhead and memory of many runs on a ball (tolerance .1);
* ``start``: seconds to the first result of a batch, and of ``tetlux --help``;
* ``kills``: a batch killed at random moments and resumed, against one that nothing disturbed.

``--runs N`` is the number of runs of the batches (1,000 by default, and ten times as many tiny ones).
"""

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from glob import glob
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.compiled import compile_modules
from tetlux.cases.batch.grouping import make_plan
from tetlux.cases.batch.jobs import MeshJob
from tetlux.cases.batch.mesh_store import MeshStore
from tetlux.cases.batch.requests import load_all
from tetlux.cases.batch.schedule import Batch, Schedule
from tetlux.cases.shipped import library_folder
from tetlux.fem import solve
from tetlux.fem.share import choose_places
from tetlux.fem.shared import SharedMesh
from tetlux.fem.solve_scenes import solve_each

TETLUX = [sys.executable, "-m", "tetlux"]
SINGLES, DRAWN, KILLS, SEED = 20, 20, 10, 17
BODY = """
unit: mm
medium: {{sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}}
lights:
  - pencil: {{origin: {origin}, direction: {direction}, power: 1.0}}
outputs: []
tolerance: {tolerance}
surface: {surface}
"""
HARE = BODY.format(
    origin="[2, -30, 30]",
    direction="[0.08, 1, -0.1]",
    tolerance=0.05,
    surface=f"{{file: {json.dumps(str(library_folder() / 'hare.stl'))}}}",
)
BALL = BODY.format(origin="[0, 0, 20]", direction="[0, 0, -1]", tolerance=0.1, surface="{sphere: {radius: 10}}")


def grid(runs: int, *, directions: int) -> str:
    """A sweep of about so many runs."""
    each = max(2, round((runs / directions) ** 0.5))
    keys = [
        f"medium.sigma_a: {{start: 0.003, stop: 0.05, num: {each}, scale: log}}",
        f"medium.sigma_s_prime: {{start: 0.6, stop: 1.8, num: {each}, scale: log}}",
    ]
    if directions > 1:
        keys.append(f"lights.0.pencil.direction.0: {{start: 0.0, stop: 0.09, num: {directions}}}")
    return "sweep:\n" + "".join(f"  {key}\n" for key in keys)


def run(*arguments: str, folder: Path) -> tuple[float, float]:
    """CPU seconds and wall seconds of a command."""
    before, started = os.times(), time.perf_counter()
    subprocess.run([*TETLUX, *arguments], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return cpu, time.perf_counter() - started


def time_hare(folder: Path, runs: int) -> None:
    """Singles against a batch."""
    (folder / "hare.yaml").write_text(HARE + grid(runs, directions=10))
    cases = load_all([str(folder / "hare.yaml")])
    single = []
    for number, case in enumerate(random.Random(SEED).sample(cases, SINGLES)):
        scene = HARE.replace("sigma_a: 0.01", f"sigma_a: {case.medium.sigma_a!r}")
        scene = scene.replace("sigma_s_prime: 1.0", f"sigma_s_prime: {case.medium.reduced_scattering!r}")
        (folder / f"single{number}.yaml").write_text(scene)
        single.append(run("run", f"single{number}.yaml", "--out", "singles", folder=folder))
    cpu, wall = (float(np.mean(column)) for column in zip(*single, strict=True))
    print(f"hare: a single run {cpu:.2f} CPU s, {wall:.2f} s")
    batch_cpu, batch_wall = run("run", "hare.yaml", "--out", "batch", folder=folder)
    count, cores = len(cases), len(os.sched_getaffinity(0))
    print(f"hare: {count} runs in a batch {batch_cpu:.0f} CPU s ({batch_cpu / count:.3f} each), {batch_wall:.0f} s")
    print(f"hare: {cpu / batch_cpu * count:.1f} times by CPU time, {wall / batch_wall * count:.1f} times by the clock")
    print(f"hare: {batch_cpu / (cores * batch_wall):.0%} of {cores} cores' time")


def print_errors(folder: Path, runs: int) -> None:
    """True errors of drawn runs, each on the mesh and with the places that it has in the batch."""
    (folder / "hare.yaml").write_text(HARE + grid(runs, directions=10))
    cases = load_all([str(folder / "hare.yaml")])
    plan = make_plan(cases)
    store = MeshStore(folder, plan, [case.name for case in cases])
    job = Schedule(Batch(plan, cases, frozenset(), str(folder), True, store)).next_job()
    assert isinstance(job, MeshJob)
    mesh = job.adapt().mesh()
    errors, estimates = [], []
    for number in random.Random(SEED).sample(range(len(cases)), DRAWN):
        case, leader = cases[number], cases[plan.leaders[number]]
        start = SharedMesh(mesh)
        choose_places(leader.surface, leader.medium, [list(leader.lights)], start, tolerance=0.05)
        (found,) = solve_each(case.surface, case.medium, [list(case.lights)], tolerance=0.05, start=start)
        exact = solve(case.surface, case.medium, list(case.lights), tolerance=0.005)
        places, areas = exact.mesh.points[exact.mesh.boundary_nodes], exact.mesh.boundary_node_areas
        wanted = exact.exitance_at(places)
        error = np.sqrt(areas @ (found.exitance_at(places) - wanted) ** 2 / (areas @ wanted**2))
        errors.append(float(error))
        estimates.append(found.error_estimate)
    print(f"errors: of {DRAWN} runs {min(errors):.2%} to {max(errors):.2%}, tolerance 5%;", end=" ")
    print(f"estimated {min(estimates):.2%} to {max(estimates):.2%}; mesh of {len(mesh.tetrahedra):,} tetrahedra")


# A command that prints its memory (MB) at the end, and CPU seconds outside of meshing and solving.
WATCHED = """
import resource, sys, time
from tetlux.cases import run
from tetlux.cases.batch.jobs import MeshJob
from tetlux.cases.cli import main

spent = 0.0

def watch(work):
    def watched(*arguments, **options):
        global spent
        started = time.process_time()
        try:
            return work(*arguments, **options)
        finally:
            spent += time.process_time() - started
    return watched

run.solve_case, MeshJob.adapt = watch(run.solve_case), watch(MeshJob.adapt)
code = main(sys.argv[1:])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3, time.process_time() - spent, file=sys.stderr)
sys.exit(code)
"""


def time_tiny(folder: Path, runs: int) -> None:
    """Overhead outside meshing and solving, in one process; and memory of the parent of worker processes."""
    (folder / "ball.yaml").write_text(BALL + grid(10 * runs, directions=1))
    _, overhead = _watched(folder, "--jobs", "1", "--out", "one", "--quiet")
    count = len(list((folder / "one").glob("*/*/summary.json")))
    before = os.times()
    memory, _ = _watched(folder, "--out", "several", "--quiet")
    after = os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    print(
        f"tiny: {count} runs: in one process {1e3 * overhead / count:.1f} ms of CPU each outside of meshing and",
        end=" ",
    )
    print(f"solving; in several {1e3 * cpu / count:.1f} ms altogether; memory of the parent {memory:.0f} MB")


def _watched(folder: Path, *options: str) -> tuple[float, float]:
    """MB of memory, and CPU seconds outside of meshing and solving, of a command."""
    command = [sys.executable, "-c", WATCHED, "run", "ball.yaml", *options]
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    memory, overhead = map(float, done.stderr.split()[-2:])
    return memory, overhead


def time_start(folder: Path, _: int) -> None:
    """Seconds to the first result, on a warm cache."""
    (folder / "few.yaml").write_text(HARE + grid(100, directions=10))
    run("check", "few.yaml", folder=folder)
    started = time.perf_counter()
    with subprocess.Popen([*TETLUX, "run", "few.yaml", "--out", "few"], cwd=folder, stdout=subprocess.DEVNULL) as batch:
        while not glob(f"{folder}/few/*/*/summary.json") and batch.poll() is None:  # noqa: PTH207 - folders vanish
            time.sleep(0.01)
        print(f"start: the first of {len(load_all([str(folder / 'few.yaml')]))} runs after", end=" ")
        print(f"{time.perf_counter() - started:.1f} s")
        batch.kill()
    print(f"start: tetlux --help {min(run('--help', folder=folder)[0] for _ in range(5)):.3f} CPU s")


def compare_kills(folder: Path, _: int) -> None:
    """A batch that is killed at random moments, against one that nothing disturbed."""
    (folder / "ball.yaml").write_text(BALL + grid(100, directions=1))
    run("run", "ball.yaml", "--out", "whole", folder=folder)
    whole, draw = _tables(folder / "whole"), random.Random(SEED)
    for _kill in range(KILLS):
        before = len(_tables(folder / "cut"))
        goal = before + draw.randrange(max(1, 2 * (len(whole) - before) // KILLS) + 1)
        command = [*TETLUX, "run", "ball.yaml", "--out", "cut", "--resume"]
        with subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as batch:
            # Folders come and go meanwhile, which Path.glob does not take.
            while len(glob(str(folder / "cut/*/*/summary.json"))) < goal and batch.poll() is None:  # noqa: PTH207
                time.sleep(0.01)
            time.sleep(draw.random())
            batch.kill()
    run("run", "ball.yaml", "--out", "cut", "--resume", folder=folder)
    equal = _tables(folder / "cut") == whole
    print(f"kills: {len(whole)} runs, {KILLS} kills: the results are {'equal' if equal else 'NOT EQUAL'}")


def _tables(out: Path) -> dict[str, Any]:
    found = {path.parent.name: json.loads(path.read_text()) for path in out.glob("*/*/summary.json")}
    return {name: {**summary, "seconds": None} for name, summary in found.items()}


PARTS: dict[str, Callable[[Path, int], None]] = {
    "hare": time_hare,
    "errors": print_errors,
    "tiny": time_tiny,
    "start": time_start,
    "kills": compare_kills,
}


def main() -> None:
    """Print the parts that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", choices=[[], *PARTS])
    parser.add_argument("--runs", type=int, default=1000)
    options = parser.parse_args()
    compile_modules()
    for part in options.parts or PARTS:
        with tempfile.TemporaryDirectory() as folder:
            PARTS[part](Path(folder), options.runs)


if __name__ == "__main__":
    main()
