"""`solve`: the public function that solves for the light in a body."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, Unpack, overload

from tetlux.fem.adapt import MOST_TETRAHEDRA
from tetlux.fem.inputs import DEFAULT_TOLERANCE
from tetlux.fem.known.split import Subtract
from tetlux.fem.labels import GivenMedia
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region
from tetlux.fem.meshless.closed_form import ClosedFormSolution
from tetlux.fem.meshless.solution import ChargeSolution
from tetlux.fem.meshless.solve import solve_with_charges
from tetlux.fem.operators.assembly import Lumping
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.planner.channels import solve_channels, solve_times
from tetlux.fem.planner.options import Options, check_options_of
from tetlux.fem.planner.solve import AnySolution
from tetlux.fem.solve_scenes import Report, no_report, solve_each
from tetlux.fem.sources.light import Light
from tetlux.fem.transient.transient import Transient
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

__all__ = ["solve", "solve_each"]

MODELS = ("full", "auto", "closed-form", "charges", "truncated")


@overload
def solve(  # type: ignore[overload-overlap]  # media by label may hold lists of channels, see the next overload
    body: Surface | TetMesh,
    medium: AnyMedium | Mapping[Any, AnyMedium],
    lights: Sequence[Light],
    *,
    model: Literal["full"] = ...,
    **options: Unpack[Options],
) -> Solution: ...


@overload
def solve(
    body: Surface | TetMesh,
    medium: Sequence[AnyMedium | Mapping[Any, AnyMedium]] | Mapping[Any, AnyMedium | Sequence[AnyMedium]],
    lights: Sequence[Light],
    *,
    model: Literal["full"] = ...,
    **options: Unpack[Options],
) -> list[Solution]: ...


@overload
def solve(
    body: Surface,
    medium: AnyMedium,
    lights: Sequence[Light],
    *,
    model: Literal["charges"],
    regions: Sequence[Region] = ...,
    tolerance: float | None = ...,
    detectors: Sequence[Detector] = ...,
    detector_tolerance: float | None = ...,
    frequency: float = ...,
    outside_index: float = ...,
) -> ChargeSolution: ...


@overload
def solve(
    body: Surface,
    medium: AnyMedium,
    lights: Sequence[Light],
    *,
    model: Literal["closed-form"],
    tolerance: float | None = ...,
    detectors: Sequence[Detector] = ...,
) -> ClosedFormSolution: ...


@overload
def solve(  # type: ignore[overload-overlap]  # as above
    body: Surface | TetMesh,
    medium: AnyMedium | Mapping[Any, AnyMedium],
    lights: Sequence[Light],
    *,
    model: Literal["auto", "truncated"],
    **options: Unpack[Options],
) -> AnySolution: ...


@overload
def solve(
    body: Surface | TetMesh,
    medium: Sequence[AnyMedium | Mapping[Any, AnyMedium]] | Mapping[Any, AnyMedium | Sequence[AnyMedium]],
    lights: Sequence[Light],
    *,
    model: Literal["auto", "truncated"],
    **options: Unpack[Options],
) -> list[AnySolution]: ...


@overload
def solve(  # type: ignore[overload-overlap]  # as above
    body: Surface | TetMesh,
    medium: AnyMedium | Mapping[Any, AnyMedium],
    lights: Sequence[Light],
    *,
    times: Sequence[float],
    model: Literal["full", "auto"] = ...,
    **options: Unpack[Options],
) -> Transient: ...


@overload
def solve(
    body: Surface | TetMesh,
    medium: Sequence[AnyMedium | Mapping[Any, AnyMedium]] | Mapping[Any, AnyMedium | Sequence[AnyMedium]],
    lights: Sequence[Light],
    *,
    times: Sequence[float],
    model: Literal["full", "auto"] = ...,
    **options: Unpack[Options],
) -> list[Transient]: ...


def solve(
    body: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    lights: Sequence[Light],
    *,
    regions: Sequence[Region] = (),
    tolerance: float | None = DEFAULT_TOLERANCE,
    detectors: Sequence[Detector] = (),
    detector_tolerance: float | None = None,
    everywhere_tolerance: float | None = None,
    volume_tolerance: float | None = None,
    mesh: TetMesh | None = None,
    mass: Lumping = "lumped",
    subtract: Subtract = "fitted",
    limit: bool = True,
    most_tetrahedra: int = MOST_TETRAHEDRA,
    cache: bool = True,
    report: Report = no_report,
    frequency: float = 0.0,
    outside_index: float = 1.0,
    times: Sequence[float] | None = None,
    model: Literal["full", "auto", "closed-form", "charges", "truncated"] = "full",
) -> AnySolution | Transient | Sequence[AnySolution] | Sequence[Transient]:
    """Solve the diffusion approximation for the light in a body.

    A `Surface` is tetrahedralized and refined until the estimated error of the exitance is within the
    tolerance; a `TetMesh` is used as it is, with a medium for each label of its tetrahedra if it has several.

    Parameters
    ----------
    body : Surface or TetMesh
        The body; all lengths are in its unit.
    medium : Medium, VaryingMedium, mapping of label to these, or sequence of these
        The medium of the body, or a mapping from each label of a mesh, by number or name, to its medium. A sequence
        holds channels (wavelengths, or red, green and blue), all solved on one mesh that is fine enough for each;
        within a mapping a label may have a list of channels too. Coefficients in 1/unit.
    lights : sequence of Light
        At least one; they add up.
    regions : sequence of Region
        Closed surfaces within the body, with media of their own.
    tolerance : float, optional
        Wanted relative L2 error of the exitance over the surface; None to refine for detectors alone.
    detectors : sequence of detectors
        What is to be read, each of all lights together: see `tetlux.fem.PointDetector` and others.
    detector_tolerance : float, optional
        Wanted relative error of what each detector reads; if not given, the mesh is not refined for them, nor are
        charges fitted for them.
    everywhere_tolerance : float, optional
        Wanted relative error of the exitance at almost every point of the surface: estimated for some 95 % of the area
        of each decade of exitance, down to a millionth of the largest; what is darker is within that share of a
        millionth. Not guaranteed for the rest, such as edges of shadows and corners. Without a tolerance it is one of
        the L2 error too. The exitance and fluence of the solution then are those of quadratic elements.
    volume_tolerance : float, optional
        Wanted relative error of the fluence at almost every point inside: of some 95 % of the volume of each region
        within each two decades of fluence, down to a millionth of the largest at a node. Not guaranteed within a mean
        free path of sources that are not points.
    mesh : TetMesh, optional
        A mesh of the body, which is used as it is.
    mass : {"lumped", "consistent"}
        Quadrature of the terms without derivatives, which are mass matrices of the volume and of the boundary: see
        `tetlux.fem.operators.assembly.system_matrix`.
    subtract : {"fitted", "half-space", "free-space", "nothing"}
        What is subtracted from the fluence of point sources before finite elements solve for the rest, see
        `tetlux.fem.known`. "fitted" is charges fitted to the surface, for points and beams that are points, where the
        body is a `Surface` of one homogeneous medium; for other light, and where no fit is good enough, it is
        "half-space". The positions of the charges are kept with the mesh of a solution; solved on it again, given as
        `mesh`, the exitance depends smoothly on the medium.
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
    frequency : float
        At which the lights are modulated, Hz; 0 for steady light. Fluence, exitance, power and readings of the solution
        then are complex amplitudes, by the convention ``exp(i omega t)``; see its `amplitude_at` and `phase_at`.
        The time that a beam takes to reach its depth is left out: ``omega n/c`` times that path, in radians.
    outside_index : float
        Refractive index of what surrounds the body, to which `eta` is relative. The speed of light inside is
        ``c/(eta outside_index)``.
    times : sequence of float, optional
        s, rising: at these times after a short pulse of the lights, of 1 J for each watt. The solution then is a
        `Transient`, see `tetlux.fem.transient`, for which model is "full" or "auto", both by finite elements.
    model : {"full", "auto", "closed-form", "charges", "truncated"}
        The method: all solve the diffusion approximation. "full" solves by finite elements. "charges" fits screened
        charges outside the body to its boundary condition and makes no mesh, see `tetlux.fem.charges`. It takes points,
        beams that are points, and diffuse light, in one homogeneous medium and in homogeneous regions; of the other
        arguments it takes `regions`, `tolerance`, `detectors`, `detector_tolerance` and `frequency`, and refuses the
        rest. "closed-form" is the exact series of balls and slabs of one homogeneous medium, with
        points, beams that are points, and in balls diffuse light; it takes `tolerance` and `detectors`.
        "truncated" solves by finite elements on the part that light reaches, of bodies of any size, see
        `tetlux.fem.truncated`. "auto" takes the fastest of these that gives what is asked for, see `tetlux.fem.plan`.

    Returns
    -------
    Solution, ChargeSolution, ClosedFormSolution or Transient, or list of these
        A list with a solution for each channel if `medium` is a sequence or holds one for a label. Its `model` says
        how it was solved and, for ``model="auto"``, its `plan` why; its `mesh` is None where none was made.

    Raises
    ------
    InputError
        If an argument is out of range, a light does not meet the body, or media, regions and mesh do not fit each
        other.
    RunError
        If the mesher or the linear solver fails, or the mesh takes more memory than is available.

    Notes
    -----
    P1 finite elements with partial-current (Robin) boundaries, see `tetlux.fem.operators.forms`. A dual solution
    estimates the error, see `tetlux.fem.error.estimate`; the tetrahedra with the largest shares are split until it is
    within the tolerance. It is the error of the discretisation, not that of the diffusion approximation.

    Examples
    --------
    >>> from tetlux.fem import Medium, PencilBeam, solve
    >>> from tetlux.meshing import sphere
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve(sphere(10.0), tissue, [PencilBeam((0, 0, 20), (0, 0, -1))], tolerance=0.05)
    >>> solution.error_estimate < 0.05
    True
    """
    if model not in MODELS:
        names = ", ".join(f'"{each}"' for each in MODELS)
        raise InputError(f'model is "{model}"; give one of {names}.')
    options = Options(
        regions=regions,
        tolerance=tolerance,
        detectors=detectors,
        detector_tolerance=detector_tolerance,
        everywhere_tolerance=everywhere_tolerance,
        volume_tolerance=volume_tolerance,
        mesh=mesh,
        mass=mass,
        subtract=subtract,
        limit=limit,
        most_tetrahedra=most_tetrahedra,
        cache=cache,
        report=report,
        frequency=frequency,
        outside_index=outside_index,
    )
    if times is not None:
        return solve_times(body, medium, lights, times, model, options)
    if model not in ("full", "auto"):
        check_options_of(model, options)
    if model == "charges":
        return solve_with_charges(
            body if mesh is None else mesh,
            medium,
            lights,
            regions=regions,
            tolerance=tolerance,
            detectors=detectors,
            detector_tolerance=detector_tolerance,
            frequency=frequency,
            outside_index=outside_index,
        )
    return solve_channels(body, medium, lights, model, options)
