"""Which model solves each case: cases that leave it to the program are planned once for each group of like runs."""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace

from tetlux.cases.file.case import Case
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.outcome.plan import Plan
from tetlux.fem.planner.choose import plan_of
from tetlux.fem.planner.request import Request, make_request

AUTO = "auto"


def plan_models(cases: Sequence[Case]) -> list[Case]:
    """Give the cases that leave their model to the program a plan, the same to all runs of a group.

    Runs of a group have one body, the same kinds of media and lights, tolerances and outputs; the first is planned.

    Parameters
    ----------
    cases : sequence of Case

    Returns
    -------
    list of Case
    """
    planned = list(cases)
    for runs in _groups([number for number, case in enumerate(cases) if case.spec.model == AUTO], cases):
        plan = plan_case(cases[runs[0]], len(runs))
        for run in runs:
            planned[run] = replace(cases[run], plan=plan)
    return planned


def plan_groups(cases: Sequence[Case]) -> Iterator[tuple[Case, Plan]]:
    """The first case of each group of runs with the group's plan, whatever model the cases name."""
    for runs in _groups(range(len(cases)), cases):
        yield cases[runs[0]], plan_case(cases[runs[0]], len(runs))


def plan_case(case: Case, runs: int = 1) -> Plan:
    """The plan of a case, shared by so many runs."""
    return plan_of(request_of(case, runs))


def request_of(case: Case, runs: int = 1, *, cache: bool = True) -> Request:
    """What a case asks for; without `cache` past runs are neither looked at nor learned from."""
    return make_request(
        case.mesh or case.surface,
        [channel.media for channel in case.channels],
        [list(channel.lights.values()) for channel in case.channels],
        regions=case.regions,
        tolerances=case.tolerances,
        detectors=[entry.detector for entry in case.detectors],
        need_of_mesh=_need_of_mesh(case),
        runs=runs,
        cache=cache,
        frequency=case.frequencies,
        outside_index=case.outside_index,
    )


def _need_of_mesh(case: Case) -> str:
    """Why a case cannot do without a mesh; empty if it can."""
    # By default other models than "full" do without this output.
    if "volume" in case.outputs and (case.spec.model == AUTO or "outputs" in case.spec.model_fields_set):
        return "the output volume is the fluence on a mesh"
    if case.comparison is not None:
        return "compare is of finite elements"
    if case.fluorophores:
        return "what dyes emit is solved for on a mesh"
    if case.fit is not None:
        return "a fit is made by finite elements"
    return ""


def _groups(numbers: Sequence[int], cases: Sequence[Case]) -> list[list[int]]:
    """Numbers of runs, by what decides their model."""
    groups: dict[Hashable, list[int]] = {}
    for number in numbers:
        groups.setdefault(_key(cases[number]), []).append(number)
    return list(groups.values())


def _key(case: Case) -> Hashable:
    """What decides the model of a run, but for the values of its coefficients and places."""
    surfaces = (case.surface, case.mesh, *(region.surface for region in case.regions))
    kinds = tuple((type(channel.medium), *map(type, channel.lights.values())) for channel in case.channels)
    kinds_of_regions = tuple(type(medium) for region in case.regions for medium in _media_of(region))
    tolerances = (case.tolerance, case.detector_tolerance, case.everywhere_tolerance, case.volume_tolerance)
    needs = (_need_of_mesh(case), len(case.detectors), tuple(map(bool, case.frequencies)))
    return case.spec.model, tuple(map(id, surfaces)), kinds, kinds_of_regions, tolerances, needs


def _media_of(region: Region) -> Sequence[AnyMedium]:
    """The media of a region, one for each channel or one for all."""
    return [region.medium] if isinstance(region.medium, AnyMedium) else region.medium
