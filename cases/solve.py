"""`solve_case`: solve each channel of a case by its model."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from tetlux.cases.file.case import Case
from tetlux.cases.planning import AUTO, request_of
from tetlux.fem.dyes.solve import solve_pairs
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.meshless import ChargeSolution
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.planner.choose import plan_of
from tetlux.fem.planner.solve import (
    AnySolution,
    FiniteElements,
    report_plan,
    solve_by_plan,
    solve_closed_forms,
    solve_on_part,
)
from tetlux.fem.scenes import media_by_scene
from tetlux.fem.shared import SharedMesh
from tetlux.fem.solve import solve
from tetlux.fem.solve_scenes import solve_each
from tetlux.fem.transient.solve import solve_in_time
from tetlux.fem.transient.transient import Transient
from tetlux.meshing.surface.surface import Surface

Report = Callable[[str], None]


def solve_case(case: Case, report: Report, *, cache: bool, start: SharedMesh | None = None) -> Sequence[AnySolution]:
    """Solve each channel by the model of the case; `start` is the mesh that finite elements begin with."""
    model = case.spec.model

    def solve_fully() -> list[Solution]:
        return _solve_fully(case, report, cache=cache, start=start)

    def solve_part(
        part: Surface, media: Sequence[AnyMedium], regions: Sequence[Region], begin: SharedMesh
    ) -> list[Solution]:
        return _solve_fully(case, report, cache=cache, start=begin, part=(part, media, regions))

    elements = FiniteElements(solve_fully, solve_part, cache)
    if model == AUTO:
        request = request_of(case, case.plan.runs if case.plan else 1, cache=cache)
        plan = case.plan or plan_of(request)
        report_plan(plan, report)
        return solve_by_plan(request, elements, report, plan=plan)
    if model == "closed-form":
        return solve_closed_forms(request_of(case))
    if model == "truncated":
        return solve_on_part(request_of(case), elements, report)
    return _solve_with_charges(case, report) if model == "charges" else solve_fully()


def _solve_fully(
    case: Case,
    report: Report,
    *,
    cache: bool,
    start: SharedMesh | None = None,
    part: tuple[Surface, Sequence[AnyMedium], Sequence[Region]] | None = None,
) -> list[Solution]:
    """Solve all channels by finite elements, on one mesh; of a part of the body if its surface, media, and regions."""
    if case.fluorophores:
        return _solve_dyes(case, report, cache=cache)
    whole = case.mesh or case.surface, [channel.media for channel in case.channels], case.regions
    body, media, regions = part or whole
    return solve_each(
        body,
        media,
        [list(channel.lights.values()) for channel in case.channels],
        regions=regions,
        tolerance=case.tolerance,
        detectors=[entry.detector for entry in case.detectors],
        detector_tolerance=case.detector_tolerance,
        start=start,
        everywhere_tolerance=case.everywhere_tolerance,
        volume_tolerance=case.volume_tolerance,
        cache=cache,
        report=report,
        frequency=case.frequencies,
        outside_index=case.outside_index,
    )


def solve_pulse(case: Case, report: Report, *, cache: bool) -> list[Transient]:
    """Solve each channel in time."""
    return solve_in_time(
        case.mesh or case.surface,
        [channel.media for channel in case.channels],
        [list(channel.lights.values()) for channel in case.channels],
        case.times,
        {
            "regions": case.regions,
            "tolerance": case.tolerance,
            "detectors": [entry.detector for entry in case.detectors],
            "detector_tolerance": case.detector_tolerance,
            "cache": cache,
            "report": report,
            "outside_index": case.outside_index,
        },
    )


def _solve_dyes(case: Case, report: Report, *, cache: bool) -> list[Solution]:
    """Solve for the light that excites dyes and for what they emit, in the order of the channels."""
    count = len(case.excitations)
    media = [channel.media for channel in case.channels]
    pairs = solve_pairs(
        case.mesh or case.surface,
        media[:count],
        media[count:],
        [list(channel.lights.values()) for channel in case.excitations],
        case.fluorophores,
        regions=case.regions,
        tolerances=case.tolerances,
        detectors=[entry.detector for entry in case.detectors],
        mesh=case.mesh,
        frequency=[channel.frequency for channel in case.excitations],
        outside_index=case.outside_index,
        cache=cache,
        report=report,
    )
    return [*(lit for lit, _ in pairs), *(glowing for _, glowing in pairs)]


def _solve_with_charges(case: Case, report: Report) -> list[ChargeSolution]:
    """Solve each channel by charges; the seconds of each solution are those of all channels together."""
    solutions = []
    media = media_by_scene([channel.medium for channel in case.channels], case.regions, len(case.channels))
    for channel, (body, *inner) in zip(case.channels, media, strict=True):
        regions = [Region(region.surface, medium) for region, medium in zip(case.regions, inner, strict=True)]
        lights = list(channel.lights.values())
        solution = solve(
            case.surface,
            body,
            lights,
            regions=regions,
            tolerance=case.tolerance,
            detectors=[entry.detector for entry in case.detectors] if case.detector_tolerance else (),
            detector_tolerance=case.detector_tolerance,
            model="charges",
            frequency=channel.frequency,
            outside_index=case.outside_index,
        )
        where = f"{channel.name}: " if len(case.channels) > 1 else ""
        report(f"{where}fitted {solution.charges:,} charges: estimated error {solution.error_estimate:.2%}")
        solutions.append(solution)
    seconds = {stage: sum(solution.seconds[stage] for solution in solutions) for stage in solutions[0].seconds}
    return [replace(solution, seconds=seconds) for solution in solutions]
