"""From a body, a medium and lights to a `Solution`: mesh, solve, estimate, refine."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tetlux.fem.assembly import Mass
from tetlux.fem.grading import graded_towards, lit_points
from tetlux.fem.lights.deposit import Light
from tetlux.fem.medium import Medium
from tetlux.fem.solution import Solution
from tetlux.fem.sources import Subtract, sources_of
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.system import Step, System
from tetlux.fem.validity import check_scattering, check_size, warnings_for
from tetlux.meshing.arrays import BoolArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.mesher import tetrahedralize
from tetlux.meshing.refine import refine
from tetlux.meshing.surface import Surface
from tetlux.meshing.tetmesh import TetMesh

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
MOST_TETRAHEDRA = 1_000_000


def solve(
    body: Surface | TetMesh,
    medium: Medium,
    lights: Sequence[Light],
    *,
    tolerance: float = 0.02,
    mesh: TetMesh | None = None,
    mass: Mass = "lumped",
    subtract: Subtract = "half-space",
    most_tetrahedra: int = MOST_TETRAHEDRA,
    cache: bool = True,
    report: Callable[[str], None] = lambda _: None,
) -> Solution:
    """Solve for the light in a body.

    A `Surface` is tetrahedralized and refined until the estimated error of the exitance is within the
    tolerance; a `TetMesh` is used as it is.

    Parameters
    ----------
    body : Surface or TetMesh
    medium : Medium
    lights : sequence of Light
        At least one; they add up.
    tolerance : float
        Wanted relative L2 error of the exitance over the surface.
    mesh : TetMesh, optional
        Use this mesh of the body as it is.
    mass : {"lumped", "consistent"}
        Integration of the terms without derivatives, see `tetlux.fem.assembly.system_matrix`.
    subtract : {"half-space", "free-space", "nothing"}
        What is taken off the fluence of point sources in closed form before the rest is solved for, see
        `tetlux.fem.subtraction`.
    most_tetrahedra : int
        Where refinement stops even if the tolerance is not met; the solution then carries a warning. The
        mesher's own mesh, of some thousands, is the least.
    cache : bool
        Whether the mesher's mesh is looked up and kept in the user's cache directory.
    report : callable
        Called with a line of text as each stage ends.

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        If the tolerance, the body's size or a light is not sensible: see each light.
    RunError
        If the mesher or the linear solver fails.

    Notes
    -----
    The error is estimated by a dual solution, see `tetlux.fem.estimate`; the tetrahedra that make most of it are
    split, until it is within the tolerance. It is the error of the discretisation, not that of the diffusion
    approximation.
    """
    return solve_each(
        body,
        medium,
        [lights],
        tolerance=tolerance,
        mesh=mesh,
        mass=mass,
        subtract=subtract,
        most_tetrahedra=most_tetrahedra,
        cache=cache,
        report=report,
    )[0]


def solve_each(
    body: Surface | TetMesh,
    medium: Medium,
    scenes: Sequence[Sequence[Light]],
    *,
    tolerance: float = 0.02,
    mesh: TetMesh | None = None,
    mass: Mass = "lumped",
    subtract: Subtract = "half-space",
    most_tetrahedra: int = MOST_TETRAHEDRA,
    cache: bool = True,
    report: Callable[[str], None] = lambda _: None,
) -> list[Solution]:
    """Solve for several lights, each on its own, on one mesh that is fine enough for every one of them.

    Parameters
    ----------
    body, medium, tolerance, mesh, mass, subtract, most_tetrahedra, cache, report
        As in `solve`.
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
    if not 1e-4 <= tolerance < 1:
        raise InputError(f"tolerance is {tolerance:g}; give a relative error between 0.0001 and 1, such as 0.02.")
    if len(scenes) == 0:
        raise InputError("there is no scene; give the lights of at least one.")
    if isinstance(body, TetMesh):
        if mesh is not None:
            raise InputError("a mesh is given twice; give it as the body, or a surface and its mesh.")
        mesh = body
    if mesh is not None and mesh.unit != body.unit:
        raise InputError(f"the mesh is in {mesh.unit} and the surface in {body.unit}; give both in one unit.")
    watch = Stopwatch()
    with watch.stage("surface"):
        surface = body.surface if isinstance(body, TetMesh) else body
        check_scattering(medium)
        check_size(surface, medium)
        scene_sources = [sources_of(lights, surface, medium, subtract) for lights in scenes]

    def steps_on(mesh: TetMesh, before: list[Step] | None) -> list[Step]:
        with watch.stage("assemble"):
            system = System(mesh, medium, surface, mass, expected=len(scenes))
        return [system.step(sources, watch, before[i] if before else None) for i, sources in enumerate(scene_sources)]

    given = mesh is not None
    if mesh is None:
        with watch.stage("mesh"):
            mesh = tetrahedralize(surface, cache=cache)
            deposits = [deposit for sources in scene_sources for deposit in sources.deposits]
            mesh = graded_towards(mesh, surface, *lit_points(deposits, medium), most_tetrahedra)
        report(f"tetrahedralized: {len(mesh.tetrahedra):,} tetrahedra")
    steps = best = steps_on(mesh, None)
    least = np.inf
    while True:
        worst = max(step.estimate.error for step in steps)
        if worst < least:
            best, least = steps, worst
        report(f"solved on {len(mesh.tetrahedra):,} tetrahedra: estimated error {worst:.2%}")
        marked = _to_split(steps, tolerance)
        if given or not marked.any():
            break
        with watch.stage("mesh"):
            finer = refine(mesh, marked, surface)
        if len(finer.tetrahedra) > most_tetrahedra:
            # Where refinement does not help any more, an earlier mesh may have been the better one.
            steps = best
            break
        mesh = finer
        steps = steps_on(mesh, steps)
    limit = None if given else most_tetrahedra
    seconds = watch.read()
    return [
        replace(
            step.solution,
            seconds=seconds,
            warnings=_warnings(step.solution, sources.warnings, tolerance, limit),
        )
        for step, sources in zip(steps, scene_sources, strict=True)
    ]


