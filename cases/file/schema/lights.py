"""The sections of the case file that describe lights, detectors and the camera."""

from typing import Annotated, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from tetlux.cases.file.schema.parts import Choice, Each, Encoding, Label, Length, Number, Section, Vector3


class PencilSpec(Section):
    """A pencil beam, as `tetlux.fem.PencilBeam`."""

    origin: Vector3
    direction: Vector3
    power: Each = Field(1.0, description="W")
    radius: Number = Field(0.0, description="unit")
    deposit: Literal["point", "line"] = "point"


class PointSpec(Section):
    """An isotropic point inside the body, as `tetlux.fem.PointSource`."""

    position: Vector3
    power: Each = Field(1.0, description="W")


class DiffuseSpec(Section):
    """Diffuse light from all around, as `tetlux.fem.DiffuseLight`."""

    irradiance: Each = Field(description="W/unit²")


class DiscSpec(Section):
    """A round spot, or a round patch of the surface."""

    center: Vector3
    radius: Length


class RectangleSpec(Section):
    """An even, rectangular spot."""

    center: Vector3
    width: Length
    height: Length
    up: Vector3 = Field((0.0, 1.0, 0.0), description="the direction that is up on it, not along the beam")


class ImageSpec(Section):
    """A spot with the pattern of an image."""

    file: str = Field(description="image file, relative to the case file")
    center: Vector3
    width: Length
    up: Vector3 = Field((0.0, 1.0, 0.0), description="the direction that is up on it, not along the beam")
    encoding: Encoding = "srgb"


class SpotSpec(Choice):
    """The cross-section of a beam."""

    disc: DiscSpec | None = None
    gaussian: DiscSpec | None = Field(None, description="exp(-2 r²/radius²)")
    rectangle: RectangleSpec | None = None
    image: ImageSpec | None = None


class CollimatedSpec(Section):
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
                "one_of", "power belongs to a spot; light on the whole body has an irradiance", {}
            )
        return self


class EnvironmentSpec(Section):
    """Light from all around by an image of the surroundings, as `tetlux.fem.EnvironmentLight`."""

    file: str = Field(description="image file, longitude by latitude, relative to the case file")
    brightest: Each = Field(description="radiance of a pixel of full brightness, W/(unit² sr)")
    up: Vector3 = Field((0.0, 0.0, 1.0), description="direction of the image's upper edge")
    front: Vector3 = Field((0.0, 1.0, 0.0), description="direction of the image's middle")
    encoding: Encoding = "srgb"


class EmissionSpec(Section):
    """Light that the volume emits, as `tetlux.fem.Emission`."""

    density: Each = Field(description="W/unit³")
    region: str | int | None = Field(
        None, description="name of a region, or body for what is outside all of them; name or number of a mesh's label"
    )


class LightSpec(Choice):
    """One light."""

    name: Label = Field("", description="default: kind and number, as in pencil_1")
    pencil: PencilSpec | None = None
    point: PointSpec | None = None
    diffuse: DiffuseSpec | None = None
    collimated: CollimatedSpec | None = None
    environment: EnvironmentSpec | None = None
    emission: EmissionSpec | None = None


class FibreSpec(DiscSpec):
    """A fibre that stands on the surface."""

    numerical_aperture: Number


class DetectorSpec(Choice):
    """A detector on the surface, see `tetlux.fem.outcome.detectors`."""

    name: Label
    point: Vector3 | None = None
    disc: DiscSpec | None = None
    fibre: FibreSpec | None = None


class CameraSpec(Section):
    """From where the surface is seen: a place, or a direction by two angles."""

    position: Vector3 | None = Field(
        None, description="the picture is taken from this side; radiance towards it is written with the surface"
    )
    azimuth: Number | None = Field(
        None, description="of the picture alone: degrees about up, from the x axis anticlockwise seen from above"
    )
    elevation: Annotated[float, Field(strict=True, ge=-90, le=90)] | None = Field(
        None, description="degrees above the horizon, with azimuth; 20 if not given"
    )

    @model_validator(mode="after")
    def _place_or_angles(self) -> "CameraSpec":
        if (self.position is None) == (self.azimuth is None):
            what = "neither" if self.position is None else "both"
            raise PydanticCustomError("one_of", "give position or azimuth, not {what}", {"what": what})
        if self.position is not None and self.elevation is not None:
            raise PydanticCustomError("one_of", "elevation belongs to azimuth; leave it out beside position", {})
        return self
