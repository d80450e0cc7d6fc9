"""Mesh a body, solve, estimate the error and refine, until the tolerance is met for every scene."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Timer
from typing import Protocol

import numpy as np

from tetlux.fem.assessment import Tolerances
from tetlux.fem.error.tolerance import MOST_ROUNDS
from tetlux.fem.grading.layers import Layers, refine_below, with_layers
from tetlux.fem.grading.near_sources import (
    LONGEST_EDGE,
    LONGEST_IF_FITTED,
    grade_between,
    grade_mesh,
    places_to_resolve,
)
from tetlux.fem.known.split import SplitLights
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.operators.assembly import Assembly, Lumping
from tetlux.fem.outcome.detectors import PlacedDetector
from tetlux.fem.scenes import Scenes
from tetlux.fem.shared import EXPECTED_LIGHTS, SharedMesh
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.system import MeshSolution, System
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.mesher.api import TIME_LIMIT, tetrahedralize
from tetlux.meshing.tets.mesh import TetMesh

# Refinement stops at this many tetrahedra unless told otherwise.
MOST_TETRAHEDRA = 1_000_000
# With room for fewer than this many times as many tetrahedra, and below layers, they are split in one round at a time.
ROOM = 5
# A shared mesh is graded for the lights of some runs. One that is good for them but for this factor serves for others.
SLACK = 1.3
# After this many seconds in the mesher a progress line appears.
PROGRESS_AFTER_SECONDS = 8.0

Report = Callable[[str], None]
# The media and the shift of a system.
SystemKind = tuple[tuple[AnyMedium, ...], complex]
# Solves for one scene on a mesh, given its number and its solution on the coarser mesh, if there was one.
SceneSolver = Callable[[int, MeshSolution | None], MeshSolution]


class Emitter(Protocol):
    """What is lit in one scene and lights another one, such as a dye."""

    @property
    def lit_in(self) -> int:
        """The number of the scene that lights it."""

    def lights_on(self, lit: MeshSolution, system: System) -> SplitLights:
        """Its light on a mesh, by the solution of the scene that lights it and the system of that."""

    def add_error(self, found: MeshSolution, lit: MeshSolution, system: System) -> MeshSolution:
        """The solution for its light with the error that comes from the scene that lights it."""


@dataclass(frozen=True, eq=False)
class Problem:
    """What is solved for: a body, the media and lights of each scene, and how.

    Attributes
    ----------
    scenes : Scenes
        The body and the media of each scene.
    lights : list of SplitLights
        The lights of each scene.
    lumping : {"lumped", "consistent"}
    limit : bool
        Whether the fluence is limited to be nonnegative, see `tetlux.fem.operators.limiter`.
    watch : Stopwatch
    shared : SharedMesh, optional
        The mesh to begin with, and what other problems have left on it.
    others : sequence of Deposit
        Lights of other problems that the first mesh is to be graded for too.
    emitters : mapping of int to Emitter
        By the number of the scene that they light, which comes after the one that lights them.
    """

    scenes: Scenes
    lights: list[SplitLights]
    lumping: Lumping
    limit: bool
    watch: Stopwatch
    shared: SharedMesh | None = None
    others: Sequence[Deposit] = ()
    emitters: Mapping[int, Emitter] = field(default_factory=dict)

    @property
    def groups(self) -> list[list[int]]:
        """Scenes that are solved for together; first those of the shortest mean free path, for the finest mesh."""
        groups: dict[int, list[int]] = {}
        for scene in range(len(self.lights)):
            first = self.emitters[scene].lit_in if scene in self.emitters else scene
            groups.setdefault(first, []).append(scene)
        bodies = self.scenes.bodies
        return sorted(groups.values(), key=lambda group: min(bodies[scene].shortest_mean_free_path for scene in group))

    @property
    def kinds(self) -> list[SystemKind]:
        """The media and the shift of each scene: scenes of the same have one system."""
        return list(zip(self.scenes.media, self.scenes.shifts, strict=True))

    @property
    def size(self) -> tuple[int, int]:
        """The numbers of matrices and of lights, which decide how much memory a mesh needs."""
        return len(set(self.kinds)), sum(len(split.deposits) for split in self.lights)

    def solver_on(self, mesh: TetMesh) -> SceneSolver:
        """A solver for single scenes on a mesh; scenes of the same media and shift share a matrix.

        A scene that an emitter lights is solved for after the one that lights it.
        """
        each = dict.fromkeys(self.kinds)
        if self.shared is not None and mesh is self.shared.mesh:
            systems = {kind: self._shared_system(self.shared, kind) for kind in each}
        else:
            assembly = Assembly(mesh)
            systems = {
                (media, shift): self.scenes.system_on(mesh, media, self.lumping, assembly, shift, limit=self.limit)
                for media, shift in each
            }
        found: dict[int, MeshSolution] = {}

        def solve(scene: int, coarser: MeshSolution | None) -> MeshSolution:
            system, emitter = systems[self.kinds[scene]], self.emitters.get(scene)
            if emitter is None:
                found[scene] = system.step(self.lights[scene], self.watch, coarser)
                return found[scene]
            lit, by = found[emitter.lit_in], systems[self.kinds[emitter.lit_in]]
            with self.watch.stage("assemble"):
                lights = emitter.lights_on(lit, by)
            step = system.step(lights, self.watch, coarser)
            with self.watch.stage("solve"):
                return emitter.add_error(step, lit, by)

        return solve

    def _shared_system(self, shared: SharedMesh, kind: SystemKind) -> System:
        media, shift = kind
        return shared.system(
            (media, self.lumping, self.limit, shift),
            lambda: self.scenes.system_on(
                shared.mesh, media, self.lumping, shared.assembly, shift, limit=self.limit, expected=EXPECTED_LIGHTS
            ),
        )


def layers_of(problem: Problem, tolerances: Tolerances) -> Layers | None:
    """The layers that meshes of a body have below surfaces that light covers, if any."""
    if problem.shared is not None or problem.emitters or tolerances.need_quadratic or tolerances.exitance is None:
        return None
    return Layers.for_lights([each for split in problem.lights for each in split.deposits], tolerances.exitance)


def first_mesh(
    problem: Problem,
    tolerances: Tolerances,
    most_tetrahedra: int,
    report: Report,
    *,
    cache: bool,
    layers: Layers | None = None,
) -> tuple[TetMesh, Layers | None]:
    """The mesher's or a shared mesh of a body, refined towards its lights, and between them and detectors.

    Lights for which there are layers do not refine it. Returns the layers too, if they serve.
    """
    scenes = problem.scenes
    with problem.watch.stage("mesh"):
        if problem.shared is not None:
            mesh = problem.shared.mesh
        else:
            with _report_if_slow(report):
                mesh = tetrahedralize(scenes.surface, scenes.inner, cache=cache)
        if layers is not None and not layers.serve(mesh, scenes.surface, most_tetrahedra):
            layers = None
        slack = 1.0 if problem.shared is None else SLACK
        for fitted, longest in ((False, slack * LONGEST_EDGE), (True, slack * LONGEST_IF_FITTED)):
            deposits = [each for split in problem.lights for each in split.deposits_if(fitted=fitted)]
            deposits = [each for each in deposits if layers is None or each.hints.depth == 0]
            # The lights of others are taken to be of the same kind.
            source_points = places_to_resolve([*deposits, *problem.others] if deposits else [])
            mesh = grade_mesh(
                mesh, scenes.surface, *source_points, most_tetrahedra, longest=longest, inner=scenes.inner
            )
        if layers is not None:
            elsewhere = layers.places_without(scenes.surface)
            mesh = grade_mesh(mesh, scenes.surface, *elsewhere, most_tetrahedra, inner=scenes.inner)
        if tolerances.readings is not None:
            ways = _ways_of_light(problem, tolerances)
            for media, shift in dict.fromkeys(problem.kinds):
                mesh = grade_between(
                    mesh,
                    scenes.surface,
                    scenes.inner,
                    media,
                    ways,
                    tolerances.readings,
                    most_tetrahedra,
                    shift,
                )
    begin = "tetrahedralized" if problem.shared is None else "began with the mesh it was given"
    report(f"{begin}: {len(mesh.tetrahedra):,} tetrahedra")
    return mesh, layers


def _ways_of_light(problem: Problem, tolerances: Tolerances) -> list[tuple[FloatArray, FloatArray]]:
    """Where light is deposited, (s, 3), and where it is read, (d, 3), for scenes of the same detectors together."""
    by_detectors: dict[tuple[PlacedDetector, ...], list[Deposit]] = {}
    for scene, split in enumerate(problem.lights):
        by_detectors.setdefault(tolerances.placed_in(scene), []).extend(split.deposits)
    return [
        (places_to_resolve(deposits)[0], np.array([placed.position for placed in detectors]))
        for detectors, deposits in by_detectors.items()
        if deposits and detectors
    ]


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
    mesh: TetMesh,
    problem: Problem,
    tolerances: Tolerances,
    most_tetrahedra: int,
    report: Report,
    layers: Layers | None = None,
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
    layers : Layers, optional
        Those that are put on each mesh: what is refined is the mesh below.

    Returns
    -------
    list of MeshSolution
        One for each scene, all on the same mesh.
    """
    # When the mesh is found that the first scenes need, the others are solved for.
    first, *others = problem.groups
    pending = [scene for group in others for scene in group]
    base, (mesh, parents) = mesh, with_layers(mesh, layers)
    solve_on = problem.solver_on(mesh)
    steps = best_steps = {scene: solve_on(scene, None) for scene in first}
    least_ratio = np.inf
    while True:
        with problem.watch.stage("solve"):
            once = layers is not None or ROOM * len(mesh.tetrahedra) > most_tetrahedra
            found = tolerances.assess(steps, rounds=1 if once else MOST_ROUNDS)
        higher = layers
        if layers is not None:
            layers = layers.scaled(found.heights)
        if found.largest_error_ratio < least_ratio:
            best_steps, least_ratio = steps, found.largest_error_ratio
        report(f"solved on {len(mesh.tetrahedra):,} tetrahedra: {found.summary}")
        fine_enough = not found.splits.any() and layers is higher
        if not fine_enough and len(mesh.tetrahedra) < most_tetrahedra:
            with problem.watch.stage("mesh"):
                surfaces = problem.scenes.surface, problem.scenes.inner
                below, finer, owners = refine_below(base, parents, found.splits, surfaces, most_tetrahedra, layers)
            if len(finer.tetrahedra) <= most_tetrahedra:
                base, mesh, parents, solve_on = below, finer, owners, problem.solver_on(finer)
                # Patches are inherited from meshes with the same nodes, which layers move.
                steps = {scene: solve_on(scene, step if layers is None else None) for scene, step in steps.items()}
                continue
        if not pending:
            # Where refinement no longer reduces the error, an earlier mesh may have been better.
            chosen = steps if fine_enough else best_steps
            return [chosen[scene] for scene in range(len(problem.lights))]
        steps = best_steps = {**steps, **{scene: solve_on(scene, None) for scene in pending}}
        pending, least_ratio = [], np.inf
