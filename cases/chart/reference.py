"""The reference exitance of a benchmark: a closed form, or else a far finer run of tetlux."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tetlux.cases.chart.samples import Samples, project_to_sphere
from tetlux.cases.file.case import Case
from tetlux.fem import PointDetector
from tetlux.fem.exact import layered_ball, sphere_light
from tetlux.fem.exact.registry import closed_forms, ideal_sources, polar_angle
from tetlux.fem.lights import CollimatedBeam, Deposit
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region, only_medium
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.solve import solve
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.solids import Slab, Sphere

# Tolerances of the reference run if there is no closed form: the first one that is met counts, or else the run with
# the least estimated error.
REFERENCE_TOLERANCES, REFERENCE_TETRAHEDRA = (0.001, 0.002, 0.005), 500_000
QUICK_TOLERANCES = (0.01,)
# Detector tolerance of the reference run of readings, and of that of a quick chart.
READINGS_TOLERANCE, QUICK_READINGS_TOLERANCE = 0.001, 0.02
# Descriptions of closed forms that hold on the whole body; that of a cylinder holds on its side only.
DESCRIPTIONS: dict[type, str] = {
    Sphere: "the same equation and boundary on the true sphere, solved in closed form",
    Slab: "the same equation and boundary on the endless slab, solved in closed form; both faces, away from the rim",
}


@dataclass(frozen=True, eq=False)
class Reference:
    """The reference exitance at the samples.

    Attributes
    ----------
    kind : {"closed form", "finer run"}
    description : str
        A phrase for the reader of a chart.
    exitance : (n,) ndarray
        Exitance at the samples, W/unit².
    error : float
        Estimated relative L2 error of the reference itself; 0 for a closed form.
    """

    kind: str
    description: str
    exitance: FloatArray
    error: float = 0.0


def closed_form_reference(
    case: Case, regions: Sequence[Region], deposits: Sequence[Deposit], samples: Samples
) -> tuple[Samples, Reference] | None:
    """Evaluate the closed form of the equation and boundary condition that the solver solves.

    Returns
    -------
    tuple of Samples and Reference, or None
        The samples where it holds, on the exact shape. None if there is no closed form for this shape or light, or a
        source is too near to a part where it does not hold.
    """
    shape, medium = case.surface.shape, case.medium
    if type(shape) not in DESCRIPTIONS:
        return None
    if isinstance(shape, Sphere):
        samples = project_to_sphere(samples, shape)
        known = _in_layered_ball(shape, medium, regions, deposits, samples) if regions else _in_beam(case, samples)
        if known is not None:
            return samples, Reference("closed form", DESCRIPTIONS[Sphere], known)
    if regions:
        return None
    try:
        form = next((f for f in closed_forms(shape, medium, deposits).values() if f.same_model), None)
        if form is None:
            return None
        samples = samples.where(form.holds_at(samples.points))
        return samples, Reference("closed form", DESCRIPTIONS[type(shape)], form.exitance(samples.points))
    except InputError:
        return None


def _in_layered_ball(
    shape: Sphere, medium: Medium, regions: Sequence[Region], deposits: Sequence[Deposit], samples: Samples
) -> FloatArray | None:
    """Exitance at samples of a ball of concentric layers with point sources in the outermost; None of another body."""
    inner = [region.surface.shape for region in regions]
    sources = ideal_sources(deposits)
    if sources is None or not sources.are_points:
        return None
    radii = [each.radius for each in inner if isinstance(each, Sphere) and each.center == shape.center]
    order = np.argsort(radii)
    if len(radii) < len(regions):
        return None
    media = [only_medium(regions[i]) for i in order]
    layers = [each for each in media if isinstance(each, Medium)] + [medium]
    center = np.asarray(shape.center)

    def of_unit_power(position: FloatArray) -> FloatArray:
        return layered_ball.point_exitance(
            layers,
            [*sorted(radii), shape.radius],
            source_radius=float(np.linalg.norm(position - center)),
            gamma=polar_angle(samples.points, position, center),
        )

    return sources.sum_of_points(of_unit_power, len(samples.points))


def _in_beam(case: Case, samples: Samples) -> FloatArray | None:
    """Exitance at samples of an index-matched ball in one beam that covers it; None in another light."""
    shape, medium = case.surface.shape, case.medium
    light = case.lights[0]
    if not (isinstance(shape, Sphere) and isinstance(light, CollimatedBeam) and len(case.lights) == 1):
        return None
    if light.spot is not None or medium.eta != 1.0:
        return None
    assert light.irradiance is not None
    center = np.asarray(shape.center)
    gamma = polar_angle(samples.points, center - np.asarray(light.direction), center)
    return light.irradiance * sphere_light.beam_exitance(medium, radius=shape.radius, gamma=gamma)


def finer_run_reference(case: Case, samples: Samples, *, quick: bool) -> Reference:
    """Run tetlux at the finest tolerance that it meets, or return the most accurate of its runs."""
    best: Solution | None = None
    for tolerance in QUICK_TOLERANCES if quick else REFERENCE_TOLERANCES:
        solution = solve(
            case.surface,
            case.medium,
            case.lights,
            tolerance=tolerance,
            most_tetrahedra=REFERENCE_TETRAHEDRA,
            cache=False,
        )
        if best is None or solution.error_estimate < best.error_estimate:
            best = solution
        if best.error_estimate <= tolerance:
            break
    assert best is not None
    size = f"{len(best.mesh.tetrahedra):,} tetrahedra"
    description = f"tetlux itself on {size}, estimated error {best.error_estimate:.2%}"
    exitance = np.asarray(best.exitance_at(samples.points))
    return Reference("finer run", description, exitance, best.error_estimate)


def finer_readings_reference(
    case: Case, regions: Sequence[Region], detectors: Sequence[PointDetector], *, quick: bool
) -> Reference:
    """Run tetlux at a fine tolerance of its readings; the error of the reference is the median of their bars."""
    tolerance = QUICK_READINGS_TOLERANCE if quick else READINGS_TOLERANCE
    solution = solve(
        case.surface,
        case.medium,
        case.lights,
        regions=regions,
        tolerance=None,
        detectors=detectors,
        detector_tolerance=tolerance,
        most_tetrahedra=REFERENCE_TETRAHEDRA,
        cache=False,
    )
    bars = [np.inf if reading.relative_error is None else reading.relative_error for reading in solution.readings]
    error, size = float(np.median(bars)), f"{len(solution.mesh.tetrahedra):,} tetrahedra"
    description = f"tetlux itself on {size}, with error bars of {error:.2%} in the median"
    return Reference("finer run", description, np.array([reading.exitance for reading in solution.readings]), error)
