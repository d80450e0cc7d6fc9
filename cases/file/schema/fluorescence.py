"""The section of the case file that describes dyes and the light that they emit."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, field_validator

from tetlux.cases.file.schema.lights import number_as_text
from tetlux.cases.file.schema.media import Media
from tetlux.cases.file.schema.parts import Number, Section


class DyeSpec(Section):
    """A fluorophore, as `tetlux.fem.Fluorophore`."""

    region: Annotated[str | None, BeforeValidator(number_as_text)] = Field(
        None, description="name of a region, body for the part outside of all, or name or number of a mesh's label"
    )
    absorption: Number = Field(description="of the dye at the wavelength of excitation, beside the medium's, 1/unit")
    quantum_yield: Number = Field(description="share of the absorbed light that is emitted, up to 1")
    lifetime: Number = Field(0.0, description="s")


class FluorescenceSpec(Section):
    """Dyes that the lights excite, and the media at the wavelength that they emit."""

    emission: Media = Field(description="medium of the body there, or of all labels of a mesh")
    regions: dict[str, Media] = Field(
        {}, description="media of regions or labels there, by name; of others as without dyes"
    )
    dyes: Annotated[list[DyeSpec], Field(min_length=1)]

    @field_validator("regions", mode="before")
    @classmethod
    def _numbers_as_words(cls, regions: Any) -> Any:
        return {str(name): medium for name, medium in regions.items()} if isinstance(regions, dict) else regions
