"""`Benchmark`: a case, points of its surface, and the reference exitance there."""

from dataclasses import dataclass, replace

import numpy as np

from tetlux.cases.chart.reference import Reference, closed_form_reference, finer_readings_reference, finer_run_reference
from tetlux.cases.chart.samples import Samples, relative_error, surface_samples
from tetlux.cases.file.case import Case
from tetlux.fem import PointDetector
from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import SurfacePartition
from tetlux.fem.exact.registry import ideal_sources
from tetlux.fem.grading import places_to_resolve
from tetlux.fem.lights import Deposit
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region, only_medium
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import RunError
from tetlux.meshing.surface.solids import Shape

# Short runs are repeated this many times, since other processes disturb their timing.
REPEATS = 3
# Light that enters in more places than this is wide, and needs no more samples where it enters.
MOST_PLACES = 100
# What is compared at samples of the surface, and at detectors.
EXITANCE, READINGS = "relative L2 error of exitance", "median relative error of readings"


@dataclass(frozen=True, eq=False)
class Benchmark:
    """A case on which methods are compared.

    Attributes
    ----------
    case : Case
    deposits : list of Deposit
        The deposits of its lights.
    samples : Samples
        Points where exitance is compared.
    reference : Reference
    repeats : int
        How many times a short run is made; the fastest counts.
    detectors : tuple of PointDetector
        If there are some, they are the samples, and the error is the median of theirs.
    """

    case: Case
    deposits: list[Deposit]
    samples: Samples
    reference: Reference
    repeats: int = 1
    detectors: tuple[PointDetector, ...] = ()

    @property
    def shape(self) -> Shape | None:
        """The built-in shape of the surface, if it has one."""
        return self.case.surface.shape

    @property
    def regions(self) -> list[Region]:
        """The regions of the case, each with its medium in the only channel."""
        return regions_of(self.case)

    @property
    def lit(self) -> tuple[FloatArray, FloatArray]:
        """Points where light is deposited, and the lengths to resolve there; see `places_to_resolve`."""
        return places_to_resolve(self.deposits)

    @property
    def sources(self) -> list[tuple[FloatArray, float]]:
        """Positions (3,) and powers, W, of all point deposits."""
        terms = [deposit.terms for deposit in self.deposits]
        return [(point, float(power)) for t in terms for point, power in zip(t.points, t.powers, strict=True)]

    @property
    def has_point_sources(self) -> bool:
        """Whether all deposits are points."""
        sources = ideal_sources(self.deposits)
        return sources is not None and sources.are_points

    @property
    def quantity(self) -> str:
        """What `error_of` returns, in words."""
        return READINGS if self.detectors else EXITANCE

    def error_of(self, exitance: FloatArray) -> float:
        """Error of an exitance (n,) at the samples: over the surface in L2, or of detectors the median."""
        if self.detectors:
            return float(np.median(np.abs(exitance / self.reference.exitance - 1.0)))
        return relative_error(exitance, self.reference.exitance, self.samples.weights)


def regions_of(case: Case) -> list[Region]:
    """The regions of a case with one channel, each with its only medium."""
    media = [medium if isinstance(medium := region.medium, AnyMedium) else medium[0] for region in case.regions]
    return [replace(region, medium=medium) for region, medium in zip(case.regions, media, strict=True)]


def _deposits(case: Case) -> list[Deposit]:
    regions = regions_of(case)
    media = [case.medium, *map(only_medium, regions)]
    body = Body(case.surface, media, SurfacePartition([region.surface for region in regions]))
    return [light.deposit_in(body) for light in case.lights]


def prepare_benchmark(case: Case, *, quick: bool = False) -> Benchmark:
    """Choose sample points of a case, and compute the reference exitance there.

    Raises
    ------
    RunError
        If the case has several media, the reference run fails, or no light leaves the body.
    """
    if not case.has_single_medium:
        raise RunError("a chart needs one channel and one uniform medium; leave lists, regions and fields out.")
    surface, deposits = case.surface, _deposits(case)
    places, resolutions = places_to_resolve(deposits)
    if len(places) > MOST_PLACES:
        places, resolutions = places[:0], resolutions[:0]
    samples = surface_samples(surface, places, resolutions)
    referenced = closed_form_reference(case, [], deposits, samples)
    if referenced is None:
        # Triangles may stand for a smooth surface: move the samples onto it.
        samples = samples._replace(points=surface.project(samples.points)[0])
        referenced = samples, finer_run_reference(case, samples, quick=quick)
    samples, reference = referenced
    _check_lit(reference)
    return Benchmark(case, deposits, samples, reference, 1 if quick else REPEATS)


def prepare_readings_benchmark(case: Case, *, quick: bool = False) -> Benchmark:
    """Take the point detectors of a case as samples, and compute the reference of what they read.

    Raises
    ------
    RunError
        If the case has several channels, media that vary, other detectors or none, the reference run fails, or no light
        leaves the body.
    """
    regions = regions_of(case)
    media = [case.channels[0].medium, *map(only_medium, regions)]
    if len(case.channels) > 1 or case.mesh or not all(isinstance(medium, Medium) for medium in media):
        raise RunError("a chart of readings needs one channel and uniform media; leave lists, meshes and fields out.")
    detectors = tuple(each.detector for each in case.detectors if isinstance(each.detector, PointDetector))
    if not detectors or len(detectors) < len(case.detectors):
        raise RunError("a chart of readings needs detectors that are points; give some, and no others.")
    points, normals = case.surface.project(np.array([detector.position for detector in detectors]))
    samples, deposits = Samples(points, normals, np.ones(len(points))), _deposits(case)
    referenced = closed_form_reference(case, regions, deposits, samples)
    if referenced is None or len(referenced[0].points) < len(points):
        referenced = samples, finer_readings_reference(case, regions, detectors, quick=quick)
    samples, reference = referenced
    _check_lit(reference)
    return Benchmark(case, deposits, samples, reference, 1 if quick else REPEATS, detectors)


def _check_lit(reference: Reference) -> None:
    if not np.max(reference.exitance, initial=0.0) > 0:
        raise RunError("no light leaves the body; give a smaller or less absorbing one.")