def _to_split(steps: list[Step], tolerance: float) -> BoolArray:
    """The tetrahedra to split, (m,): of each solution the fewest that bring its errors towards the tolerance."""
    marked = np.zeros(len(steps[0].estimate.shares), dtype=bool)
    wanted = [(step.estimate.shares, SAFETY * tolerance) for step in steps]
    wanted += [(step.estimate.power_shares, POWER_SAFETY * tolerance) for step in steps]
    for shares, aim in wanted:
        error = float(shares.sum())
        if error <= aim:
            continue
        part = float(np.clip((1.0 - aim / error) / GAIN, LEAST_SHARE, SPLIT_SHARE))
        order = np.argsort(-shares)
        reached = np.cumsum(shares[order])
        marked[order[: int(np.searchsorted(reached, part * reached[-1])) + 1]] = True
    return marked


def _warnings(solution: Solution, of_lights: list[str], tolerance: float, most_tetrahedra: int | None) -> list[str]:
    """What a user should know of a solution; the limit is None for a mesh that was given."""
    warnings = [*solution.surface.warnings, *warnings_for(solution.surface, solution.medium), *of_lights]
    if solution.error_estimate > tolerance:
        where = "on the mesh given" if most_tetrahedra is None else f"at the limit of {most_tetrahedra:,} tetrahedra"
        warnings.append(
            f"the tolerance of {tolerance:g} was not met: the estimated error is {solution.error_estimate:.2g}, "
            f"{where}."
        )
    bulge = solution.surface.bulge
    if abs(bulge) > LARGEST_BULGE:
        warnings.append(
            f"the body is taken as smooth, which changes its volume by about {bulge:+.1%}; give it more triangles, or "
            "a crease_angle of 0 if they are meant to be flat."
        )
    power = solution.power
    if min(power.absorbed, power.exited) < -NEGLIGIBLE_POWER * power.incident:
        warnings.append(
            "absorbed or exited power is negative: the mesh is far too coarse for this light; ask for a smaller "
            "tolerance, or give a finer mesh."
        )
    if solution.power.exited == 0.0:
        warnings.append(
            "no light leaves the body: all of it is reflected at its surface, passes through or is absorbed."
        )
    lowest = float(solution.fluence.min())
    if lowest < -NEGLIGIBLE_DIP * float(solution.fluence.max()):
        warnings.append(
            f"the fluence dips below zero, to {lowest / float(solution.fluence.max()):.1e} of its largest value, where "
            "tetrahedra are obtuse and light is scarce; ask for a smaller tolerance."
        )
    return list(dict.fromkeys(warnings))
