"""`solve_each`: several scenes on one mesh that is fine enough for every one of them."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tetlux.fem.adapt import MOST_TETRAHEDRA, Problem, first_mesh, layers_of, solve_and_refine
from tetlux.fem.assessment import Tolerances
from tetlux.fem.error.tolerance import check_tolerance
from tetlux.fem.inputs import DEFAULT_TOLERANCE
from tetlux.fem.known.kept_fits import KeptFits, fits_of, keep_fits
from tetlux.fem.known.kept_patches import forget_patches
from tetlux.fem.known.split import Subtract, check_scenes, replace_fitted, split_lights
from tetlux.fem.labels import GivenMedia
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.memory import MeshLimit, check_memory, gigabytes, limit_by_memory
from tetlux.fem.notes import notes_on, notes_on_fields, notes_on_readings
from tetlux.fem.operators.assembly import Lumping
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.detectors import MOST_TETRAHEDRA_TO_READ, place_detector, read_all
from tetlux.fem.outcome.exitance_field import Dark
from tetlux.fem.outcome.fields import error_of_field, use_quadratic_elements
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.scenes import build_scenes
from tetlux.fem.shared import SharedMesh
from tetlux.fem.sources.light import Light
from tetlux.fem.stopwatch import Stopwatch
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

Report = Callable[[str], None]


def no_report(_: str) -> None:
    """Print no progress."""


def solve_each(
    body: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    scenes: Sequence[Sequence[Light]],
    *,
    regions: Sequence[Region] = (),
    tolerance: float | None = DEFAULT_TOLERANCE,
    detectors: Sequence[Detector] | Sequence[Sequence[Detector]] = (),
    detector_tolerance: float | None = None,
    everywhere_tolerance: float | None = None,
    volume_tolerance: float | None = None,
    mesh: TetMesh | None = None,
    start: SharedMesh | None = None,
    mass: Lumping = "lumped",
    subtract: Subtract = "fitted",
    limit: bool = True,
    most_tetrahedra: int = MOST_TETRAHEDRA,
    cache: bool = True,
    report: Report = no_report,
    frequency: float | Sequence[float] = 0.0,
    outside_index: float = 1.0,
) -> list[Solution]:
    """Solve for several scenes of one body on one mesh that is fine enough for each of them.

    Parameters
    ----------
    body : Surface or TetMesh
        The body of all scenes; all lengths are in its unit.
    medium : Medium, VaryingMedium, mapping of label to these, or sequence of these
        One for all scenes, or a sequence with one for each scene. Coefficients in 1/unit.
    scenes : sequence of sequences of Light
        The lights of each scene, which add up.
    regions : sequence of Region
        Closed surfaces within the body; a region has one medium for all scenes, or one for each.
    tolerance : float, optional
        Wanted relative L2 error of each scene's exitance over the surface; None to refine for detectors alone.
    detectors : sequence of detectors, or of sequences of these
        What is to be read in each scene; a list for each scene if they differ, such as those near its light.
    detector_tolerance : float, optional
        Wanted relative error of what each detector reads.
    everywhere_tolerance, volume_tolerance : float, optional
        Wanted relative error of the exitance at almost every point of the surface, and of the fluence inside.
    mesh : TetMesh, optional
        A mesh of the body, which is used as it is.
    start : SharedMesh, optional
        The mesh to begin with in place of the mesher's; see `tetlux.fem.share.share_mesh`.
    mass : {"lumped", "consistent"}
        Quadrature of the terms without derivatives.
    subtract : {"fitted", "half-space", "free-space", "nothing"}
        What is subtracted from the fluence of point sources, see `solve`.
    limit : bool
        Whether the fluence is limited to be nonnegative.
    most_tetrahedra : int
        Refinement stops at this many even if the tolerance is not met; solutions then carry a warning.
    cache : bool
        Whether the mesher's mesh is looked up and kept in the user's cache directory.
    report : callable
        Called with a line of text as each stage ends.
    frequency : float or sequence of float
        Of modulated light, Hz, of all scenes or of each: see `solve`.
    outside_index : float
        Refractive index of what surrounds the body.

    Returns
    -------
    list of Solution
        One for each scene, all on the same mesh; the seconds of each are those of all scenes together.

    Raises
    ------
    InputError
        If an argument is out of range, a light does not meet the body, or media, regions and mesh do not fit each
        other.
    RunError
        If the mesher or the linear solver fails, or the mesh takes more memory than is available.

    Notes
    -----
    Method and estimate are those of `solve`. Scenes of equal media share one system matrix.

    Examples
    --------
    >>> from tetlux.fem import Medium, PointSource, solve_each
    >>> from tetlux.meshing import sphere
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> scenes = [[PointSource((0, 0, z))] for z in (5.0, 8.0)]
    >>> deep, shallow = solve_each(sphere(10.0), tissue, scenes, tolerance=0.05)
    >>> deep.mesh is shallow.mesh, deep.power.exited < shallow.power.exited
    (True, True)
    """
    tolerances = check_tolerances(
        Tolerances(tolerance, detector_tolerance, (), everywhere_tolerance, volume_tolerance), detectors
    )
    check_scenes(scenes)
    if not most_tetrahedra >= 1:
        raise InputError(f"most_tetrahedra is {most_tetrahedra}; give a number of at least 1.")
    if isinstance(body, TetMesh):
        if mesh is not None:
            raise InputError("a mesh is given twice; give it as the body, or a surface and its mesh.")
        mesh = body
    watch = Stopwatch()
    with watch.stage("surface"):
        checked = build_scenes(body, mesh, medium, regions, len(scenes), frequency, outside_index)
    with watch.stage("assemble"):
        kept, subtract = _kept_for(mesh, start), replace_fitted(subtract) if isinstance(body, TetMesh) else subtract
        wanted = tolerances.exitance or detector_tolerance or DEFAULT_TOLERANCE
        by_scene = detectors_by_scene(detectors, len(scenes))
        tolerances = place_all(tolerances, by_scene, Dark(checked.surface, checked.bodies[0].outer))
        split = [
            split_lights(lights, each, subtract, wanted, tolerances.places_in(i), kept=kept, scene=i, shift=shift)
            for i, (lights, each, shift) in enumerate(zip(scenes, checked.bodies, checked.shifts, strict=True))
        ]
    if tolerances.need_quadratic:
        most_tetrahedra = min(most_tetrahedra, MOST_TETRAHEDRA_TO_READ)
    problem = Problem(checked, split, mass, limit, watch, start)
    solutions = solve_problem(problem, tolerances, by_scene, mesh, most_tetrahedra, report, cache=cache)
    keep_fits(solutions[0].mesh, kept)
    return solutions


def solve_problem(
    problem: Problem,
    tolerances: Tolerances,
    detectors: Sequence[Sequence[Detector]],
    mesh: TetMesh | None,
    most_tetrahedra: int,
    report: Report,
    *,
    cache: bool,
) -> list[Solution]:
    """Mesh a body unless a mesh is given, solve for all scenes and refine, and note what a user should know.

    The arguments are those of `solve_each`, checked, with detectors of each scene. Returns a solution for each.
    """
    given, reading = mesh is not None, any(detectors) or tolerances.need_quadratic
    limit_of_mesh = limit_by_memory(most_tetrahedra, *problem.size, reading=reading)
    layers = None if given else layers_of(problem, tolerances)
    if mesh is None:
        mesh, layers = first_mesh(problem, tolerances, limit_of_mesh.tetrahedra, report, cache=cache, layers=layers)
    check_memory(len(mesh.tetrahedra), *problem.size, reading=reading)
    steps = solve_and_refine(mesh, problem, tolerances, 0 if given else limit_of_mesh.tetrahedra, report, layers)
    where = "on the mesh given" if given else _in_words(limit_of_mesh)
    solutions, scenes = [], problem.scenes
    for number, step in enumerate(steps):
        with problem.watch.stage("solve"):
            solution = _with_fields(
                replace(step.solution, readings=read_all(detectors[number], step.solution)), tolerances
            )
        notes = notes_on(solution, problem.lights[number], tolerances.exitance, where)
        notes += notes_on_readings(solution.readings, tolerances.readings, where)
        notes += notes_on_fields(solution, tolerances.everywhere, tolerances.volume, where)
        notes += scenes.warnings(number, solution, given=given)
        solutions.append(replace(solution, warnings=list(dict.fromkeys(notes)), frequency=scenes.frequencies[number]))
    seconds = problem.watch.read()
    return [replace(solution, seconds=seconds) for solution in solutions]


def detectors_by_scene(
    detectors: Sequence[Detector] | Sequence[Sequence[Detector]], scenes: int
) -> list[Sequence[Detector]]:
    """The detectors of each scene.

    Raises
    ------
    InputError
        If there are lists of them, and not one for each scene.
    """
    if not detectors or isinstance(detectors[0], str) or not isinstance(detectors[0], Sequence):
        return [detectors] * scenes  # type: ignore[list-item]
    if len(detectors) != scenes or not all(isinstance(some, Sequence) for some in detectors):
        raise InputError(
            f"there are {len(detectors)} lists of detectors for {scenes} scenes; give one for each, or one for all.",
            field="detectors",
        )
    return list(detectors)  # type: ignore[arg-type]


def place_all(tolerances: Tolerances, detectors: Sequence[Sequence[Detector]], dark: Dark) -> Tolerances:
    """Tolerances with the places of the detectors of each scene, each of which is placed once."""
    placed = {id(each): place_detector(each, dark) for some in detectors for each in some}
    of_scenes = tuple(tuple(placed[id(each)] for each in some) for some in detectors)
    return replace(tolerances, placed=tuple(placed.values()), of_scenes=of_scenes)


def _kept_for(mesh: TetMesh | None, start: SharedMesh | None) -> KeptFits:
    """The places of charges to follow, and to add to."""
    if start is not None:
        # What a run finds does not depend on the runs before it.
        forget_patches(start.mesh)
        return start.kept
    return KeptFits() if mesh is None else fits_of(mesh)


def _in_words(limit: MeshLimit) -> str:
    """A clause that says where refinement stopped."""
    if limit.memory is None:
        return f"at the limit of {limit.tetrahedra:,} tetrahedra"
    return f"at the {limit.tetrahedra:,} tetrahedra that {gigabytes(limit.memory)} GB of memory suffice for"


def _with_fields(solution: Solution, tolerances: Tolerances) -> Solution:
    """The solution by quadratic elements with their errors, where these were asked for."""
    if not tolerances.fields:
        return solution
    errors = {where: error_of_field(solution, where) for where in tolerances.fields}
    return replace(
        use_quadratic_elements(solution),
        everywhere_error=errors.get("surface", np.nan),
        volume_error=errors.get("inside", np.nan),
    )


def check_tolerances(given: Tolerances, detectors: Sequence[Detector] | Sequence[Sequence[Detector]]) -> Tolerances:
    """Refuse tolerances out of range, without a detector, or none at all.

    A tolerance everywhere is one of the L2 error too.

    Raises
    ------
    InputError
    """
    if not isinstance(detectors, Sequence):
        raise InputError(f"detectors are given in a list, but {detectors!r} is none; write [detector].")
    for name, value in (
        ("tolerance", given.exitance),
        ("detector_tolerance", given.readings),
        ("everywhere_tolerance", given.everywhere),
        ("volume_tolerance", given.volume),
    ):
        if value is not None:
            check_tolerance(value, name)
    if given.readings is not None and len(detectors) == 0:
        raise InputError("detector_tolerance is for what detectors read, and there is none; give detectors.")
    if given.exitance is None and given.everywhere is not None:
        return replace(given, exitance=given.everywhere)
    if given.exitance is None and not given.need_quadratic:
        raise InputError("there is no tolerance; give tolerance, or detectors and a detector_tolerance.")
    return given
