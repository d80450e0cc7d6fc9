"""From a command to its results: ``python -m tests.benchmarks.first_light [--times N] [SURFACE [SCALE]]``.

Each row is a command in a process of its own, and the least of N times (3): wall clock, CPU seconds with those of its
child processes, and both until the last line that says "solved". Cold: no mesh is remembered; warm: it is. Modules are
compiled, as those of an installed package are. On a machine that does other things too, compare CPU seconds. A
surface, scaled to some 35 mm, is lit in marble by sun and sky, with all outputs. To compare with another commit, run
this file in its worktree as well.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from tests.benchmarks.compiled import compile_modules
from tests.benchmarks.surfaces import refined
from tetlux.cases.picture.draw import PictureScene, Ray, draw_picture
from tetlux.cases.shipped import library_folder
from tetlux.meshing import read_surface

SPHERE = """\
name: sphere
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights: [{pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 1.0}}]
outputs: []
"""
LIT = """\
name: lit
surface: {file: FILE, scale: SCALE}
up: [0, 1, 0]
medium: {material: marble}
lights:
  - {name: sun, collimated: {direction: [-0.6, -0.4, -0.7], irradiance: [1.0, 0.93, 0.82]}}
  - {name: sky, diffuse: {irradiance: [0.06, 0.08, 0.11]}}
tolerance: 0.05
"""
TRIANGLES = 100_000
# Wall clock and CPU seconds until solved, then of the whole command.
Timing = tuple[float, float, float, float]


def cpu_seconds(who: int = resource.RUSAGE_CHILDREN) -> float:
    """CPU seconds of all child processes that have ended, or of this process."""
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


def run(case: str, folder: Path, cache: Path) -> Timing:
    """Run a case by the command line."""
    command = [sys.executable, "-m", "tetlux", "run", case, "--out", str(folder / "out")]
    environment = {**os.environ, "TETLUX_CACHE_DIR": str(cache)}
    before, started, solved = cpu_seconds(), time.perf_counter(), (np.nan, np.nan)
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if "solved on" in line:
                # What the process itself used so far, without its children, is in Linux's /proc only.
                solved = time.perf_counter() - started, _cpu_so_far(process.pid)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} failed")
    return *solved, time.perf_counter() - started, cpu_seconds() - before


def _cpu_so_far(process: int) -> float:
    """CPU seconds of a running process and of its children that have ended; nan where there is no /proc."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return np.nan
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def report(name: str, timings: Iterable[Timing]) -> None:
    """Print the least of each column."""
    solved, solved_cpu, whole, cpu = np.min(list(timings), axis=0)
    print(f"{name:<38} {solved:8.2f} {solved_cpu:8.2f} {whole:8.2f} {cpu:8.2f} {cpu / solved_cpu:8.2f}", flush=True)


def draw(times: int, folder: Path) -> Iterable[Timing]:
    """Draw a hare of many triangles, in this process."""
    hare = refined(read_surface(library_folder() / "hare.stl"), TRIANGLES)
    distance = np.linalg.norm(hare.points - hare.points[0], axis=1)
    entry = tuple(hare.points[0].tolist())
    start = tuple((hare.points[0] + [0.0, -30.0, 0.0]).tolist())
    scene = PictureScene(hare.points, hare.faces, np.exp(-0.5 * distance), "mm", "hare", (Ray(start, entry),))
    for _ in range(times):
        before, started = cpu_seconds(resource.RUSAGE_SELF) + cpu_seconds(), time.perf_counter()
        draw_picture(scene, folder / "hare.png")
        wall = time.perf_counter() - started
        yield np.nan, np.nan, wall, cpu_seconds(resource.RUSAGE_SELF) + cpu_seconds() - before


def main() -> None:
    """Print a row for each command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("surface", nargs="?", type=Path)
    parser.add_argument("scale", nargs="?", type=float, default=20.0)
    parser.add_argument("--times", type=int, default=3)
    options = parser.parse_args()
    compile_modules()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        (folder / "sphere.yaml").write_text(SPHERE)
        cases = {"sphere without outputs": str(folder / "sphere.yaml"), "hare": "hare", "marble": "marble"}
        if options.surface:
            text = LIT.replace("FILE", str(options.surface.resolve())).replace("SCALE", str(options.scale))
            (folder / "lit.yaml").write_text(text)
            cases[f"{options.surface.name} in marble, sun and sky"] = str(folder / "lit.yaml")
        print(f"{'':<38} {'solved':>8} {'CPU':>8} {'whole':>8} {'CPU':>8} {'whole/solved, CPU':>8}")
        for name, case in cases.items():
            colds = [run(case, folder, folder / f"cold {i} {name}") for i in range(options.times)]
            report(f"{name}, cold", colds)
            report(f"{name}, warm", [run(case, folder, folder / f"cold 0 {name}") for _ in range(options.times)])
        report(f"picture of {TRIANGLES:,} triangles", draw(options.times, folder))


if __name__ == "__main__":
    main()
