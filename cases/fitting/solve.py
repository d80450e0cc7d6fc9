"""`fit_case`: unknowns of a case from what its detectors have read, and the case with what was found."""

from collections.abc import Callable
from dataclasses import replace

from tetlux.cases.file.case import Case
from tetlux.fem.inverse.fit import DETECTOR_TOLERANCE, fit_request
from tetlux.fem.inverse.result import FitResult
from tetlux.fem.media.region import Region


def fit_case(case: Case, report: Callable[[str], None]) -> FitResult:
    """Fit what a case asks for."""
    assert case.fit is not None
    return fit_request(
        case.surface,
        list(case.channels[0].lights.values()),
        [entry.detector for entry in case.detectors],
        case.fit,
        regions=case.regions,
        frequency=case.frequencies[0],
        outside_index=case.outside_index,
        detector_tolerance=case.detector_tolerance or DETECTOR_TOLERANCE,
        report=report,
    )


def with_fitted(case: Case, found: FitResult) -> Case:
    """The case with the media and the places of lights that were found."""
    channels = tuple(
        replace(channel, medium=media[0], media=media[0], lights=dict(zip(channel.lights, found.lights, strict=True)))
        for channel, media in zip(case.channels, found.media, strict=True)
    )
    regions = tuple(
        Region(region.surface, [media[number] for media in found.media])
        for number, region in enumerate(case.regions, 1)
    )
    return replace(case, channels=channels, regions=regions)
