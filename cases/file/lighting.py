"""From the case file's lights to those that are solved for, by channel."""

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import BaseModel

from tetlux.cases.file.channels import of_channel
from tetlux.cases.file.document import Key
from tetlux.cases.file.images import of_channel as colour_of_channel
from tetlux.cases.file.reading import Reader
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.schema.lights import CollimatedSpec, EmissionSpec, EnvironmentSpec, LightSpec, SpotSpec
from tetlux.fem.lights import (
    CollimatedBeam,
    DiffuseLight,
    Disc,
    Emission,
    EnvironmentLight,
    Gaussian,
    Image,
    Light,
    PencilBeam,
    PointSource,
    Rectangle,
)
from tetlux.fem.lights.point import check_positive
from tetlux.meshing.errors import InputError

AnySpot = Disc | Gaussian | Rectangle | Image

# What is outside all regions, as the region of an emission.
BODY = "body"
# Lights whose parameters are the keys of their sections.
SIMPLE: dict[str, Callable[..., Light]] = {
    "pencil": PencilBeam,
    "point": PointSource,
    "diffuse": DiffuseLight,
    "emission": Emission,
}


def light_names(spec: CaseSpec) -> tuple[str, ...]:
    """Names of the lights of a case, as given or by kind and number."""
    kinds = [light.kind for light in spec.lights]
    return tuple(
        light.name or f"{light.kind}_{kinds[: i + 1].count(light.kind)}" for i, light in enumerate(spec.lights)
    )


def keys_of(spec: BaseModel) -> dict[str, Key]:
    """Where in the section of a light its values stand, by their names."""
    found: dict[str, Key] = {}
    for name, value in spec:
        if isinstance(value, BaseModel):
            found |= {word: (name, *key) for word, key in keys_of(value).items()}
        else:
            found[name] = (name,)
    return found


def light_of(
    spec: LightSpec, channel: int, count: int, regions: Mapping[str, int | None], reader: Reader
) -> Light | None:
    """A light in one of the channels, or None where it is dark: in a list of powers 0 stands for that.

    Parameters
    ----------
    spec : LightSpec
    channel, count : int
        Number of the channel, and of channels.
    regions : mapping of str to int
        Numbers of the regions, or labels, by name; None is the whole body.
    reader : Reader

    Raises
    ------
    InputError
        If a value is wrong.
    """
    section = getattr(spec, spec.kind)
    values: dict[str, Any] = {
        name: of_channel(value, channel) if isinstance(value, list) else value for name, value in section
    }
    if any(isinstance(value, list) and value[channel] == 0 for _, value in section):
        return None
    if spec.collimated:
        return _collimated(spec.collimated, values, channel, count, reader)
    if spec.environment:
        return _environment(spec.environment, values["brightest"], channel, count, reader)
    if spec.emission:
        values["region"] = _region(spec.emission, regions)
    return SIMPLE[spec.kind](**values)


def _collimated(
    spec: CollimatedSpec, values: dict[str, Any], channel: int, count: int, reader: Reader
) -> CollimatedBeam | None:
    spot = None
    if spec.spot is not None:
        spot = _spot(spec.spot, channel, count, reader)
        if spot is None:
            if spec.power is not None:
                raise InputError("the image is black in a channel that has power; give an irradiance instead.")
            return None
    irradiance = values["irradiance"]
    if irradiance is None:
        assert spot is not None
        irradiance = values["power"] / spot.area
    return CollimatedBeam(spec.direction, irradiance, spot)


def _spot(spec: SpotSpec, channel: int, count: int, reader: Reader) -> AnySpot | None:
    """A spot as one of the channels sees it, or None where an image is dark."""
    if spec.disc:
        return Disc(spec.disc.center, spec.disc.radius)
    if spec.gaussian:
        return Gaussian(spec.gaussian.center, spec.gaussian.radius)
    if spec.rectangle:
        return Rectangle(**dict(spec.rectangle))
    assert spec.image is not None
    s = spec.image
    colours = reader.pixels(s.file, s.encoding)
    pixels = colour_of_channel(colours, channel, count)
    # An image that is black in all channels is refused by the spot.
    dark = not pixels.any() and colours.any()
    return None if dark else Image(s.center, s.width, pixels, s.up)


def _environment(spec: EnvironmentSpec, brightest: float, channel: int, count: int, reader: Reader) -> Light | None:
    check_positive(brightest, "brightest", "W/(unit² sr)")
    colours = reader.pixels(spec.file, spec.encoding)
    pixels = colour_of_channel(colours, channel, count)
    if not pixels.any() and colours.any():
        return None
    return EnvironmentLight(brightest * pixels, up=spec.up, front=spec.front)


def _region(spec: EmissionSpec, regions: Mapping[str, int | None]) -> int | None:
    if spec.region is None:
        return None
    name = str(spec.region)
    if name not in regions:
        raise InputError(f'there is no region "{name}"; the regions here are {", ".join(regions)}.')
    return regions[name]
