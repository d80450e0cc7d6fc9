"""Other people's solvers on the chart, where they are installed: each run is a process of its own."""

import importlib.util
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tetlux.cases.chart.methods import MOST_TETRAHEDRA, REPEAT_SECONDS, Method, Outcome
from tetlux.cases.chart.benchmark import Scene
from tetlux.fem.grading import graded_towards
from tetlux.fem.solution import Power, Solution
from tetlux.meshing.errors import RunError
from tetlux.meshing.mesher import tetrahedralize
from tetlux.meshing.scratch import run_child, scratch

# Seconds until a peer is stopped.
TIME_LIMIT = 300.0
# Netgen's longest edge, as a share of the body's mean thickness 2 V/A.
LONGEST = 0.75


@dataclass(frozen=True)
class Peer:
    """Another solver.

    Attributes
    ----------
    name : str
    package : str
        What has to be installed.
    methods : tuple of Method
    """

    name: str
    package: str
    methods: tuple[Method, ...]

    @property
    def installed(self) -> bool:
        """Whether its package can be imported here; it is not imported to find out."""
        return importlib.util.find_spec(self.package) is not None


def _problem(scene: Scene) -> dict[str, Any]:
    """The equation and its sources, as any solver needs them."""
    medium = scene.case.medium
    return {
        "diffusion": medium.diffusion,
        "sigma_a": medium.sigma_a,
        "robin": 1.0 / (2.0 * medium.boundary_factor),
        "eta": medium.eta,
        "points": np.array([point for point, _ in scene.sources]),
        "powers": np.array([power for _, power in scene.sources]),
        "lengths_to_resolve": scene.lit[1],
        "repeats": scene.repeats,
        "repeat_seconds": REPEAT_SECONDS,
    }


def answer(script: str, job: dict[str, Any]) -> dict[str, Any]:
    """Run a script of this folder on a job in a process of its own.

    Raises
    ------
    RunError
        If it fails, crashes, or takes too long.
    """
    with scratch("peer") as folder:
        job_path, result_path = folder / "job.npz", folder / "result.npz"
        np.savez(job_path, **job)
        # -P: the names of this folder's modules are not to hide those of others.
        command = [sys.executable, "-P", str(Path(__file__).with_name(script)), str(job_path), str(result_path)]
        try:
            done = run_child(command, folder, TIME_LIMIT)
        except subprocess.TimeoutExpired as error:
            raise RunError(f"stopped after {TIME_LIMIT:g} s") from error
        if done.returncode != 0 or not result_path.exists():
            said = (done.stderr.strip().splitlines() or ["no message"])[-1]
            raise RunError(f"signal {-done.returncode}" if done.returncode < 0 else said)
        with np.load(result_path) as data:
            return {key: data[key] for key in data.files}


def _ngsolve(order: int) -> Callable[[Scene, float], Outcome]:
    """Netgen on the exact shape, graded towards the source; curved elements from the second order on."""

    def run(scene: Scene, grading: float) -> Outcome:
        shape, surface = scene.shape, scene.case.surface
        if shape.sphere:
            sizes, center = [shape.sphere.radius], shape.sphere.center
        elif shape.torus:
            sizes, center = [shape.torus.major, shape.torus.minor], shape.torus.center
        else:
            assert shape.slab is not None
            sizes, center = [shape.slab.width, shape.slab.depth], (0.0, 0.0, 0.0)
        result = answer(
            "_peer_ngsolve.py",
            _problem(scene)
            | {
                "kind": shape.kind,
                "sizes": sizes,
                "center": center,
                "order": order,
                "resolution": grading,
                "longest": LONGEST * 2.0 * surface.volume / surface.area,
                "samples": scene.samples.points,
            },
        )
        return Outcome(result["exitance"], float(result["seconds"]), int(result["unknowns"]), int(result["tetrahedra"]))

    return run


def _redbird(scene: Scene, longest: float) -> Outcome:
    """Our own graded mesh, whose seconds count, and its solver."""
    surface = replace(scene.case.surface)
    started = time.perf_counter()
    mesh = tetrahedralize(surface, cache=False)
    mesh = graded_towards(mesh, surface, *scene.lit, MOST_TETRAHEDRA, longest=longest)
    meshing = time.perf_counter() - started
    result = answer("_peer_redbird.py", _problem(scene) | {"nodes": mesh.points, "tetrahedra": mesh.tetrahedra})
    # Evaluated at the samples as our own fluence is.
    nothing = Power(0.0, 0.0, 0.0, 0.0, 0.0)
    solution = Solution(mesh, surface, scene.case.medium, result["fluence"], nothing)
    return Outcome(
        solution.exitance_at(scene.samples.points),
        meshing + float(result["seconds"]),
        len(mesh.points),
        len(mesh.tetrahedra),
    )


def _has_exact_shape(scene: Scene) -> bool:
    return scene.in_points and scene.shape.kind in ("sphere", "slab", "torus")


PEERS = (
    Peer(
        "NGSolve",
        "ngsolve",
        (
            Method("NGSolve P1", "grading", (0.3, 0.2, 0.15, 0.1, 0.07), _ngsolve(1), _has_exact_shape),
            Method("NGSolve P2", "grading", (0.5, 0.3, 0.2, 0.15, 0.1), _ngsolve(2), _has_exact_shape, quick=0),
            Method("NGSolve P3", "grading", (0.5, 0.3, 0.2, 0.15), _ngsolve(3), _has_exact_shape),
        ),
    ),
    Peer(
        "redbirdpy",
        "redbirdpy",
        (
            Method(
                "redbirdpy P1",
                "longest edge over distance",
                (2.0, 1.0, 0.7, 0.5, 0.35, 0.25),
                _redbird,
                lambda scene: scene.in_points,
            ),
        ),
    ),
)
