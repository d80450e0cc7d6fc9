"""The sections of the case file that describe lights."""

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from tetlux.cases.file.schema.light_context import LightContext
from tetlux.cases.file.schema.parts import Choice, Each, Encoding, Label, Length, Number, Section, Vector3
from tetlux.cases.file.schema.spots import SpotSpec
from tetlux.fem.inputs import check_positive
from tetlux.fem.lights import (
    CollimatedBeam,
    DiffuseLight,
    DiffusePatch,
    Emission,
    EnvironmentLight,
    Light,
    PencilBeam,
    PointSource,
)
from tetlux.meshing.errors import InputError


class LightSection(Section):
    """The section of one kind of light, which builds that light."""

    def light(self, context: LightContext) -> Light | None:
        """Build the light of one channel, or return None where it is dark; called on what `in_channel` returns.

        Raises
        ------
        InputError
            If a value is wrong.
        """
        raise NotImplementedError

    def in_channel(self, channel: int) -> Self | None:
        """The section with each list replaced by its value in one channel, or None where such a value is 0 (dark)."""
        lists = {name: value[channel] for name, value in self if isinstance(value, list)}
        return None if 0 in lists.values() else self.model_copy(update=lists)

    def number(self, name: str) -> float:
        """The value of a key that may be a list, after `in_channel`."""
        value = getattr(self, name)
        assert not isinstance(value, list)
        return float(value)


class PencilSpec(LightSection):
    """A pencil beam, as `tetlux.fem.PencilBeam`."""

    origin: Vector3
    direction: Vector3
    power: Each = Field(1.0, description="W")
    radius: Number = Field(0.0, description="unit")
    deposit: Literal["point", "line"] = "point"

    def light(self, context: LightContext) -> Light:
        """See `LightSection`."""
        del context
        return PencilBeam(self.origin, self.direction, self.number("power"), self.radius, self.deposit)


class PointSpec(LightSection):
    """An isotropic point inside the body, as `tetlux.fem.PointSource`."""

    position: Vector3
    power: Each = Field(1.0, description="W")

    def light(self, context: LightContext) -> Light:
        """See `LightSection`."""
        del context
        return PointSource(self.position, self.number("power"))


class DiffuseSpec(LightSection):
    """Diffuse light from all around, as `tetlux.fem.DiffuseLight`."""

    irradiance: Each = Field(description="W/unit²")

    def light(self, context: LightContext) -> Light:
        """See `LightSection`."""
        del context
        return DiffuseLight(self.number("irradiance"))


class PatchSpec(LightSection):
    """Diffuse light on a round patch of the surface, as `tetlux.fem.DiffusePatch`."""

    center: Vector3
    radius: Length
    irradiance: Each = Field(description="W/unit²")

    def light(self, context: LightContext) -> Light:
        """See `LightSection`."""
        del context
        return DiffusePatch(self.center, self.radius, self.number("irradiance"))


class CollimatedSpec(LightSection):
    """Parallel light, as `tetlux.fem.CollimatedBeam`."""

    direction: Vector3
    irradiance: Each | None = Field(None, description="across the beam, where it is brightest, W/unit²")
    power: Each | None = Field(None, description="of the whole spot, W")
    spot: SpotSpec | None = Field(None, description="the beam's cross-section; without one it lights the whole body")

    @model_validator(mode="after")
    def _one_strength(self) -> "CollimatedSpec":
        given = [name for name in ("irradiance", "power") if getattr(self, name) is not None]
        if len(given) != 1:
            what = "both" if given else "neither"
            raise PydanticCustomError("one_of", "give irradiance or power, not {what}", {"what": what})
        if self.power is not None and self.spot is None:
            raise PydanticCustomError(
                "one_of", "power belongs to a spot; give light on the whole body an irradiance", {}
            )
        return self

    def light(self, context: LightContext) -> Light | None:
        """See `LightSection`."""
        if self.spot is None:
            return CollimatedBeam(self.direction, self.number("irradiance"))
        spot = self.spot.spot(context)
        if spot is None:
            if self.power is not None:
                raise InputError("the image is black in a channel that has power; give irradiance in place of power.")
            return None
        irradiance = self.number("irradiance") if self.power is None else self.number("power") / spot.area
        return CollimatedBeam(self.direction, irradiance, spot)


class EnvironmentSpec(LightSection):
    """Light from all around by an image of the surroundings, as `tetlux.fem.EnvironmentLight`."""

    file: str = Field(description="image file, longitude by latitude, relative to the case file")
    brightest: Each = Field(description="radiance of a pixel of full brightness, W/(unit² sr)")
    up: Vector3 = Field((0.0, 0.0, 1.0), description="direction of the image's upper edge")
    front: Vector3 = Field((0.0, 1.0, 0.0), description="direction of the image's middle")
    encoding: Encoding = "srgb"

    def light(self, context: LightContext) -> Light | None:
        """See `LightSection`."""
        brightest = self.number("brightest")
        check_positive(brightest, "brightest", "W/(unit² sr)")
        pixels = context.pixels(self.file, self.encoding)
        return None if pixels is None else EnvironmentLight(brightest * pixels, up=self.up, front=self.front)


def number_as_text(value: object) -> object:
    """Turn the number of a label into the text that it is looked up by."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


class EmissionSpec(LightSection):
    """Light that the volume emits, as `tetlux.fem.Emission`."""

    density: Each = Field(description="W/unit³")
    region: Annotated[str | None, BeforeValidator(number_as_text)] = Field(
        None,
        description="name of a region, body for the part outside of all, or name or number of a mesh's label",
    )

    def light(self, context: LightContext) -> Light:
        """See `LightSection`."""
        return Emission(self.number("density"), context.region(self.region))


class LightSpec(Choice):
    """One light."""

    name: Label = Field("", description="default: kind and number, as in pencil_1")
    pencil: PencilSpec | None = None
    point: PointSpec | None = None
    diffuse: DiffuseSpec | None = None
    patch: PatchSpec | None = None
    collimated: CollimatedSpec | None = None
    environment: EnvironmentSpec | None = None
    emission: EmissionSpec | None = None

    def light(self, context: LightContext) -> Light | None:
        """Build the light of one channel, or return None where it is dark.

        Raises
        ------
        InputError
            If a value is wrong.
        """
        section: LightSection = getattr(self, self.kind)
        here = section.in_channel(context.channel)
        return None if here is None else here.light(context)
