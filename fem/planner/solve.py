"""`solve_by_plan`: solve by the model that a plan chooses, and by the next one where that misses the tolerance."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from tetlux.fem.media.region import Region
from tetlux.fem.meshless.closed_form import ClosedFormSolution, solution_of
from tetlux.fem.meshless.solution import ChargeSolution
from tetlux.fem.meshless.solve import solve_with_charges
from tetlux.fem.outcome.detectors import read_all
from tetlux.fem.outcome.plan import Candidate, Plan, seconds_in_words
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.planner.candidate import reason_of
from tetlux.fem.planner.charges import learn_charges, most_charges
from tetlux.fem.planner.choose import plan_of
from tetlux.fem.planner.closed_form import closed_form_candidate
from tetlux.fem.planner.request import Request
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.truncated.solution import TruncatedSolution
from tetlux.fem.truncated.solve import SolveOnPart, solve_truncated
from tetlux.meshing.describe import percent
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note

AnySolution = Solution | ChargeSolution | ClosedFormSolution


@dataclass(frozen=True)
class FiniteElements:
    """How finite elements solve the scenes of a request.

    Attributes
    ----------
    whole : callable
        On the whole body, or the mesh that is given.
    part : callable
        On the surface of a part, given the medium of each scene, the regions in it, and the mesh to begin with.
    cache : bool
        Whether meshes are looked up and kept in the user's cache directory.
    """

    whole: Callable[[], Sequence[Solution]]
    part: SolveOnPart
    cache: bool = True


Report = Callable[[str], None]


def solve_by_plan(
    request: Request, elements: FiniteElements, report: Report, *, plan: Plan | None = None
) -> list[AnySolution]:
    """Solve each scene of a request by the model that its plan chooses.

    Charges tell their error when they are fitted: where it is above the tolerance, the plan goes on to another model.

    Parameters
    ----------
    request : Request
    elements : FiniteElements
    report : callable
        Called with each line of the plan, and each change of it.
    plan : Plan, optional
        One that was made before, such as that of a group of runs.

    Returns
    -------
    list of Solution, ChargeSolution or ClosedFormSolution
        One for each scene.
    """
    if plan is None:
        plan = plan_of(request)
        report_plan(plan, report)
    watch = Stopwatch()
    found, missed = _solve_by(request, elements, report, plan)
    if request.runs == 1:
        _learn(request, plan.best, found, watch.read_undisturbed())
    if missed:
        plan = plan.without(plan.chosen, missed)
        report(f"{missed}: going on with {plan.chosen}")
        return solve_by_plan(request, elements, report, plan=plan)
    return [replace(solution, plan=plan) for solution in found]


def _solve_by(
    request: Request, elements: FiniteElements, report: Report, plan: Plan
) -> tuple[Sequence[AnySolution], str]:
    """Solve each scene by the chosen model, and say what the solutions miss; "" if nothing."""
    if plan.chosen == "closed-form":
        # The plan may be that of another run of a group.
        candidate = closed_form_candidate(request)
        return (solve_closed_forms(request), "") if candidate.suits else ((), candidate.reason)
    if plan.chosen == "charges":
        return _try_charges(request, plan)
    if plan.chosen == "truncated":
        return _try_part(request, elements, report)
    return elements.whole(), ""


def _learn(request: Request, candidate: Candidate, found: Sequence[AnySolution], seconds: float) -> None:
    """Learn from a run what its kind takes and is off by."""
    fitted = [each for each in found if isinstance(each, ChargeSolution)]
    if len(found) == 0 or not candidate.kind:
        return
    if fitted:
        learn_charges(request, candidate, fitted, seconds)
        return
    error = max(each.error_estimate for each in found)
    of_seconds, of_error = candidate.learned
    request.costs.learn(candidate.kind, seconds / candidate.seconds * of_seconds, error / candidate.error * of_error)


def report_plan(plan: Plan, report: Report) -> None:
    """Report a plan line by line."""
    for line in str(plan).splitlines():
        report(line)


def solve_closed_forms(request: Request) -> list[ClosedFormSolution]:
    """Solve each scene of a request by a closed form.

    Raises
    ------
    InputError
        If a mesh is needed, or there is no closed form.
    """
    if request.need_of_mesh:
        raise InputError(f'{request.need_of_mesh}, and model "closed-form" makes none', remedy='give model="full"')
    watch = Stopwatch()
    try:
        fields = request.exact_fields
    except InputError as error:
        raise InputError(error.text, field="model", remedy='give model="auto" or "full"') from error
    found = []
    for body, deposits, exact in zip(request.bodies, request.deposits, fields, strict=True):
        solution = solution_of(exact, request.surface, body.outer, deposits, tolerance=request.exitance_tolerance)
        found.append(replace(solution, readings=read_all(request.detectors, solution)))
    seconds = watch.read()
    return [replace(solution, seconds=seconds) for solution in found]


def solve_on_part(request: Request, elements: FiniteElements, report: Report) -> list[TruncatedSolution]:
    """Solve each scene of a request on the part of the body that light reaches.

    Raises
    ------
    InputError
        If a mesh is given, or light enters or reaches everywhere.
    """
    if request.mesh is not None:
        raise InputError('a mesh is given, and model "truncated" makes its own', remedy='give model="full"')
    try:
        box = request.dark_box
    except InputError as error:
        raise InputError(f"no part can be cut out: {error.text}", field="model", remedy='give model="full"') from error
    return solve_truncated(
        request.bodies,
        request.inner,
        request.lights,
        request.deposits,
        box,
        elements.part,
        tolerance=request.exitance_tolerance,
        report=report,
        cache=elements.cache,
    )


def _try_part(request: Request, elements: FiniteElements, report: Report) -> tuple[Sequence[TruncatedSolution], str]:
    try:
        return solve_on_part(request, elements, report), ""
    except InputError as error:
        return [], reason_of(error)


def _try_charges(request: Request, plan: Plan) -> tuple[list[ChargeSolution], str]:
    """Solve each scene by charges, and say what the solutions miss; "" if nothing."""
    try:
        found = _fit_charges(request, most_charges(request, plan["charges"], plan["full"].seconds))
    except InputError as error:
        return [], reason_of(error)
    missed = "; ".join(dict.fromkeys(filter(None, (_missed(request, each) for each in found))))
    taken = seconds_in_words(sum(each.seconds["total"] for each in found))
    return found, f"tried in {taken}: {missed}" if missed else ""


def _fit_charges(request: Request, most: int) -> list[ChargeSolution]:
    """Fit charges to each scene, at most as many as take as long as finite elements are expected to."""
    found = []
    for body, lights, frequency in zip(request.bodies, request.lights, request.frequencies, strict=True):
        outer, *media = body.by_label.values()
        regions = [Region(surface, medium) for surface, medium in zip(request.inner, media, strict=True)]
        found.append(
            solve_with_charges(
                request.surface,
                outer,
                lights,
                regions=regions,
                tolerance=request.tolerances.exitance,
                detectors=request.detectors,
                detector_tolerance=request.tolerances.readings,
                most=most,
                frequency=frequency,
                outside_index=request.outside_index,
            )
        )
    return found


def _missed(request: Request, solution: ChargeSolution) -> str:
    """What a solution misses; empty if it gives what is asked for."""
    wanted, error = request.tolerances, solution.error_estimate
    if wanted.exitance is not None and not error <= wanted.exitance:
        return f"estimated error {percent(error)} with {solution.charges} charges"
    if wanted.exitance is not None and any(
        isinstance(note, Note) and note.code == "exitance-negative" for note in solution.warnings
    ):
        return "the exitance is below zero where it is dark"
    if wanted.readings is not None:
        worst = max((reading.relative_error or 0.0 for reading in solution.readings), default=0.0)
        if not worst <= wanted.readings:
            return f"a reading is off by {percent(worst)}"
    return ""
