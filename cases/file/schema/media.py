"""The sections of the case file that describe media."""

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from tetlux.cases.file.schema.parts import (
    TAG,
    Choice,
    Each,
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


class MaterialSpec(Section):
    """A measured material: three channels, red, green and blue."""

    material: str = Field(description="see tetlux.fem.media.materials")


def _kind(value: Any) -> str:
    named = "material" in value if isinstance(value, dict) else isinstance(value, MaterialSpec)
    return TAG + ("material" if named else "list" if isinstance(value, list | tuple) else "mapping")


# A medium for all channels, or a list with one for each.
Media = Annotated[
    Annotated[MediumSpec, Tag(TAG + "mapping")]
    | Annotated[MaterialSpec, Tag(TAG + "material")]
    | Annotated[list[MediumSpec], Tag(TAG + "list"), Field(min_length=1)],
    Discriminator(_kind),
]
