"""Mesh a body, solve, estimate the error and refine, until the tolerance is met for every scene."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Timer

import numpy as np

from tetlux.fem.error.tolerance import cells_to_split, splits_for_readings
from tetlux.fem.grading import (
    LONGEST_EDGE,
    LONGEST_IF_FITTED,
    grade_between,
    grade_mesh,
    layer_sizes,
    places_to_resolve,
)
from tetlux.fem.known.split import Sources
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.operators.assembly import Assembly, Lumping
from tetlux.fem.outcome.detectors import PlacedDetector, estimate_reading
from tetlux.fem.quadratic.error import ReadingError
from tetlux.fem.scenes import Scenes
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.system import MeshSolution
from tetlux.meshing.arrays import IntArray
from tetlux.meshing.boundary.layers import LayeredMesh, add_layers
from tetlux.meshing.mesher.api import TIME_LIMIT, tetrahedralize
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.refine import refine_often

# Refinement stops at this many tetrahedra unless told otherwise.
MOST_TETRAHEDRA = 1_000_000
# After this many seconds in the mesher a progress line appears.
PROGRESS_AFTER_SECONDS = 8.0

Report = Callable[[str], None]
# Solves for one scene on a mesh, given its number and its solution on the coarser mesh, if there was one.
SceneSolver = Callable[[int, MeshSolution | None], MeshSolution]


@dataclass(frozen=True, eq=False)
class Tolerances:
    """What a mesh is refined for: wanted errors.

    Attributes
    ----------
    exitance : float, optional
        Wanted relative L2 error of the exitance.
    readings : float, optional
        Wanted relative error of what each detector reads.
    placed : tuple of PlacedDetector
        The detectors.
    """

    exitance: float | None
    readings: float | None = None
    placed: tuple[PlacedDetector, ...] = ()

    def assess(self, steps: Sequence[MeshSolution], parents: IntArray) -> "Assessment":
        """Compare the errors of solutions on one mesh with the tolerances; see `LayeredMesh` for `parents`."""
        splits = np.zeros(int(parents.max()) + 1, dtype=np.int64)
        error = max(step.estimate.error for step in steps)
        largest_ratio, summary = 0.0, f"estimated error {error:.2%}"
        if self.exitance is not None:
            largest_ratio = error / self.exitance
            splits += cells_to_split((step.estimate.sum_by(parents) for step in steps), self.exitance)
        if self.readings is not None:
            readings = [reading for step in steps for reading in self._read(step)]
            of_readings = max((reading.relative for reading in readings), default=0.0)
            largest_ratio = max(largest_ratio, of_readings / self.readings)
            summary += f", of readings {of_readings:.2%}"
            np.maximum.at(splits, parents, splits_for_readings(readings, self.readings, len(parents)))
        return Assessment(largest_ratio, splits, summary)

    def _read(self, step: MeshSolution) -> list[ReadingError]:
        quadratic = step.solution.quadratic
        assert quadratic is not None
        # All duals at once.
        quadratic.operator.duals([placed.measurement for placed in self.placed])
        return [estimate_reading(step.solution, placed.measurement) for placed in self.placed]


@dataclass(frozen=True, eq=False)
class Assessment:
    """How far solutions on one mesh are from the tolerances.

    Attributes
    ----------
    largest_error_ratio : float
        The largest ratio of an estimated error to its tolerance.
    splits : (m,) ndarray of int
        How often to split each tetrahedron of the mesh without layers.
    summary : str
        The errors, in a few words.
    """

    largest_error_ratio: float
    splits: IntArray
    summary: str


@dataclass(frozen=True, eq=False)
class Problem:
    """What is solved for: a body, the media and lights of each scene, and how.

    Attributes
    ----------
    scenes : Scenes
        The body and the media of each scene.
    sources : list of Sources
        The lights of each scene.
    lumping : {"lumped", "consistent"}
    limit : bool
        Whether the fluence is limited to be nonnegative, see `tetlux.fem.operators.limiter`.
    watch : Stopwatch
    """

    scenes: Scenes
    sources: list[Sources]
    lumping: Lumping
    limit: bool
    watch: Stopwatch

    @property
    def media(self) -> list[tuple[AnyMedium, ...]]:
        """The media of each scene."""
        return self.scenes.media

    @property
    def size(self) -> tuple[int, int]:
        """The numbers of matrices and of lights, which decide how much memory a mesh needs."""
        return len(set(self.media)), sum(len(sources.deposits) for sources in self.sources)

    def layers_on(self, mesh: TetMesh, tolerance: float) -> LayeredMesh:
        """A mesh with layers of flat tetrahedra below lit parts of the surface."""
        deposits = [deposit for sources in self.sources for deposit in sources.deposits]
        if not any(len(deposit.hints.lit) for deposit in deposits):
            return LayeredMesh(mesh, np.arange(len(mesh.tetrahedra)))
        return add_layers(mesh, *layer_sizes(mesh, deposits, tolerance))

    def solver_on(self, mesh: TetMesh) -> SceneSolver:
        """A solver for single scenes on a mesh; scenes of the same media share a matrix."""
        assembly = Assembly(mesh)
        systems = {
            media: self.scenes.system_on(mesh, media, self.lumping, assembly, limit=self.limit)
            for media in dict.fromkeys(self.media)
        }
        return lambda scene, coarser: systems[self.media[scene]].step(self.sources[scene], self.watch, coarser)


def first_mesh(
    problem: Problem, tolerances: Tolerances, most_tetrahedra: int, report: Report, *, cache: bool
) -> TetMesh:
    """The mesher's mesh of a body, refined towards its lights, and between them and detectors."""
    scenes = problem.scenes
    with problem.watch.stage("mesh"):
        with _report_if_slow(report):
            mesh = tetrahedralize(scenes.surface, scenes.inner, cache=cache)
        for fitted, longest in ((False, LONGEST_EDGE), (True, LONGEST_IF_FITTED)):
            deposits = [each for sources in problem.sources for each in sources.deposits_if(fitted=fitted)]
            source_points = places_to_resolve(deposits)
            mesh = grade_mesh(
                mesh, scenes.surface, *source_points, most_tetrahedra, longest=longest, inner=scenes.inner
            )
        if tolerances.readings is not None:
            detector_points = np.array([placed.position for placed in tolerances.placed])
            all_points, _ = places_to_resolve([each for sources in problem.sources for each in sources.deposits])
            for media in dict.fromkeys(problem.media):
                mesh = grade_between(
                    mesh,
                    scenes.surface,
                    scenes.inner,
                    media,
                    all_points,
                    detector_points,
                    tolerances.readings,
                    most_tetrahedra,
                )
    report(f"tetrahedralized: {len(mesh.tetrahedra):,} tetrahedra")
    return mesh


