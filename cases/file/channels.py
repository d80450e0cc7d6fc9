"""Channels of a case: their number, their names, and the values of each."""

from collections.abc import Iterator

from tetlux.cases.file.colours import RGB
from tetlux.cases.file.documents.document import Document, Key, format_key
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.schema.media import MaterialSpec, Media, TissueSpec

# The name of a single channel, and that of the sum of all lights.
ALL = "all"
# What the light that excites dyes and the light that they emit are called, alone or after the name of a channel.
EXCITATION, EMISSION = "excitation", "emission"


def value_in_channel(value: float | list[float], channel: int) -> float:
    """The value in one channel of what may be a list with a value for each."""
    return value[channel] if isinstance(value, list) else value


def channel_names(document: Document, spec: CaseSpec) -> tuple[str, ...]:
    """Names of the channels of a case.

    Raises
    ------
    InputError
        If its lists differ in length, or a name is given twice.
    """
    first: tuple[Key, int] | None = None
    for key, length in _lists(spec):
        first = first or (key, length)
        if length != first[1]:
            raise document.error(
                key,
                f"this makes {_describe(length)}, and {format_key(first[0])} makes {_describe(first[1])}; give a "
                "value for each channel, or a single one for all.",
            )
    count = first[1] if first else 1
    wavelengths = _wavelengths(document, spec)
    frequencies = _frequencies(document, spec)
    if spec.channels is None and (wavelengths or frequencies):
        return wavelengths or frequencies
    if spec.channels is None:
        return RGB if count == 3 else (ALL,) if count == 1 else tuple(str(i) for i in range(1, count + 1))
    check_unique_names(document, "channels", spec.channels)
    if set(spec.channels) == set(RGB) and tuple(spec.channels) != RGB:
        raise document.error(("channels",), "give red, green and blue in this order, that of materials and images.")
    return tuple(spec.channels)


def names_with_emission(names: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the channels of a case with dyes: of the light that excites them, then of the light that they emit."""
    kinds = EXCITATION, EMISSION
    return kinds if names == (ALL,) else tuple(f"{name}_{kind}" for kind in kinds for name in names)


def check_unique_names(document: Document, section: str, names: list[str] | tuple[str, ...]) -> None:
    """Refuse a list of a section in which a name is given twice.

    Raises
    ------
    InputError
    """
    for i, name in enumerate(names):
        if name in names[:i]:
            raise document.error((section, i), f'the name "{name}" is given twice; give one of them another name.')


def _wavelengths(document: Document, spec: CaseSpec) -> tuple[str, ...]:
    """The wavelengths of media by chromophores, in words; none without such media.

    Raises
    ------
    InputError
        If media differ in them, or one is given twice.
    """
    first: tuple[Key, tuple[str, ...]] | None = None
    for key, medium in _media(spec):
        if not isinstance(medium, TissueSpec):
            continue
        names = tuple(f"{wavelength:.10g}" for wavelength in medium.wavelengths)
        first = first or (key, names)
        if names != first[1]:
            raise document.error(
                (*key, "wavelengths"),
                f"these are {', '.join(names)} nm, and {format_key(first[0])} has {', '.join(first[1])} nm; give all "
                "media the same wavelengths.",
            )
        if len(set(names)) < len(names):
            raise document.error((*key, "wavelengths"), "a wavelength is given twice; leave one of the two out.")
    return first[1] if first else ()


def _frequencies(document: Document, spec: CaseSpec) -> tuple[str, ...]:
    """The frequencies of a list of them, in words; none without a list."""
    given = spec.modulation.frequency if spec.modulation else 0.0
    if not isinstance(given, list):
        return ()
    if len(set(given)) < len(given) and spec.channels is None and not _wavelengths(document, spec):
        raise document.error(("modulation", "frequency"), "a frequency is given twice; leave one of the two out.")
    return tuple(f"{frequency / 1e6:.10g}MHz" for frequency in given)


def _media(spec: CaseSpec) -> Iterator[tuple[Key, Media]]:
    """All media of a case, with their keys."""
    if spec.medium is not None:
        yield ("medium",), spec.medium
    if spec.mesh is not None:
        for label, medium in spec.mesh.labels.items():
            yield ("mesh", "labels", label), medium
    for i, region in enumerate(spec.regions):
        yield ("regions", i, "medium"), region.medium


def _media_of_emission(spec: CaseSpec) -> Iterator[tuple[Key, Media]]:
    """The media at the wavelength that dyes emit, which may differ in their wavelengths from all others."""
    if spec.fluorescence is not None:
        yield ("fluorescence", "emission"), spec.fluorescence.emission
        for name, medium in spec.fluorescence.regions.items():
            yield ("fluorescence", "regions", name), medium


def _describe(length: int) -> str:
    return "1 channel" if length == 1 else f"{length} channels"


def _lists(spec: CaseSpec) -> Iterator[tuple[Key, int]]:
    """The keys of all values that are lists by channel, and their lengths."""
    if spec.channels is not None:
        yield ("channels",), len(spec.channels)
    for key, medium in (*_media(spec), *_media_of_emission(spec)):
        yield from _lists_of_medium(key, medium)
    if spec.modulation is not None and isinstance(spec.modulation.frequency, list):
        yield ("modulation", "frequency"), len(spec.modulation.frequency)
    for i, light in enumerate(spec.lights):
        for name, value in getattr(light, light.kind):
            if isinstance(value, list):
                yield ("lights", i, light.kind, name), len(value)


def _lists_of_medium(key: Key, medium: Media) -> Iterator[tuple[Key, int]]:
    if isinstance(medium, MaterialSpec):
        yield (*key, "material"), len(RGB)
        return
    if isinstance(medium, TissueSpec):
        yield (*key, "wavelengths"), len(medium.wavelengths)
        return
    if isinstance(medium, list):
        yield key, len(medium)
        for i, each in enumerate(medium):
            yield from _lists_of_medium((*key, i), each)
        return
    for name, value in medium:
        if isinstance(value, list):
            yield (*key, name), len(value)
