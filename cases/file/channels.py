"""Channels: how many a case has, what they are called, and which of a list's values is whose."""

from collections.abc import Iterator

from tetlux.cases.file.colours import RGB
from tetlux.cases.file.document import Document, Key, dotted
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.schema.media import MaterialSpec, Media

# The name of the only channel, and what the sum of all lights is called.
ALL = "all"


def of_channel(value: float | list[float], channel: int) -> float:
    """What a value is in one channel."""
    return value[channel] if isinstance(value, list) else value


def channel_names(document: Document, spec: CaseSpec) -> tuple[str, ...]:
    """Names of the channels of a case.

    Raises
    ------
    InputError
        If its lists differ in length, or names stand twice.
    """
    first: tuple[Key, int] | None = None
    for key, length in _lists(spec):
        first = first or (key, length)
        if length != first[1]:
            raise document.error(
                key,
                f"this makes {_describe(length)}, and {dotted(first[0])} makes {_describe(first[1])}; give one value "
                "for each channel, or a single one for all.",
            )
    count = first[1] if first else 1
    if spec.channels is None:
        return RGB if count == 3 else (ALL,) if count == 1 else tuple(str(i) for i in range(1, count + 1))
    check_different(document, "channels", spec.channels)
    if set(spec.channels) == set(RGB) and tuple(spec.channels) != RGB:
        raise document.error(("channels",), "red, green and blue stand in this order, as in materials and images.")
    return tuple(spec.channels)


def check_different(document: Document, section: str, names: list[str] | tuple[str, ...]) -> None:
    """Refuse a name that a section's list gives twice.

    Raises
    ------
    InputError
    """
    for i, name in enumerate(names):
        if name in names[:i]:
            raise document.error((section, i), f'the name "{name}" stands here twice; give another one.')


def _describe(length: int) -> str:
    return "1 channel" if length == 1 else f"{length} channels"


def _lists(spec: CaseSpec) -> Iterator[tuple[Key, int]]:
    """Everything that says how many channels there are, with how many."""
    if spec.channels is not None:
        yield ("channels",), len(spec.channels)
    if spec.medium is not None:
        yield from _lists_of_medium(("medium",), spec.medium)
    if spec.mesh is not None:
        for label, medium in spec.mesh.labels.items():
            yield from _lists_of_medium(("mesh", "labels", label), medium)
    for i, region in enumerate(spec.regions):
        yield from _lists_of_medium(("regions", i, "medium"), region.medium)
    for i, light in enumerate(spec.lights):
        for name, value in getattr(light, light.kind):
            if isinstance(value, list):
                yield ("lights", i, light.kind, name), len(value)


def _lists_of_medium(key: Key, medium: Media) -> Iterator[tuple[Key, int]]:
    if isinstance(medium, MaterialSpec):
        yield (*key, "material"), len(RGB)
        return
    if isinstance(medium, list):
        yield key, len(medium)
        for i, each in enumerate(medium):
            yield from _lists_of_medium((*key, i), each)
        return
    for name, value in medium:
        if isinstance(value, list):
            yield (*key, name), len(value)
