"""The sections of the case file that describe its pictures."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from tetlux.cases.file.schema.camera import CameraSpec
from tetlux.cases.file.schema.parts import TAG, ChannelName, Label, Number, Section, Vector3, shape_of

Pixels = Annotated[int, Field(strict=True, ge=500, le=8000)]
ColourMap = Literal["inferno", "viridis", "grey", "blue-red"]
PictureField = Literal["colours", "exitance", "fluence", "valid", "phase", "radiance"]
# Fields that are on a linear scale unless it is said otherwise.
LINEAR = ("valid", "phase")


class CutSpec(Section):
    """A plane that cuts the body open."""

    normal: Vector3 = Field(description="points to what is taken away")
    through: Vector3 | None = Field(None, description="a point of the plane; default: the middle of the body")


class PictureSpec(Section):
    """What one picture shows."""

    name: Label | None = Field(None, description="of the file, picture-NAME.png; default: picture.png, picture-2.png")
    field: PictureField | None = Field(
        None, description="default: colours of channels red, green and blue, fluence with a cut, else exitance"
    )
    channel: ChannelName | None = Field(None, description="default: the sum of all")
    light: str | None = Field(None, description="default: the sum of all")
    scale: Literal["log", "linear"] | None = Field(None, description="default: linear for valid and phase, else log")
    range: tuple[Number, Number] | None = Field(None, description="values at the ends of the colours")
    map: ColourMap = Field("inferno", description="the colour map")
    cut: CutSpec | None = Field(None, description="shows the fluence inside")
    camera: CameraSpec | None = Field(None, description="default: that of the case")
    pixels: tuple[Pixels, Pixels] | None = Field(None, description="width and height; default: 1400, 1050")
    turntable: Annotated[int, Field(strict=True, ge=2, le=360)] | None = Field(
        None, description="pictures of a GIF in which the body turns once, in place of a PNG"
    )

    @model_validator(mode="after")
    def _fits_together(self) -> "PictureSpec":
        if self.cut is not None and self.field not in (None, "fluence"):
            raise _error("cut shows the fluence; leave field or cut out")
        if self.range is not None:
            low, high = self.range
            if not low < high:
                raise _error("range needs the smaller value first")
            if self.shown_logarithmically and low <= 0:
                raise _error("range begins above 0 on a logarithmic scale; write scale: linear")
        if self.field == "colours":
            beside = [name for name in ("channel", "light", "scale", "range") if getattr(self, name) is not None]
            if beside:
                raise _error(f"colours have no {' and no '.join(beside)}; leave field out")
        if self.shows_fluence and self.light is not None:
            raise _error("the fluence is that of all lights together; leave light out")
        return self

    @property
    def shows_fluence(self) -> bool:
        """Whether it shows the fluence, at the boundary and on a cut."""
        return self.cut is not None or self.field == "fluence"

    @property
    def shown_logarithmically(self) -> bool:
        """Whether colours follow the logarithm."""
        return self.scale == "log" if self.scale else self.field not in LINEAR

    @property
    def chooses_values(self) -> bool:
        """Whether it asks for something that colours of their own do not have."""
        named = (self.field, self.channel, self.light, self.scale, self.range, self.cut)
        return self.field != "colours" and (any(each is not None for each in named) or self.map != "inferno")


def _error(sentence: str) -> PydanticCustomError:
    return PydanticCustomError("picture", "{sentence}", {"sentence": sentence})


# One picture, or a list of them.
Pictures = Annotated[
    Annotated[PictureSpec, Tag(TAG + "one")]
    | Annotated[PictureSpec, Tag(TAG + "mapping")]
    | Annotated[list[PictureSpec], Field(min_length=1), Tag(TAG + "list")],
    Discriminator(shape_of),
]


def file_names(pictures: list[PictureSpec]) -> list[str]:
    """Names of the files of pictures, which may not be alike: the first without a name is picture.png."""
    names = []
    for number, picture in enumerate(pictures, 1):
        own = f"picture-{picture.name or number}" if picture.name or number > 1 else "picture"
        names.append(f"{own}.{'gif' if picture.turntable else 'png'}")
    return names
