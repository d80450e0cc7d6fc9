"""`read_fit`: what a case asks to be fitted, checked before anything is solved."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tetlux.cases.file.body import CaseBody
from tetlux.cases.file.documents.document import Document, Key
from tetlux.cases.file.measured.table import Names, read_table
from tetlux.cases.file.media import tissue_arguments
from tetlux.cases.file.reader import Reader
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.schema.fit import FitReadingsSpec, FitSpec
from tetlux.cases.file.schema.media import Media, TissueSpec
from tetlux.fem.inverse.request import FitRequest, make_request
from tetlux.fem.lights import Light
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.meshing.arrays import FloatArray, NumberArray
from tetlux.meshing.errors import InputError

KEY: Key = ("fit",)


def read_fit(
    document: Document,
    spec: CaseSpec,
    body: CaseBody,
    names: Names,
    lights: Sequence[Mapping[str, Light]],
    frequencies: Sequence[float],
    reader: Reader,
) -> FitRequest | None:
    """Read the section `fit` and the readings that it names; None without it.

    Parameters
    ----------
    document : Document
    spec : CaseSpec
    body : CaseBody
        With the media that the fit begins with.
    names : Names
        Of channels, lights and detectors.
    lights, frequencies : sequence
        Of each channel.
    reader : Reader

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    if spec.fit is None:
        return None
    _check_channels(document, spec, lights, frequencies)
    modulated, unit = bool(frequencies[0]), body.surface.unit
    with document.at((*KEY, "readings")):
        readings, noise = _readings(spec.fit.readings, names, unit, reader, modulated=modulated)
    region_names = tuple(region.surface.name for region in body.regions)
    start = _start(document, spec, body, reader)
    with document.at(KEY, {name: (name,) for name in FitSpec.model_fields}):
        return make_request(
            unit,
            list(lights[0].values()),
            len(names.detectors),
            readings,
            spec.fit.unknowns,
            start,
            regions=body.regions,
            noise=noise if spec.fit.noise is None else spec.fit.noise,
            bounds=spec.fit.bounds,
            frequency=frequencies[0],
            region_names=region_names,
            light_names=names.lights,
        )


def _check_channels(
    document: Document, spec: CaseSpec, lights: Sequence[Mapping[str, Light]], frequencies: Sequence[float]
) -> None:
    """Refuse channels that one fit does not take together."""
    if len(lights) == 1:
        return
    media = [spec.medium, *(region.medium for region in spec.regions)]
    if not any(isinstance(medium, TissueSpec) for medium in media):
        raise document.error(
            KEY, "several channels are fitted by chromophores alone; give a medium by these, or write a case for each."
        )
    if len(set(frequencies)) > 1:
        raise document.error(KEY, "a fit is at one frequency; give one, or write a case for each.")
    if any(repr(dict(own)) != repr(dict(lights[0])) for own in lights):
        raise document.error(KEY, "a fit takes the same lights in all channels; give each light one value.")


def _start(document: Document, spec: CaseSpec, body: CaseBody, reader: Reader) -> list[Any]:
    """What the body and each region begin with."""
    assert spec.medium is not None
    parts: list[tuple[Key, Media, AnyMedium | Sequence[AnyMedium]]] = [(("medium",), spec.medium, body.media)]
    parts += [
        (("regions", number, "medium"), section.medium, region.medium)
        for number, (section, region) in enumerate(zip(spec.regions, body.regions, strict=True))
    ]
    return [
        tissue_arguments(key, section, body.surface.unit, document, reader)
        if isinstance(section, TissueSpec)
        else _one_or_all(media)
        for key, section, media in parts
    ]


def _one_or_all(media: AnyMedium | Sequence[AnyMedium]) -> AnyMedium | Sequence[AnyMedium]:
    """The medium of a single channel, or those of all."""
    return media[0] if isinstance(media, Sequence) and len(media) == 1 else media


def _readings(
    spec: FitReadingsSpec, names: Names, unit: str, reader: Reader, *, modulated: bool
) -> tuple[NumberArray, FloatArray | None]:
    """Readings, and their noise where a file has it, (c, l, d)."""
    if spec.file is not None:
        return read_table(reader.folder / spec.file, names, unit, modulated=modulated)
    assert spec.values is not None
    if modulated != (spec.phases is not None):
        verb = "give their phases" if modulated else "leave phases out"
        raise InputError(f"the light is {'modulated' if modulated else 'steady'}; {verb}.")
    values = _array(spec.values, names)
    if spec.phases is None:
        return values, None
    return values * np.exp(-1j * np.radians(_array(spec.phases, names))), None


def _array(values: list[Any], names: Names) -> FloatArray:
    """Numbers in nested lists as an array (c, l, d), nan where there is none."""
    try:
        array = np.array(values, dtype=float)
    except ValueError:
        array = np.zeros(0)
    least = tuple(size for size in names.shape[:2] if size > 1) + names.shape[2:]
    if array.shape not in (least, names.shape):
        channels, lights, detectors = names.shape
        raise InputError(
            f"there are {array.size} readings in lists of shape {array.shape}, or lists of different lengths; give "
            f"one for each of {detectors} detectors, in lists for {lights} lights and {channels} channels."
        )
    return array.reshape(names.shape)