@contextmanager
def _report_if_slow(report: Report) -> Iterator[None]:
    """Report once that the mesher is still running, if it takes long."""
    words = f"still tetrahedralizing: thin parts and small regions take long; given up after {TIME_LIMIT:g} s"
    timer = Timer(PROGRESS_AFTER_SECONDS, report, [words])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def solve_and_refine(
    mesh: TetMesh, problem: Problem, tolerances: Tolerances, most_tetrahedra: int, report: Report
) -> list[MeshSolution]:
    """Solve for all scenes on one mesh, refined until each is within the tolerances or the mesh as large as it may be.

    Parameters
    ----------
    mesh : TetMesh
        The first one.
    problem : Problem
    tolerances : Tolerances
    most_tetrahedra : int
        Largest number of tetrahedra after refinement; 0 to solve on the mesh as it is.
    report : callable
        Called with a line of text for each mesh.

    Returns
    -------
    list of MeshSolution
        One for each scene, all on the same mesh.
    """
    # The scene of the shortest mean free path needs the finest mesh. When that is found, the others are solved for.
    bodies = problem.scenes.bodies
    first, *pending = sorted(range(len(bodies)), key=lambda scene: bodies[scene].shortest_mean_free_path)
    layered = _with_layers(mesh, problem, tolerances, most_tetrahedra)
    solve_on = problem.solver_on(layered.mesh)
    steps = best_steps = {first: solve_on(first, None)}
    least_ratio = np.inf
    while True:
        with problem.watch.stage("solve"):
            found = tolerances.assess(list(steps.values()), layered.parents)
        if found.largest_error_ratio < least_ratio:
            best_steps, least_ratio = steps, found.largest_error_ratio
        report(f"solved on {len(layered.mesh.tetrahedra):,} tetrahedra: {found.summary}")
        fine_enough = not found.splits.any()
        if not fine_enough and len(layered.mesh.tetrahedra) < most_tetrahedra:
            with problem.watch.stage("mesh"):
                scenes = problem.scenes
                finer = refine_often(mesh, found.splits, scenes.surface, scenes.inner, most_tetrahedra)
                finer_layered = _with_layers(finer, problem, tolerances, most_tetrahedra)
            if len(finer_layered.mesh.tetrahedra) <= most_tetrahedra:
                # A mesh with layers is no refinement of another one.
                refines = layered.mesh is mesh and finer_layered.mesh is finer
                mesh, layered, solve_on = finer, finer_layered, problem.solver_on(finer_layered.mesh)
                steps = {scene: solve_on(scene, step if refines else None) for scene, step in steps.items()}
                continue
        if not pending:
            # Where refinement no longer reduces the error, an earlier mesh may have been better.
            chosen = steps if fine_enough else best_steps
            return [chosen[scene] for scene in range(len(bodies))]
        steps = best_steps = {**steps, **{scene: solve_on(scene, None) for scene in pending}}
        pending, least_ratio = [], np.inf


def _with_layers(mesh: TetMesh, problem: Problem, tolerances: Tolerances, most_tetrahedra: int) -> LayeredMesh:
    """The mesh with layers; without any if it is to be used as it is."""
    tolerance = tolerances.exitance or tolerances.readings
    if most_tetrahedra == 0 or tolerance is None:
        return LayeredMesh(mesh, np.arange(len(mesh.tetrahedra)))
    return problem.layers_on(mesh, tolerance)
