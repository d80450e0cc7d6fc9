"""Other solvers on the chart, if they are installed; each run is a process of its own."""

import importlib.util
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tetlux.cases.chart.benchmark import Benchmark
from tetlux.cases.chart.finite_elements import GRADINGS, graded_mesh
from tetlux.cases.chart.methods import REPEAT_SECONDS, Method, Outcome
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import only_medium
from tetlux.fem.outcome.exitance_field import LinearFluence
from tetlux.meshing.arrays import Vector
from tetlux.meshing.errors import RunError
from tetlux.meshing.host.scratch import run_child, scratch
from tetlux.meshing.surface.solids import Cylinder, Shape, Slab, Sphere, Torus
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.nesting import nesting

# A peer is stopped after this many seconds.
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
        The Python package that it needs.
    methods : tuple of Method
    """

    name: str
    package: str
    methods: tuple[Method, ...]

    @property
    def is_installed(self) -> bool:
        """Whether its package is installed; found out without importing it."""
        return importlib.util.find_spec(self.package) is not None


def _problem(benchmark: Benchmark) -> dict[str, Any]:
    """The equation and its sources, as every peer needs them; coefficients of the body and of each region."""
    medium = benchmark.case.medium
    media = [medium, *(each for region in benchmark.regions if isinstance(each := only_medium(region), Medium))]
    return {
        "diffusion": np.array([each.diffusion for each in media]),
        "sigma_a": np.array([each.sigma_a for each in media]),
        "robin": 1.0 / (2.0 * medium.boundary_factor),
        "eta": medium.eta,
        "points": np.array([point for point, _ in benchmark.sources]),
        "powers": np.array([power for _, power in benchmark.sources]),
        "lengths_to_resolve": benchmark.lit[1],
        "repeats": benchmark.repeats,
        "repeat_seconds": REPEAT_SECONDS,
    }


def run_peer(script: str, job: dict[str, Any]) -> dict[str, Any]:
    """Run a script of this folder on a job in a process of its own, and return its result.

    Raises
    ------
    RunError
        If it fails, crashes, or takes too long.
    """
    with scratch("peer") as folder:
        job_path, result_path = folder / "job.npz", folder / "result.npz"
        np.savez(job_path, **job)
        # -P keeps modules of this folder from shadowing others of the same name.
        command = [sys.executable, "-P", str(Path(__file__).with_name(script)), str(job_path), str(result_path)]
        try:
            done = run_child(command, folder, TIME_LIMIT)
        except subprocess.TimeoutExpired as error:
            raise RunError(f"stopped after {TIME_LIMIT:g} s") from error
        if done.returncode != 0 or not result_path.exists():
            last_line = (done.stderr.strip().splitlines() or ["no message"])[-1]
            raise RunError(f"signal {-done.returncode}" if done.returncode < 0 else last_line)
        with np.load(result_path) as data:
            return {key: data[key] for key in data.files}


def exact_shapes(surface: Surface, inner: Sequence[Surface]) -> dict[str, Any]:
    """The shapes of a body and of its regions, as ``_peer_ngsolve.py`` makes them, with the longest edge of a mesh."""
    surfaces = [surface, *inner]
    kinds, sizes, centers = zip(*(_exact_shape(surface.shape) for surface in surfaces), strict=True)
    thickness = min(2.0 * surface.volume / surface.area for surface in surfaces)
    return {
        "kinds": np.array(kinds),
        "sizes": np.array(sizes),
        "centers": np.array(centers),
        "parents": np.array(nesting(surface, inner).parents, dtype=int),
        "longest": LONGEST * thickness,
    }


def _exact_shape(shape: Shape | None) -> tuple[str, tuple[float, float], Vector]:
    """Kind, sizes and centre of a shape."""
    match shape:
        case Sphere():
            return "sphere", (shape.radius, 0.0), shape.center
        case Torus():
            return "torus", (shape.major, shape.minor), shape.center
        case Cylinder():
            return "cylinder", (shape.radius, shape.height), shape.center
        case Slab():
            return "slab", (shape.width, shape.depth), (0.0, 0.0, 0.0)
    raise AssertionError(shape)


def _ngsolve(order: int) -> Callable[[Benchmark, float], Outcome]:
    """Make a method that solves with NGSolve on netgen's mesh of the exact shape, graded towards the source."""

    def run(benchmark: Benchmark, grading: float) -> Outcome:
        shapes = exact_shapes(benchmark.case.surface, [region.surface for region in benchmark.regions])
        job = {"order": order, "resolution": grading, "samples": benchmark.samples.points}
        result = run_peer("_peer_ngsolve.py", _problem(benchmark) | shapes | job)
        return Outcome(result["exitance"], float(result["seconds"]), int(result["unknowns"]), int(result["tetrahedra"]))

    return run


def _redbird(benchmark: Benchmark, longest: float) -> Outcome:
    """Solve with redbirdpy on tetlux's graded mesh; the seconds include meshing."""
    surface = replace(benchmark.case.surface)
    started = time.perf_counter()
    mesh = graded_mesh(benchmark, surface, longest)
    meshing = time.perf_counter() - started
    job = {"nodes": mesh.points, "tetrahedra": mesh.tetrahedra, "regions": mesh.regions}
    result = run_peer("_peer_redbird.py", _problem(benchmark) | job)
    field = LinearFluence(mesh, surface, benchmark.case.medium, result["fluence"])
    return Outcome(
        field.exitance_on(surface.project(benchmark.samples.points)[0]),
        meshing + float(result["seconds"]),
        len(mesh.points),
        len(mesh.tetrahedra),
    )


def _has_point_sources(benchmark: Benchmark) -> bool:
    return benchmark.has_point_sources


def _has_exact_shape(benchmark: Benchmark) -> bool:
    known = isinstance(benchmark.shape, Sphere | Slab | Torus | Cylinder)
    inner = all(isinstance(region.surface.shape, Sphere | Cylinder) for region in benchmark.regions)
    return benchmark.has_point_sources and known and inner


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
        (Method("redbirdpy P1", "longest edge over distance", GRADINGS[:-1], _redbird, _has_point_sources),),
    ),
)
