"""From a body, a medium and lights to a `Solution`: mesh, solve, estimate, refine."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from threading import Timer
from typing import Any, Literal, overload

import numpy as np

from tetlux.fem.charges.solution import ChargeSolution
from tetlux.fem.charges.solve import solve_with_charges
from tetlux.fem.error.estimate import ROUNDING
from tetlux.fem.grading import graded_towards, lit_points
from tetlux.fem.known.split import Sources, Subtract, check_list, sources_of
from tetlux.fem.labelled import GivenMedia
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.memory import check_memory, limited_by_memory
from tetlux.fem.operators.assembly import Assembly, Mass
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.scene import Scene, channels_of, scene_of
from tetlux.fem.sources.deposit import Light
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.system import Step
from tetlux.fem.validity.notes import warnings_for
from tetlux.meshing.arrays import BoolArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.mesher.api import TIME_LIMIT, tetrahedralize
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.refine import refine

# A fluence below zero by less than this share of its maximum is not worth a sentence.
NEGLIGIBLE_DIP = 1e-6
# And the same of power, by that which is incident.
NEGLIGIBLE_POWER = 1e-4
# A body that grows by more than this share as its triangles are taken for a smooth surface is worth a sentence.
LARGEST_BULGE = 0.015
# From mesh to mesh those tetrahedra are split that make up this share of the estimated error, or as little as is
# needed: to split them takes this part of their error away. A step is never too small to be worth its solution.
SPLIT_SHARE, GAIN, LEAST_SHARE = 0.8, 0.4, 0.3
# Refinement goes on until the estimate is this share of the tolerance, and that of the power that leaves another one.
SAFETY, POWER_SAFETY = 0.65, 0.4
# An error that is above what is aimed at by less than this is not worth another mesh.
WORTH_A_MESH = 1.05
MOST_TETRAHEDRA = 1_000_000
# A source whose depth the mesh's facets change by more than this share of it is worth a sentence.
SHALLOW = 0.1
# After this many seconds in the mesher a progress line appears.
SLOW = 8.0


@overload
def solve(  # type: ignore[overload-overlap]  # a list of channels may be among media by label
    body: Surface | TetMesh,
    medium: AnyMedium | Mapping[Any, AnyMedium],
    lights: Sequence[Light],
    *,
    regions: Sequence[Region] = ...,
    tolerance: float = ...,
    mesh: TetMesh | None = ...,
    mass: Mass = ...,
    subtract: Subtract = ...,
    limit: bool = ...,
    most_tetrahedra: int = ...,
    cache: bool = ...,
    report: Callable[[str], None] = ...,
    model: Literal["full"] = ...,
) -> Solution: ...


@overload
def solve(
    body: Surface | TetMesh,
    medium: Sequence[AnyMedium | Mapping[Any, AnyMedium]] | Mapping[Any, AnyMedium | Sequence[AnyMedium]],
    lights: Sequence[Light],
    *,
    regions: Sequence[Region] = ...,
    tolerance: float = ...,
    mesh: TetMesh | None = ...,
    mass: Mass = ...,
    subtract: Subtract = ...,
    limit: bool = ...,
    most_tetrahedra: int = ...,
    cache: bool = ...,
    report: Callable[[str], None] = ...,
    model: Literal["full"] = ...,
) -> list[Solution]: ...


@overload
def solve(
    body: Surface | TetMesh,
    medium: AnyMedium | Sequence[AnyMedium],
    lights: Sequence[Light],
    *,
    model: Literal["charges"],
    regions: Sequence[Region] = ...,
    tolerance: float = ...,
) -> ChargeSolution: ...


def solve(
    body: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    lights: Sequence[Light],
    *,
    regions: Sequence[Region] = (),
    tolerance: float = 0.02,
    mesh: TetMesh | None = None,
    mass: Mass = "lumped",
    subtract: Subtract = "half-space",
    limit: bool = True,
    most_tetrahedra: int = MOST_TETRAHEDRA,
    cache: bool = True,
    report: Callable[[str], None] = lambda _: None,
    model: Literal["full", "charges"] = "full",
) -> Solution | list[Solution] | ChargeSolution:
    """Solve for the light in a body.

    A `Surface` is tetrahedralized and refined until the estimated error of the exitance is within the
    tolerance; a `TetMesh` is used as it is, with a medium for each label of its tetrahedra if it has several.

    Parameters
    ----------
    body : Surface or TetMesh
    medium : Medium, VaryingMedium, mapping of label to these, or sequence of these
        Of the body, or of each label of a mesh, by its number or name. Several are channels (wavelengths, or red, green
        and blue): all are solved on one mesh that is fine enough for every one of them. The media of a label may be a
        list of channels too.
    lights : sequence of Light
        At least one; they add up.
    regions : sequence of Region
        Parts of the body with media of their own.
    tolerance : float
        Wanted relative L2 error of the exitance over the surface.
    mesh : TetMesh, optional
        Use this mesh of the body as it is.
    mass : {"lumped", "consistent"}
        Integration of the terms without derivatives, see `tetlux.fem.operators.assembly.system_matrix`.
    subtract : {"half-space", "free-space", "nothing"}
        What is taken off the fluence of point sources in closed form before the rest is solved for, see
        `tetlux.fem.known`.
    limit : bool
        Whether the fluence is kept from going below zero where lumping does not see to that, see
        `tetlux.fem.operators.limiter`.
    most_tetrahedra : int
        Where refinement stops even if the tolerance is not met; the solution then carries a warning. The
        mesher's own mesh, of some thousands, is the least. It stops earlier where memory is scarce.
    cache : bool
        Whether the mesher's mesh is looked up and kept in the user's cache directory.
    report : callable
        Called with a line of text as each stage ends.
    model : {"full", "charges"}
        "full" is finite elements. "charges" needs no mesh: screened charges outside the body are fitted to its
        surface, see `tetlux.fem.charges`; for points, beams that are points, and diffuse light in even regions. Of
        the other arguments it takes `regions` and `tolerance`.

    Returns
    -------
    Solution, list of Solution, or ChargeSolution
        One for each channel, if `medium` is a sequence, or one of its labels has a sequence. A ChargeSolution for
        ``model="charges"``.

    Raises
    ------
    InputError
        If the tolerance, the body's size or a light is not sensible: see each light.
    RunError
        If the mesher or the linear solver fails, or the mesh needs more memory than there is.

    Notes
    -----
    The error is estimated by a dual solution, see `tetlux.fem.error.estimate`; the tetrahedra that make most of it are
    split, until it is within the tolerance. It is the error of the discretisation, not that of the diffusion
    approximation.
    """
    if model not in ("full", "charges"):
        raise InputError(f'model is "{model}"; it is "full" or "charges".')
    if model == "charges":
        return _without_mesh(body if mesh is None else mesh, medium, lights, regions, tolerance)
    channels, several = channels_of(body, mesh, medium)
    solutions = solve_each(
        body,
        channels,
        [lights] * len(channels),
        regions=regions,
        tolerance=tolerance,
        mesh=mesh,
        mass=mass,
        subtract=subtract,
        limit=limit,
        most_tetrahedra=most_tetrahedra,
        cache=cache,
        report=report,
    )
    return solutions if several else solutions[0]


def solve_each(
    body: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    scenes: Sequence[Sequence[Light]],
    *,
    regions: Sequence[Region] = (),
    tolerance: float = 0.02,
    mesh: TetMesh | None = None,
    mass: Mass = "lumped",
    subtract: Subtract = "half-space",
    limit: bool = True,
    most_tetrahedra: int = MOST_TETRAHEDRA,
    cache: bool = True,
    report: Callable[[str], None] = lambda _: None,
) -> list[Solution]:
    """Solve for several lights, each on its own, on one mesh that is fine enough for every one of them.

    Parameters
    ----------
    body, regions, tolerance, mesh, mass, subtract, limit, most_tetrahedra, cache, report
        As in `solve`.
    medium : Medium, VaryingMedium, mapping of label to these, or sequence of these
        That of all scenes, or of each.
    scenes : sequence of sequences of Light
        The lights of one scene add up; each scene has a solution of its own.

    Returns
    -------
    list of Solution
        One for each scene; their seconds are those of all of them.

    Raises
    ------
    InputError, RunError
        As in `solve`.
    """
    _check_tolerance(tolerance)
    if not isinstance(scenes, Sequence):
        raise InputError("scenes are given in a list, and the lights of each in a list; write [[light], [another]].")
    for lights in scenes:
        check_list(lights)
    if len(scenes) == 0:
        raise InputError("there is no scene; give the lights of at least one.")
    if isinstance(body, TetMesh):
        if mesh is not None:
            raise InputError("a mesh is given twice; give it as the body, or a surface and its mesh.")
        mesh = body
    watch = Stopwatch()
    with watch.stage("surface"):
        scene = scene_of(body, mesh, medium, regions, len(scenes))
        surface, inner, media = scene.surface, scene.inner, scene.media
        sources = [
            sources_of(lights, its_body, subtract) for lights, its_body in zip(scenes, scene.bodies, strict=True)
        ]
    work = _Work(scene, sources, mass, limit, watch)
    given = mesh is not None
    size = len(set(media)), sum(map(len, scenes))
    most_tetrahedra, where = limited_by_memory(most_tetrahedra, *size)
    if mesh is None:
        with watch.stage("mesh"):
            with _told_if_slow(report):
                mesh = tetrahedralize(surface, inner, cache=cache)
            lit = lit_points([deposit for each in sources for deposit in each.deposits])
            mesh = graded_towards(mesh, surface, *lit, most_tetrahedra, inner=inner)
        report(f"tetrahedralized: {len(mesh.tetrahedra):,} tetrahedra")
    check_memory(len(mesh.tetrahedra), *size)
    steps = _refined(mesh, work, tolerance, 0 if given else most_tetrahedra, report)
    found = []
    for number, step in sorted(steps.items()):
        warnings = _warnings(step.solution, sources[number], tolerance, "on the mesh given" if given else where)
        warnings += scene.warnings(number, step.solution, given=given)
        found.append(replace(step.solution, warnings=list(dict.fromkeys(warnings))))
    seconds = watch.read()
    return [replace(solution, seconds=seconds) for solution in found]


def _without_mesh(
    body: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    lights: Sequence[Light],
    regions: Sequence[Region],
    tolerance: float,
) -> ChargeSolution:
    """Solve by charges, if that can be."""
    if isinstance(body, TetMesh):
        raise InputError('model "charges" takes no mesh; give the surface, or solve with model "full".')
    if not isinstance(medium, AnyMedium):
        raise InputError('model "charges" takes one medium at a time; call it once for each channel.')
    _check_tolerance(tolerance)
    check_list(lights)
    if len(lights) == 0:
        raise InputError("there is no light; give at least one.")
    return solve_with_charges(body, medium, lights, regions=regions, tolerance=tolerance)


def _check_tolerance(tolerance: float) -> None:
    if not 1e-4 <= tolerance < 1:
        raise InputError(f"tolerance is {tolerance:g}; give a relative error between 0.0001 and 1, such as 0.02.")


@contextmanager
def _told_if_slow(report: Callable[[str], None]) -> Iterator[None]:
    """Say what takes so long, if the mesher does."""
    words = f"still tetrahedralizing: thin parts and small regions take long; given up after {TIME_LIMIT:g} s"
    timer = Timer(SLOW, report, [words])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@dataclass(frozen=True, eq=False)
class _Work:
    """What is solved for: a body, the media and lights of each scene, and how."""

    scene: Scene
    sources: list[Sources]
    mass: Mass
    limit: bool
    watch: Stopwatch

    @property
    def media(self) -> list[tuple[AnyMedium, ...]]:
        """The media of each scene."""
        return self.scene.media

    def solver_on(self, mesh: TetMesh) -> Callable[[int, Step | None], Step]:
        """What solves for one scene on a mesh, given its solution on the mesh before; scenes share what they can."""
        assembly = Assembly(mesh)
        systems = {
            media: self.scene.system_on(mesh, media, self.mass, assembly, limit=self.limit)
            for media in dict.fromkeys(self.media)
        }
        return lambda scene, before: systems[self.media[scene]].step(self.sources[scene], self.watch, before)


def _refined(
    mesh: TetMesh, work: _Work, tolerance: float, most_tetrahedra: int, report: Callable[[str], None]
) -> dict[int, Step]:
    """Solutions of all scenes on one mesh, refined until it is fine enough or has as many tetrahedra as it may."""
    # The scene of the shortest mean free path needs the finest mesh: the others are solved for when that is found.
    bodies = work.scene.bodies
    order = sorted(range(len(bodies)), key=lambda scene: bodies[scene].shortest_mean_free_path)
    first, *pending = order
    solve_on = work.solver_on(mesh)
    steps = best = {first: solve_on(first, None)}
    least = np.inf
    while True:
        worst = max(step.estimate.error for step in steps.values())
        if worst < least:
            best, least = steps, worst
        report(f"solved on {len(mesh.tetrahedra):,} tetrahedra: estimated error {worst:.2%}")
        marked = _to_split(list(steps.values()), tolerance)
        fine_enough = not marked.any()
        if not fine_enough and len(mesh.tetrahedra) < most_tetrahedra:
            with work.watch.stage("mesh"):
                finer = refine(mesh, marked, work.scene.surface, work.scene.inner)
            if len(finer.tetrahedra) <= most_tetrahedra:
                mesh, solve_on = finer, work.solver_on(finer)
                steps = {scene: solve_on(scene, step) for scene, step in steps.items()}
                continue
        if not pending:
            # Where refinement does not help any more, an earlier mesh may have been the better one.
            return steps if fine_enough else best
        steps = best = {**steps, **{scene: solve_on(scene, None) for scene in pending}}
        pending, least = [], np.inf


def _to_split(steps: list[Step], tolerance: float) -> BoolArray:
    """The tetrahedra to split, (m,): of each solution the fewest that bring its errors towards the tolerance."""
    marked = np.zeros(len(steps[0].estimate.shares), dtype=bool)
    wanted = [(step.estimate.shares, SAFETY * tolerance) for step in steps]
    wanted += [(step.estimate.power_shares, POWER_SAFETY * tolerance) for step in steps]
    for shares, aim in wanted:
        error = float(shares.sum())
        if error <= WORTH_A_MESH * aim:
            continue
        part = float(np.clip((1.0 - aim / error) / GAIN, LEAST_SHARE, SPLIT_SHARE))
        order = np.argsort(-shares)
        reached = np.cumsum(shares[order])
        marked[order[: int(np.searchsorted(reached, part * reached[-1])) + 1]] = True
    return marked


def _warnings(solution: Solution, sources: Sources, tolerance: float, where: str) -> list[str]:
    """What a user should know of a solution, and where refinement stopped."""
    warnings = list(solution.surface.warnings)
    if solution.validity is not None:
        warnings += warnings_for(solution.surface, solution.validity)
    warnings += [*sources.warnings, *solution.warnings]
    if not solution.error_estimate <= tolerance:
        warnings.append(
            Note(
                "tolerance-missed",
                f"the tolerance of {tolerance:g} was not met: the estimated error is {solution.error_estimate:.2g}, "
                f"{where}.",
                value=solution.error_estimate,
            )
        )
    bulge = solution.surface.bulge
    if abs(bulge) > LARGEST_BULGE:
        warnings.append(
            Note(
                "surface-bulges",
                f"the body is taken as smooth, which changes its volume by about {bulge:+.1%}; give it more triangles, "
                "or a crease_angle of 0 if they are meant to be flat.",
                value=bulge,
            )
        )
    power = solution.power
    if min(power.absorbed, power.exited) < -NEGLIGIBLE_POWER * power.incident:
        warnings.append(
            Note(
                "power-negative",
                "absorbed or exited power is negative: the mesh is far too coarse for this light; ask for a smaller "
                "tolerance, or give a finer mesh.",
            )
        )
    if abs(solution.power.exited) <= ROUNDING * solution.power.incident:
        warnings.append(
            Note(
                "no-light-leaves",
                "no light leaves the body: all of it is reflected at its surface, passes through or is absorbed.",
            )
        )
    lowest = float(solution.fluence.min())
    if lowest < -NEGLIGIBLE_DIP * float(solution.fluence.max()):
        cause = (
            "beside where a thin beam enters, as the diffusion equation itself has it; read it a mean free path away."
            if sources.dips
            else "where tetrahedra are obtuse and light is scarce; ask for a smaller tolerance."
        )
        share = lowest / float(solution.fluence.max())
        warnings.append(
            Note(
                "fluence-negative",
                f"the fluence dips below zero, to {share:.1e} of its largest value, {cause}",
                value=share,
            )
        )
    if solution.moved > NEGLIGIBLE_POWER * power.incident:
        warnings.append(
            Note(
                "power-moved",
                f"{solution.moved / power.incident:.2%} of the power was moved between nodes to keep the fluence from "
                "going below zero, where tetrahedra are too coarse or too flat for light that fades so fast; ask for a "
                "smaller tolerance, or give a finer mesh.",
                value=solution.moved / power.incident,
            )
        )
    warnings += _shallow(solution)
    brightest = float(np.max(solution.transmitted_irradiance))
    if brightest > 0 and solution.exitance.min() < -NEGLIGIBLE_DIP * brightest:
        shallowest = 1.0 / solution.validity.steepest if solution.validity else np.nan
        warnings.append(
            Note(
                "exitance-negative",
                "the exitance is below zero in places: the layer in which diffuse light is absorbed, "
                f"{shallowest:.2g} {solution.surface.unit} deep, is finer than the tetrahedra, or the "
                "medium absorbs so much that light does not diffuse in it; do not rely on what leaves.",
            )
        )
    return list(dict.fromkeys(warnings))


def _shallow(solution: Solution) -> list[str]:
    """What to say of sources that are much nearer to, or farther from, the mesh's facets than to the surface."""
    for patch in solution.patches:
        sources = patch.charges.positions[: patch.charges.sources]
        if len(sources) == 0:
            continue
        depths = np.linalg.norm(solution.surface.closest(sources)[0] - sources, axis=1)
        below_facets = np.linalg.norm(solution.mesh.closest_boundary(sources)[0] - sources, axis=1)
        off = np.abs(below_facets - depths)
        worst = int(np.argmax(off / depths))
        if off[worst] > SHALLOW * depths[worst]:
            return [
                Note(
                    "source-depth-off",
                    f"a source {depths[worst]:.2g} {solution.mesh.unit} below the surface is {below_facets[worst]:.2g} "
                    "below the mesh's facets, and what leaves above it may be off by as much; give a finer mesh, or "
                    "put it deeper.",
                )
            ]
    return []
