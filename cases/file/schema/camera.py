"""The section of the case file that describes the camera."""

from typing import Annotated

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from tetlux.cases.file.schema.parts import Number, Section, Vector3


class CameraSpec(Section):
    """Where the surface is seen from: a position, or a direction by two angles."""

    position: Vector3 | None = Field(
        None, description="the picture is taken from this side; radiance towards it is written with the surface"
    )
    azimuth: Number | None = Field(
        None, description="for the picture only: degrees about up, anticlockwise from the x axis as seen from above"
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
            raise PydanticCustomError("one_of", "elevation goes with azimuth; leave it out where position is given", {})
        return self
