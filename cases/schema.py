"""The case file: its keys, their types, and what they are made into."""

import difflib
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Length = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
Vector3 = tuple[Number, Number, Number]


class Section(BaseModel):
    """A mapping of the case file, which holds no other keys than these."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        for key in data:
            if key not in cls.model_fields:
                close = difflib.get_close_matches(str(key), cls.model_fields, n=1)
                hint = f'did you mean "{close[0]}"? ' if close else ""
                raise PydanticCustomError(
                    "unknown_key",
                    "unknown key; {hint}the keys here are {known}",
                    {"key": str(key), "hint": hint, "known": ", ".join(cls.model_fields)},
                )
        return data


class Choice(Section):
    """A mapping that holds exactly one of the keys that have no default."""

    @model_validator(mode="after")
    def _exactly_one(self) -> "Choice":
        kinds = self.kinds()
        given = [name for name in kinds if getattr(self, name) is not None]
        if len(given) != 1:
            raise PydanticCustomError(
                "one_of",
                "give exactly one of {known}, not {given}",
                {"known": ", ".join(kinds), "given": " and ".join(given) if given else "none"},
            )
        return self

    @classmethod
    def kinds(cls) -> list[str]:
        """The keys of which one is given."""
        return [name for name, field in cls.model_fields.items() if field.default is None]

    @property
    def kind(self) -> str:
        """The key that is given."""
        return next(name for name in self.kinds() if getattr(self, name) is not None)


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
    """A torus round z."""

    major: Length
    minor: Length
    center: Vector3 = (0.0, 0.0, 0.0)


class SurfaceSpec(Choice):
    """The body: a surface file, or one built-in shape."""

    file: str | None = Field(None, description="surface file, relative to the case file")
    scale: Length = Field(1.0, description="factor on the file's coordinates")
    crease_angle: float = Field(
        30.0, ge=0, le=180, description="degrees; triangles that bend less are one smooth surface, 0: all are flat"
    )
    sphere: SphereSpec | None = None
    slab: SlabSpec | None = None
    box: BoxSpec | None = None
    cylinder: CylinderSpec | None = None
    torus: TorusSpec | None = None

    @model_validator(mode="after")
    def _scale_of_a_file(self) -> "SurfaceSpec":
        if self.file is None and self.scale != 1.0:
            raise PydanticCustomError("scale", "scale belongs to a file; give the shape its own lengths")
        return self


class MediumSpec(Section):
    """The medium; the rules between its keys are those of `tetlux.fem.Medium`."""

    sigma_a: Number = Field(description="absorption coefficient, 1/unit")
    eta: Number = Field(description="refractive index relative to the outside")
    sigma_s_prime: Number | None = Field(None, description="reduced scattering coefficient, 1/unit")
    sigma_s: Number | None = Field(None, description="scattering coefficient, 1/unit; with g")
    g: Number | None = Field(None, description="mean cosine of the scattering angle; with sigma_s")
    boundary: Literal["exact", "classic"] = "exact"


class PencilSpec(Section):
    """A pencil beam, as `tetlux.fem.PencilBeam`."""

    origin: Vector3
    direction: Vector3
    power: Number = Field(1.0, description="W")
    radius: Number = Field(0.0, description="unit")
    deposit: Literal["point", "line"] = "point"


class PointSpec(Section):
    """An isotropic point inside the body, as `tetlux.fem.PointSource`."""

    position: Vector3
    power: Number = Field(1.0, description="W")


class DiffuseSpec(Section):
    """Diffuse light from all around, as `tetlux.fem.DiffuseLight`."""

    irradiance: Number = Field(description="W/unit²")


class LightSpec(Choice):
    """One light."""

    pencil: PencilSpec | None = None
    point: PointSpec | None = None
    diffuse: DiffuseSpec | None = None


ClosedForm = Literal["robin", "images", "dipole", "series"]
Output = Literal["surface", "volume", "picture"]
SweepValue = Annotated[int, Field(strict=True)] | Number | Annotated[str, Field(strict=True)]


class CaseSpec(Section):
    """One scene."""

    name: Annotated[str, Field(pattern=r"^[\w][\w .+=,-]*$", max_length=120)] | None = Field(
        None, description="names the folder of results; the file's name if not given"
    )
    unit: Literal["nm", "um", "mm", "cm", "m", "in"] = "mm"
    surface: SurfaceSpec
    medium: MediumSpec
    lights: Annotated[list[LightSpec], Field(min_length=1)]
    tolerance: Annotated[float, Field(strict=True, ge=1e-4, lt=1)] = Field(
        0.02, description="wanted relative L2 error of the exitance"
    )
    outputs: list[Output] = ["surface", "volume", "picture"]
    compare: Annotated[list[ClosedForm], Field(min_length=1)] | None = Field(
        None,
        description="closed forms to compare with: robin, images, dipole for slabs; series for spheres and cylinders",
    )
    sweep: dict[str, Annotated[list[SweepValue], Field(min_length=1)]] | None = Field(
        None, description="values by dotted key; one run for each, several keys make a grid"
    )
