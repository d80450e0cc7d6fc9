"""The sections of the case file that describe media."""

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from tetlux.cases.file.schema.parts import (
    TAG,
    Choice,
    Each,
    Label,
    Length,
    Number,
    Numbers,
    Section,
    Spacing,
    Vector3,
    shape_of,
)
from tetlux.fem.media.medium import BoundaryKind


class VolumeSpec(Section):
    """Values at the nodes or in the tetrahedra of a mesh."""

    file: str = Field(description="VTU file, relative to the case file")
    name: str = Field(description="name of the array of values in it")
    scale: Length = Field(1.0, description="factor on the file's coordinates")


class ImagesSpec(Section):
    """Grey images as slices along z."""

    files: str = Field(description="folder of PNG or TIFF slices, or one file of several pages")
    origin: Vector3 = Field(description="centre of the first pixel of the first slice, unit")
    spacing: Spacing = Field(description="width and height of a pixel, and distance between slices, unit")
    values: tuple[Number, Number] = Field(description="values of black and white, 1/unit")


class ArraySpec(Section):
    """A three-dimensional NumPy array."""

    file: str = Field(description=".npy file of values [x, y, z]")
    origin: Vector3 = Field(description="centre of the first voxel, unit")
    spacing: Spacing = Field(description="distance between neighbouring values, unit")


class FieldSpec(Choice):
    """A coefficient that varies in space, read from a file."""

    volume: VolumeSpec | None = None
    images: ImagesSpec | None = None
    array: ArraySpec | None = None


class TwoTermSpec(Section):
    """Two Henyey-Greenstein lobes, see `tetlux.fem.media.phase.two_term`."""

    g1: Number
    g2: Number
    share: Number = Field(description="weight of the first lobe")


class TableSpec(Section):
    """A tabulated phase function, see `tetlux.fem.media.phase.table`."""

    angles: Numbers = Field(description="degrees, ascending from 0 to 180")
    values: Numbers = Field(description="1/sr")


class PhaseSpec(Choice):
    """The phase function of scattering."""

    henyey_greenstein: Number | None = Field(None, description="mean cosine of the scattering angle")
    two_term: TwoTermSpec | None = None
    table: TableSpec | None = None


# One number, one for each channel, or a field.
Coefficient = Annotated[
    Annotated[Number, Tag(TAG + "one")]
    | Annotated[Numbers, Tag(TAG + "list")]
    | Annotated[FieldSpec, Tag(TAG + "mapping")],
    Discriminator(shape_of),
]


class MediumSpec(Section):
    """A medium by its coefficients, combined as in `tetlux.fem.Medium`."""

    sigma_a: Coefficient = Field(description="absorption coefficient, 1/unit")
    eta: Each = Field(description="refractive index relative to the outside")
    sigma_s_prime: Coefficient | None = Field(None, description="reduced scattering coefficient, 1/unit")
    sigma_s: Each | None = Field(None, description="scattering coefficient, 1/unit; with g or phase")
    g: Each | None = Field(None, description="mean cosine of the scattering angle; with sigma_s")
    phase: PhaseSpec | None = Field(None, description="phase function; with sigma_s, in place of g")
    boundary: BoundaryKind = "exact"


class SubstanceSpec(Section):
    """A substance by a spectrum of your own: a text file of wavelengths, nm, and values."""

    file: str = Field(
        description="two columns: nm, and molar extinction, 1/(cm mol/l), base 10 (with concentration), or absorption "
        "of the pure substance, 1/mm, base e (with fraction)"
    )
    concentration: Number | None = Field(None, description="mol/l")
    fraction: Number | None = Field(None, description="share of the volume")

    @model_validator(mode="after")
    def _one_amount(self) -> "SubstanceSpec":
        if (self.concentration is None) == (self.fraction is None):
            raise PydanticCustomError(
                "one_of",
                "give either concentration, with a file of molar extinction, or fraction, with a file of absorption",
            )
        return self


class ChromophoresSpec(Section):
    """What absorbs in tissue, see `tetlux.fem.tissue`."""

    hbo2: Number = Field(0.0, description="oxygenated haemoglobin, mol/l of tissue")
    hhb: Number = Field(0.0, description="deoxygenated haemoglobin, mol/l of tissue")
    water: Number = Field(0.0, description="share of the volume")
    fat: Number = Field(0.0, description="share of the volume")
    others: dict[Label, SubstanceSpec] = Field({}, description="substances of your own, by name")


class ScatteringSpec(Section):
    """Reduced scattering a (wavelength/500 nm)^-b."""

    a: Number = Field(description="reduced scattering at 500 nm, 1/mm")
    b: Number = Field(description="its power")


class TissueSpec(Section):
    """A medium by what it consists of: a channel for each wavelength."""

    chromophores: ChromophoresSpec
    scattering: ScatteringSpec
    wavelengths: Numbers = Field(description="nm; each makes a channel of this name")
    eta: Number = Field(description="refractive index relative to the outside")
    boundary: BoundaryKind = "exact"


class MaterialSpec(Section):
    """A measured material: three channels, red, green and blue."""

    material: str = Field(description="see tetlux.fem.media.materials")


# Keys that only media by chromophores have.
OF_TISSUE = ("chromophores", "wavelengths")


def _kind(value: Any) -> str:
    if isinstance(value, list | tuple):
        return TAG + "list"
    if isinstance(value, MaterialSpec) or (isinstance(value, dict) and "material" in value):
        return TAG + "material"
    if isinstance(value, TissueSpec) or (isinstance(value, dict) and not value.keys().isdisjoint(OF_TISSUE)):
        return TAG + "tissue"
    return TAG + "mapping"


# A medium for all channels, or a list with one for each.
Media = Annotated[
    Annotated[MediumSpec, Tag(TAG + "mapping")]
    | Annotated[MaterialSpec, Tag(TAG + "material")]
    | Annotated[TissueSpec, Tag(TAG + "tissue")]
    | Annotated[list[MediumSpec], Tag(TAG + "list"), Field(min_length=1)],
    Discriminator(_kind),
]
