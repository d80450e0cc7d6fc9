"""The sections of the case file that describe the body: surfaces, regions, and volume meshes made elsewhere."""

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from tetlux.cases.file.schema.media import Media
from tetlux.cases.file.schema.parts import Choice, Label, Length, Section, Vector3


class SphereSpec(Section):
    """A sphere."""

    radius: Length
    center: Vector3 = (0.0, 0.0, 0.0)


class SlabSpec(Section):
    """A square plate whose upper face is z = 0."""

    width: Length
    depth: Length


class BoxSpec(Section):
    """A box with edges along the axes."""

    size: tuple[Length, Length, Length]
    center: Vector3 = (0.0, 0.0, 0.0)


class CylinderSpec(Section):
    """A cylinder along z."""

    radius: Length
    height: Length
    center: Vector3 = (0.0, 0.0, 0.0)


class TorusSpec(Section):
    """A torus around z."""

    major: Length
    minor: Length
    center: Vector3 = (0.0, 0.0, 0.0)


class SurfaceSpec(Choice):
    """The body: a surface file, or one built-in shape."""

    file: str | None = Field(None, description="surface file, relative to the case file")
    scale: Length = Field(1.0, description="factor on the file's coordinates")
    crease_angle: float = Field(
        30.0,
        ge=0,
        le=180,
        description="degrees; triangles that bend by less form a smooth surface; 0: all are flat",
    )
    holes: Literal["small", "close", "refuse"] = Field(
        "small", description="which holes are capped: small ones, all (close) or none (refuse)"
    )
    sphere: SphereSpec | None = None
    slab: SlabSpec | None = None
    box: BoxSpec | None = None
    cylinder: CylinderSpec | None = None
    torus: TorusSpec | None = None

    @model_validator(mode="after")
    def _scale_of_a_file(self) -> "SurfaceSpec":
        if self.file is None and self.scale != 1.0:
            raise PydanticCustomError("scale", "scale applies to a surface file; give a shape its lengths directly")
        if self.file is None and self.holes != "small":
            raise PydanticCustomError("holes", "holes applies to a surface file; leave it out")
        return self


class RegionSpec(Section):
    """A closed surface inside the body, and the medium inside it."""

    name: Label = Field("", description="default: region and number, as in region_1")
    surface: SurfaceSpec
    medium: Media


class MeshSpec(Section):
    """A volume mesh made elsewhere, with a medium for each of its labels."""

    file: str = Field(description="volume mesh, relative to the case file")
    scale: Length = Field(1.0, description="factor on the file's coordinates")
    array: str | None = Field(None, description="the array of labels in the file, if there are several")
    labels: Annotated[dict[str, Media], Field(min_length=1)] = Field(
        description="the medium of each label, by its number or name; 0 if there are no labels"
    )

    @field_validator("labels", mode="before")
    @classmethod
    def _numbers_as_words(cls, labels: Any) -> Any:
        return {str(label): medium for label, medium in labels.items()} if isinstance(labels, dict) else labels
