"""`solve` and `solve_each`: from a body, its media and lights to solutions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, overload

from tetlux.fem.adapt import MOST_TETRAHEDRA, Problem, first_mesh, solve_and_refine
from tetlux.fem.meshless.solution import ChargeSolution
from tetlux.fem.meshless.solve import solve_with_charges
from tetlux.fem.error.tolerance import check_tolerance
from tetlux.fem.known.kept import KeptPlaces, keep_with, kept_on
from tetlux.fem.known.split import Subtract, check_scenes, sources_of, without_fit
from tetlux.fem.labelled import GivenMedia
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.memory import check_memory, limited_by_memory
from tetlux.fem.notes import notes_on
from tetlux.fem.operators.assembly import Mass
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.scene import channels_of, scene_of
from tetlux.fem.sources.deposit import Light
from tetlux.fem.stopwatch import Stopwatch
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


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
    subtract: Subtract = "fitted",
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
    subtract : {"fitted", "half-space", "free-space", "nothing"}
        What is subtracted from the fluence of point sources before the rest is solved for, see `tetlux.fem.known`.
        "fitted" is charges fitted to the surface, for points and beams that are points in one even medium, where a
        `Surface` says what the true one is; all other light, and light for which they would not do, has "half-space".
        Where they are is kept with the mesh of a solution: on the same `mesh` exitance depends smoothly on the medium.
    limit : bool
        Whether the fluence is limited to be nonnegative where lumping alone does not make it so, see
        `tetlux.fem.operators.limiter`.
    most_tetrahedra : int
        Refinement stops at this many even if the tolerance is not met; the solution then carries a warning. It stops
        earlier where memory is scarce. The mesher's own mesh, of some thousands, is never made coarser.
    cache : bool
        Whether the mesher's mesh is looked up and kept in the user's cache directory.
    report : callable
        Called with a line of text as each stage ends.
    model : {"full", "charges"}
        "full" is finite elements. "charges" needs no mesh: screened charges outside the body are fitted to its
        surface, see `tetlux.fem.charges`; for points, beams that are points, and diffuse light in regions of one medium
        each. Of the other arguments it takes `regions` and `tolerance`.

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
    The error is estimated by a dual solution, see `tetlux.fem.error.estimate`; the tetrahedra with the largest shares
    are split until it is within the tolerance. It is the error of the discretisation, not that of the diffusion
    approximation.

    Examples
    --------
    >>> from tetlux.fem import Medium, PencilBeam, solve
    >>> from tetlux.meshing import sphere
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve(sphere(10.0), tissue, [PencilBeam((0, 0, 20), (0, 0, -1))], tolerance=0.05)
    >>> solution.error_estimate < 0.05
    True
    """
    if model not in ("full", "charges"):
        raise InputError(f'model is "{model}"; it is "full" or "charges".')
    if model == "charges":
        return solve_with_charges(body if mesh is None else mesh, medium, lights, regions=regions, tolerance=tolerance)
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
    subtract: Subtract = "fitted",
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
    check_tolerance(tolerance)
    check_scenes(scenes)
    if isinstance(body, TetMesh):
        if mesh is not None:
            raise InputError("a mesh is given twice; give it as the body, or a surface and its mesh.")
        mesh = body
    watch = Stopwatch()
    with watch.stage("surface"):
        scene = scene_of(body, mesh, medium, regions, len(scenes))
        kept = KeptPlaces() if mesh is None else kept_on(mesh)
        if isinstance(body, TetMesh):
            subtract = without_fit(subtract)
        sources = [
            sources_of(lights, each, subtract, tolerance=tolerance, kept=kept)
            for lights, each in zip(scenes, scene.bodies, strict=True)
        ]
    problem = Problem(scene, sources, mass, limit, watch)
    given = mesh is not None
    most_tetrahedra, where = limited_by_memory(most_tetrahedra, *problem.size)
    if mesh is None:
        mesh = first_mesh(problem, most_tetrahedra, report, cache=cache)
    check_memory(len(mesh.tetrahedra), *problem.size)
    steps = solve_and_refine(mesh, problem, tolerance, 0 if given else most_tetrahedra, report)
    keep_with(steps[0].solution.mesh, kept)
    found = []
    for number, step in enumerate(steps):
        notes = notes_on(step.solution, sources[number], tolerance, "on the mesh given" if given else where)
        notes += scene.warnings(number, step.solution, given=given)
        found.append(replace(step.solution, warnings=list(dict.fromkeys(notes))))
    seconds = watch.read()
    return [replace(solution, seconds=seconds) for solution in found]
