"""Methods of the chart: what a run of one is, and the finite elements of this project."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tetlux.cases.chart.benchmark import COARSER, Scene
from tetlux.fem.grading import graded_towards
from tetlux.fem.solution import Solution
from tetlux.fem.solve import solve
from tetlux.fem.sources import Subtract
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.mesher import tetrahedralize
from tetlux.meshing.refine import refine
from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh

MOST_TETRAHEDRA = 2_000_000
# Runs that take longer than this together are not repeated.
REPEAT_SECONDS = 2.0


@dataclass(frozen=True, eq=False)
class Outcome:
    """What one run of a method gave.

    Attributes
    ----------
    exitance : (n,) ndarray
        At the samples of the scene, W/unit².
    seconds : float
        From the surface in memory to the exitance at the surface.
    unknowns, tetrahedra : int or None
        None for what has no mesh.
    estimate : float or None
        What the method itself believes its error to be.
    """

    exitance: FloatArray
    seconds: float
    unknowns: int | None = None
    tetrahedra: int | None = None
    estimate: float | None = None


@dataclass(frozen=True)
class Method:
    """A way to the exitance, with one number that sets its resolution.

    Attributes
    ----------
    name : str
    parameter : str
        What the number is called.
    ladder : tuple of float
        Its values, the coarsest first.
    run : callable
        One run on a scene.
    fits : callable
        Whether it can do a scene.
    comparable : bool
        False if what is called its error is a difference of models: it does not compete for the front then.
    quick : int
        How many of the values a quick chart takes.
    """

    name: str
    parameter: str
    ladder: tuple[float, ...]
    run: Callable[[Scene, float], Outcome]
    fits: Callable[[Scene], bool] = lambda _: True
    comparable: bool = True
    quick: int = 1

    def labelled(self, value: float) -> str:
        """The parameter and a value of it, as in ``tolerance=0.02``."""
        return f"{self.parameter}={value:.10g}" if self.parameter else ""

    def ladder_for(self, scene: Scene) -> tuple[float, ...]:
        """The values that the scene's reference is good enough for."""
        least = COARSER * scene.reference.error if self.parameter == "tolerance" else 0.0
        return tuple(value for value in self.ladder if value >= least)


def quickest(scene: Scene, run: Callable[[], Outcome]) -> Outcome:
    """Make a short run as often as the scene says, while it takes no more than some seconds; the quickest one."""
    started, outcomes = time.perf_counter(), [run()]
    while len(outcomes) < scene.repeats and time.perf_counter() - started < REPEAT_SECONDS:
        outcomes.append(run())
    return min(outcomes, key=lambda outcome: outcome.seconds)


def _solved(scene: Scene, solution_for: Callable[[Surface], Solution]) -> Outcome:
    """Time what makes a solution of a surface."""

    def run() -> Outcome:
        # A surface that remembers nothing of earlier runs.
        surface = replace(scene.case.surface)
        started = time.perf_counter()
        solution = solution_for(surface)
        solution.exitance  # noqa: B018 - made when first asked for
        seconds = time.perf_counter() - started
        return Outcome(
            solution.exitance_at(scene.samples.points),
            seconds,
            len(solution.mesh.points),
            len(solution.mesh.tetrahedra),
            solution.error_estimate,
        )

    return quickest(scene, run)


def _on_mesh(
    mesh_for: Callable[[Scene, Surface, float], TetMesh], subtract: Subtract
) -> Callable[[Scene, float], Outcome]:
    """Runs on a mesh that is made first, whatever the error."""

    def run(scene: Scene, value: float) -> Outcome:
        case = scene.case
        return _solved(
            scene,
            lambda surface: solve(
                surface, case.medium, case.lights, mesh=mesh_for(scene, surface, value), subtract=subtract
            ),
        )

    return run


def _uniform(_scene: Scene, surface: Surface, refinements: float) -> TetMesh:
    mesh = tetrahedralize(surface, cache=False)
    for _ in range(int(refinements)):
        mesh = refine(mesh, np.ones(len(mesh.tetrahedra), dtype=bool), surface)
    return mesh


def _graded(scene: Scene, surface: Surface, longest: float) -> TetMesh:
    return graded_towards(tetrahedralize(surface, cache=False), surface, *scene.lit, MOST_TETRAHEDRA, longest=longest)


def _adaptive(subtract: Subtract) -> Callable[[Scene, float], Outcome]:
    """Runs that refine until their own estimate meets a tolerance."""

    def run(scene: Scene, tolerance: float) -> Outcome:
        case = scene.case
        return _solved(
            scene,
            lambda surface: solve(
                surface,
                case.medium,
                case.lights,
                tolerance=tolerance,
                subtract=subtract,
                most_tetrahedra=MOST_TETRAHEDRA,
                cache=False,
            ),
        )

    return run


def _has_light_to_grade_to(scene: Scene) -> bool:
    return len(scene.lit[0]) > 0


REFINEMENTS = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
OURS = "tetlux"
FINITE_ELEMENTS = (
    Method("P1, uniform", "refinements", REFINEMENTS, _on_mesh(_uniform, "nothing")),
    Method(
        "P1, graded",
        "longest edge over distance",
        (2.0, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18),
        _on_mesh(_graded, "nothing"),
        _has_light_to_grade_to,
    ),
    Method("P1, adaptive", "tolerance", (0.2, 0.1, 0.05, 0.02, 0.01), _adaptive("nothing"), quick=2),
    Method(
        "free-space subtracted, adaptive",
        "tolerance",
        (0.2, 0.1, 0.05, 0.02, 0.01, 0.005),
        _adaptive("free-space"),
        lambda scene: scene.in_points,
    ),
    Method(
        "half-space subtracted, uniform",
        "refinements",
        REFINEMENTS,
        _on_mesh(_uniform, "half-space"),
        lambda scene: scene.in_points,
    ),
    Method(OURS, "tolerance", (0.05, 0.02, 0.01, 0.005, 0.002, 0.001), _adaptive("half-space"), quick=2),
)
