"""`share_mesh`: a mesh that is fine enough for most of many scenes, for each of them to begin with."""

from collections.abc import Sequence
from dataclasses import replace

from tetlux.fem.adapt import Problem, first_mesh
from tetlux.fem.assessment import Tolerances
from tetlux.fem.inputs import DEFAULT_TOLERANCE
from tetlux.fem.known.kept_fits import KeptFits
from tetlux.fem.known.split import split_lights
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.memory import limit_by_memory
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.detectors import place_detector
from tetlux.fem.outcome.exitance_field import Dark
from tetlux.fem.scenes import Scenes, build_scenes
from tetlux.fem.shared import SharedMesh
from tetlux.fem.solve_scenes import Report, check_tolerances, no_report
from tetlux.fem.sources.light import Light
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.system import MeshSolution
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.refine import refine_often

# The largest mesh that is shared: on finer ones solving takes longer than refining for each run.
MOST_SHARED_TETRAHEDRA = 100_000
# The share of scenes for which a shared mesh is left too coarse: they refine it for themselves.
MOST_MISSING = 0.25


def share_mesh(
    surface: Surface,
    medium: AnyMedium | Sequence[AnyMedium],
    scenes: Sequence[Sequence[Light]],
    *,
    pilots: int = 1,
    regions: Sequence[Region] = (),
    tolerance: float | None = DEFAULT_TOLERANCE,
    detectors: Sequence[Detector] = (),
    detector_tolerance: float | None = None,
    everywhere_tolerance: float | None = None,
    volume_tolerance: float | None = None,
    cache: bool = True,
    report: Report = no_report,
    frequency: float | Sequence[float] = 0.0,
    outside_index: float = 1.0,
) -> SharedMesh:
    """Mesh a body for many scenes, so that most of them need no finer mesh.

    Parameters
    ----------
    surface : Surface
    pilots : int
        So many scenes, the first ones, are solved for and stand for the others. The mesh is graded for the lights of
        all.
    medium, scenes, regions, detectors, cache, report, frequency, outside_index
    tolerance, detector_tolerance, everywhere_tolerance, volume_tolerance
        As in `solve_each`.

    Returns
    -------
    SharedMesh
        For `solve_each`, as `start`. It has at most `MOST_SHARED_TETRAHEDRA`: runs that need more refine it themselves.

    Raises
    ------
    InputError, RunError
        As in `solve_each`.

    Examples
    --------
    >>> from tetlux.fem import Medium, PointSource, solve_each
    >>> from tetlux.fem.share import share_mesh
    >>> from tetlux.meshing import sphere
    >>> ball, few = sphere(10.0), [Medium(sigma_a=a, sigma_s_prime=1.0, eta=1.4) for a in (0.01, 0.03)]
    >>> lights = [PointSource((0, 0, 5.0))]
    >>> start = share_mesh(ball, few, [lights, lights], tolerance=0.05)
    >>> (solution,) = solve_each(ball, Medium(sigma_a=0.02, sigma_s_prime=1.0, eta=1.4), [lights], start=start)
    >>> solution.mesh is start.mesh
    True
    """
    tolerances = check_tolerances(
        Tolerances(tolerance, detector_tolerance, (), everywhere_tolerance, volume_tolerance), detectors
    )
    wanted = tolerances.exitance or detector_tolerance or DEFAULT_TOLERANCE
    checked = build_scenes(surface, None, medium, regions, len(scenes), frequency, outside_index)
    tolerances = _place(tolerances, detectors, checked)
    places = tolerances.places_in(0)
    split = [
        split_lights(lights, body, "fitted", tolerance=wanted, readings=places, kept=KeptFits(), shift=shift)
        for lights, body, shift in zip(scenes[:pilots], checked.bodies, checked.shifts, strict=False)
    ]
    others = [
        light.deposit_in(body)
        for lights, body in zip(scenes[pilots:], checked.bodies[pilots:], strict=True)
        for light in lights
    ]
    checked = replace(
        checked,
        media=checked.media[:pilots],
        bodies=checked.bodies[:pilots],
        frequencies=checked.frequencies[:pilots],
        shifts=checked.shifts[:pilots],
    )
    problem = Problem(checked, split, "lumped", True, Stopwatch(), others=others)
    reading = len(detectors) > 0 or tolerances.need_quadratic
    limit = limit_by_memory(MOST_SHARED_TETRAHEDRA, *problem.size, reading=reading).tetrahedra
    mesh, _ = first_mesh(problem, tolerances, limit, report, cache=cache)
    return SharedMesh(_refine_for_most(mesh, problem, tolerances, limit, report))


def choose_places(
    surface: Surface,
    medium: AnyMedium | Sequence[AnyMedium],
    scenes: Sequence[Sequence[Light]],
    start: SharedMesh,
    *,
    regions: Sequence[Region] = (),
    tolerance: float = DEFAULT_TOLERANCE,
    detectors: Sequence[Detector] = (),
    detector_tolerance: float | None = None,
) -> None:
    """Choose places of charges on a shared mesh as `solve_each` does, for later solves to follow."""
    checked = build_scenes(surface, None, medium, regions, len(scenes))
    places = _place(Tolerances(tolerance, detector_tolerance), detectors, checked).places_in(0)
    for lights, body in zip(scenes, checked.bodies, strict=True):
        split_lights(lights, body, "fitted", tolerance=tolerance, readings=places, kept=start.kept)


def _place(tolerances: Tolerances, detectors: Sequence[Detector], scenes: Scenes) -> Tolerances:
    """Tolerances with detectors placed on the body."""
    dark = Dark(scenes.surface, scenes.bodies[0].outer)
    return replace(tolerances, placed=tuple(place_detector(detector, dark) for detector in detectors))


def _refine_for_most(
    mesh: TetMesh, problem: Problem, tolerances: Tolerances, most_tetrahedra: int, report: Report
) -> TetMesh:
    """Refine a mesh until all but `MOST_MISSING` of the scenes are within the tolerances, each by itself.

    Parameters
    ----------
    mesh : TetMesh
        The first one.
    problem : Problem
        Scenes that stand for many more.
    tolerances : Tolerances
    most_tetrahedra : int
        Largest number of tetrahedra after refinement.
    report : callable
        Called with a line of text for each mesh.

    Returns
    -------
    TetMesh
    """
    pending: dict[int, MeshSolution | None] = dict.fromkeys(range(len(problem.lights)))
    allowed = MOST_MISSING * len(pending)
    while True:
        solve_on = problem.solver_on(mesh)
        steps = {scene: solve_on(scene, coarser) for scene, coarser in pending.items()}
        with problem.watch.stage("solve"):
            missing = {scene: step for scene, step in steps.items() if tolerances.assess({scene: step}).splits.any()}
        report(f"solved on {len(mesh.tetrahedra):,} tetrahedra: {len(missing)} of {len(problem.lights)} need more")
        if len(missing) <= allowed:
            return mesh
        with problem.watch.stage("mesh"):
            splits = tolerances.assess(missing).splits
            inner = problem.scenes.inner
            finer = refine_often(mesh, splits, problem.scenes.surface, inner, most_tetrahedra)
        if not len(mesh.tetrahedra) < len(finer.tetrahedra) <= most_tetrahedra:
            return mesh
        mesh, pending = finer, dict(missing)
