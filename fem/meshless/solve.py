"""Lights in a body of homogeneous regions, solved by charges: what `tetlux.fem.solve` does for ``model="charges"``."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from tetlux.fem.assessment import Tolerances
from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import SurfacePartition
from tetlux.fem.charges.adapt import MOST_CHARGES, NEGLIGIBLE_DIP
from tetlux.fem.inputs import DEFAULT_TOLERANCE
from tetlux.fem.known.split import check_lights
from tetlux.fem.labels import GivenMedia
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region, only_medium
from tetlux.fem.meshless.fit import charge_solution
from tetlux.fem.meshless.solution import ChargeSolution, LightLedger
from tetlux.fem.models.modulation import notes_on_frequency, shift_of_frequency
from tetlux.fem.notes import notes_on_readings
from tetlux.fem.outcome.detector_kinds import Detector
from tetlux.fem.outcome.detectors import place_detector, read_all
from tetlux.fem.outcome.exitance_field import Dark
from tetlux.fem.outcome.power import Power
from tetlux.fem.solve_scenes import check_tolerances
from tetlux.fem.sources.deposit import Deposit
from tetlux.fem.sources.light import Light
from tetlux.fem.stopwatch import Stopwatch
from tetlux.fem.validity.meshless import SurfaceValidity
from tetlux.fem.validity.notes import check_media
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.nesting import check_regions

# Least distance of a source from the surface of a region, in mean free paths. The error is .1 % at this distance and 50
# % on the surface.
LEAST_DISTANCE_TO_INTERFACE = 1e-3
_INSTEAD = 'solve it with model "full".'


def solve_with_charges(
    surface: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    lights: Sequence[Light],
    *,
    regions: Sequence[Region] = (),
    tolerance: float | None = DEFAULT_TOLERANCE,
    detectors: Sequence[Detector] = (),
    detector_tolerance: float | None = None,
    most: int = MOST_CHARGES,
    frequency: float = 0.0,
    outside_index: float = 1.0,
) -> ChargeSolution:
    """Solve for lights in a body of homogeneous regions, without a mesh.

    Parameters
    ----------
    surface : Surface
    medium : Medium
    lights : sequence of Light
        Points, beams that are points, and diffuse light; they add up.
    regions : sequence of Region
        Parts of the body with media of their own; with these there is no diffuse light.
    tolerance : float, optional
        Wanted relative L2 error of the exitance; None to fit for detectors alone.
    detectors : sequence of Detector
        What is to be read.
    detector_tolerance : float, optional
        Wanted relative error of what each detector reads.
    most : int
        Charges at which fitting ends even if the tolerance is not met; the solution then carries a warning.
    frequency : float
        Of modulated light, Hz; 0 for steady light.
    outside_index : float
        Refractive index of what surrounds the body.

    Returns
    -------
    ChargeSolution

    Raises
    ------
    InputError
        If the body is a mesh, there are several media, or the tolerance, a light or a region is not of those.

    Examples
    --------
    >>> from tetlux.fem import Medium, PencilBeam
    >>> from tetlux.meshing import sphere
    >>> tissue = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
    >>> solution = solve_with_charges(sphere(10.0), tissue, [PencilBeam((0, 0, 20), (0, 0, -1))])
    >>> solution.error_estimate < 0.02
    True
    """
    _check_arguments(surface, medium, lights, detectors, Tolerances(tolerance, detector_tolerance))
    assert isinstance(surface, Surface)
    assert isinstance(medium, AnyMedium)
    watch = Stopwatch()
    with watch.stage("surface"):
        inner = [(region.surface, homogeneous_medium(only_medium(region))) for region in regions]
        body = homogeneous_medium(medium)
        for each in (surface, *(own for own, _ in inner)):
            check_simple(each)
        check_regions(surface, [each for each, _ in inner])
        whole = Body(surface, (body, *(each for _, each in inner)), SurfacePartition([each for each, _ in inner]))
        check_media(whole)
        shift = shift_of_frequency(frequency, body, surface.unit, outside_index)
        deposits = [light.deposit_in(whole) for light in lights]
        for light, deposit in zip(lights, deposits, strict=True):
            check_deposit(light, deposit, whole, [each for each, _ in inner])
        places = [place_detector(each, Dark(surface, body)).position for each in detectors]
        readings = None if detector_tolerance is None else (np.array(places), detector_tolerance)
    with watch.stage("solve"):
        points, powers = _point_sources(deposits)
        ledgers = [_light_ledger(deposit) for deposit in deposits]
        solution = charge_solution(
            surface,
            body,
            points,
            powers,
            ledgers,
            inner=inner,
            tolerance=tolerance,
            readings=readings,
            most=most,
            shift=shift,
        )
        if not inner:
            solution = replace(solution, validity=SurfaceValidity(surface, body, deposits))
        solution = replace(solution, frequency=frequency)
        solution = replace(solution, readings=read_all(detectors, solution))
    warnings = [*surface.warnings, *(warning for deposit in deposits for warning in deposit.warnings)]
    warnings += _notes_on_tolerances(solution, tolerance, detector_tolerance)
    warnings += notes_on_frequency(frequency, shift, [body, *(own for _, own in inner)])
    if tolerance is not None and shift == 0:
        warnings += _below_zero(solution)
    return replace(solution, seconds=watch.read(), warnings=list(dict.fromkeys(warnings)))


def _check_arguments(
    surface: Surface | TetMesh,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    lights: Sequence[Light],
    detectors: Sequence[Detector],
    tolerances: Tolerances,
) -> None:
    if isinstance(surface, TetMesh):
        raise InputError('model "charges" takes no mesh; give the surface, or solve with model "full".')
    if not isinstance(medium, AnyMedium):
        raise InputError('model "charges" takes one medium at a time; call it once for each channel.')
    check_tolerances(tolerances, detectors)
    check_lights(lights)
    if len(lights) == 0:
        raise InputError("there is no light; give at least one.")


def _point_sources(deposits: Sequence[Deposit]) -> tuple[FloatArray, FloatArray]:
    """Positions (p, 3) of all point sources, and their powers in each light (p, s), W."""
    terms = [deposit.terms for deposit in deposits]
    owners = np.repeat(np.arange(len(terms)), [len(each.points) for each in terms])
    powers = np.zeros((len(owners), len(terms)))
    powers[np.arange(len(owners)), owners] = np.concatenate([each.powers for each in terms])
    return np.vstack([each.points for each in terms]), powers


def _notes_on_tolerances(
    solution: ChargeSolution, tolerance: float | None, detector_tolerance: float | None
) -> Iterator[Note]:
    """Notes on tolerances that were missed."""
    if tolerance is not None and not solution.error_estimate <= tolerance:
        yield Note(
            "tolerance-missed",
            f"the tolerance of {tolerance:g} was not met: the estimated error is {solution.error_estimate:.2g} "
            f"with {solution.charges} charges; {_INSTEAD}",
            value=solution.error_estimate,
        )
    where = f"with {solution.charges:,} charges; {_INSTEAD.removesuffix('.')}"
    yield from notes_on_readings(solution.readings, detector_tolerance, where)


def _below_zero(solution: ChargeSolution) -> list[str]:
    """A warning where the exitance is below zero: there it is less than its error."""
    points, areas = solution.samples[0].points, solution.samples[0].areas
    exitance = solution.exitance_on(points)
    below = exitance < -NEGLIGIBLE_DIP * exitance.max()
    if not below.any():
        return []
    share = float(areas[below].sum() / areas.sum())
    return [
        Note(
            "exitance-negative",
            f"the exitance is below zero on {share:.1%} of the surface, where there is less light than charges are "
            f"off by; ask for a smaller tolerance, or {_INSTEAD}",
            value=share,
        )
    ]


def _light_ledger(deposit: Deposit) -> LightLedger:
    ledger, terms = deposit.ledger, deposit.terms
    known = Power(ledger.incident, ledger.specular, ledger.absorbed, 0.0, ledger.ballistic)
    return LightLedger(known, float(terms.irradiance), float(terms.transmitted_irradiance))


def check_simple(surface: Surface) -> None:
    """Refuse a surface some of which does not bound the body.

    Raises
    ------
    InputError
    """
    if surface.overlaps:
        raise InputError(
            f'{surface.name} crosses itself or holds a body within, and model "charges" needs a surface all of which '
            f"bounds the body; {_INSTEAD}"
        )


def _check_apart(points: FloatArray, medium: Medium, inner: Sequence[Surface]) -> None:
    """Refuse sources on the surfaces of regions, where fluence has a pole on both sides."""
    for number, surface in enumerate(inner, 1):
        away = surface.distances(points)
        if (away < LEAST_DISTANCE_TO_INTERFACE * medium.mean_free_path).any():
            place = ", ".join(f"{x:.4g}" for x in points[away.argmin()])
            raise InputError(
                f'a source at ({place}) lies on the surface of region {number}, where model "charges" has none; '
                f"move it by {LEAST_DISTANCE_TO_INTERFACE:g} of a mean free path, or {_INSTEAD}"
            )


def homogeneous_medium(medium: AnyMedium) -> Medium:
    """The medium, if it is homogeneous.

    Raises
    ------
    InputError
        If it varies.
    """
    if isinstance(medium, Medium):
        return medium
    raise InputError(f'the medium varies within the body, and model "charges" needs homogeneous ones; {_INSTEAD}')


def check_deposit(light: Light, deposit: Deposit, body: Body, inner: Sequence[Surface]) -> None:
    """Refuse a light unless it leaves point sources or uniform diffuse light in the body.

    Parameters
    ----------
    light : Light
    deposit : Deposit
        What it leaves.
    body : Body
    inner : sequence of Surface
        Of the body's regions.

    Raises
    ------
    InputError
    """
    name, terms = type(light).__name__, deposit.terms
    if len(terms.segments) or deposit.on_mesh is not None:
        raise InputError(f'{name} leaves light along lines or by facets, and model "charges" has points; {_INSTEAD}')
    if np.any(terms.emission):
        raise InputError(f'{name} emits light throughout, and model "charges" has points; {_INSTEAD}')
    if np.ndim(terms.irradiance) or np.ndim(terms.transmitted_irradiance):
        raise InputError(f'{name} is not uniform over the surface, as model "charges" needs it; {_INSTEAD}')
    if terms.irradiance and body.only_medium is None:
        raise InputError(f'{name} on a body with regions is not for model "charges"; {_INSTEAD}')
    _check_apart(terms.points, body.outer, inner)
