"""`CaseSpec`: the keys of the case file, with their types, defaults and descriptions."""

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from tetlux.cases.file.schema.body import MeshSpec, RegionSpec, SurfaceSpec
from tetlux.cases.file.schema.camera import CameraSpec
from tetlux.cases.file.schema.detectors import DetectorSpec
from tetlux.cases.file.schema.fit import FitSpec, refuse_beside_fit, refuse_without_readings
from tetlux.cases.file.schema.fluorescence import FluorescenceSpec
from tetlux.cases.file.schema.lights import LightSpec
from tetlux.cases.file.schema.media import Media
from tetlux.cases.file.schema.parts import TAG, ChannelName, Direction, Each, Number, Section, shape_of
from tetlux.cases.file.schema.pictures import Pictures, PictureSpec
from tetlux.cases.file.schema.pulse import PulseSpec, refuse_beside_pulse
from tetlux.cases.file.schema.sweep import SweepSpec
from tetlux.fem.inputs import DEFAULT_TOLERANCE


class ModulationSpec(Section):
    """Light modulated at a frequency."""

    frequency: Each = Field(description="Hz; 0 for steady light; a list makes a channel of each")
    outside_index: Number = Field(
        1.0, description="refractive index of what surrounds the body, to which eta is relative"
    )


ClosedForm = Literal["robin", "images", "dipole", "series"]
Output = Literal["surface", "volume", "picture", "viewer", "figures", "glb", "mitsuba", "film", "sensitivity"]
Model = Literal["full", "auto", "closed-form", "charges", "truncated"]
# Models that make no mesh.
WITHOUT_MESH = ("closed-form", "charges")
TOLERANCES_WITHOUT_MESH = {"closed-form": ("exitance",), "charges": ("exitance", "detectors")}


Relative = Annotated[float, Field(strict=True, ge=1e-4, lt=1)]


class ToleranceSpec(Section):
    """Tolerances of several quantities; what has none is as it comes."""

    exitance: Relative | None = Field(None, description="wanted relative L2 error of the exitance")
    detectors: Relative | None = Field(None, description="wanted relative error of what each detector reads")
    everywhere: Relative | None = Field(
        None, description="wanted relative error of the exitance at almost every point of the surface"
    )
    volume: Relative | None = Field(None, description="wanted relative error of the fluence almost everywhere inside")


Tolerance = Annotated[
    Annotated[Relative, Tag(TAG + "one")]
    | Annotated[Relative, Tag(TAG + "list")]
    | Annotated[ToleranceSpec, Tag(TAG + "mapping")],
    Discriminator(shape_of),
]


class CaseSpec(Section):
    """One scene."""

    name: Annotated[str, Field(pattern=r"^[\w][\w .+=,-]*$", max_length=120)] | None = Field(
        None, description="name of the folder of results; default: the file's name"
    )
    unit: Literal["nm", "um", "mm", "cm", "m", "in"] = "mm"
    surface: SurfaceSpec | None = None
    medium: Media | None = None
    mesh: MeshSpec | None = Field(None, description="a volume mesh of your own, in place of surface and medium")
    channels: Annotated[list[ChannelName], Field(min_length=1)] | None = Field(
        None, description="names of the channels, as many as the lists in the case have values"
    )
    regions: list[RegionSpec] = Field([])
    lights: Annotated[list[LightSpec], Field(min_length=1)]
    modulation: ModulationSpec | None = Field(
        None, description="lights are modulated at a frequency: results are amplitudes and phases"
    )
    pulse: PulseSpec | None = Field(None, description="light in time after a short pulse of all lights")
    fluorescence: FluorescenceSpec | None = Field(
        None, description="dyes that emit at another wavelength, which is a channel of its own"
    )
    fit: FitSpec | None = Field(
        None,
        description="coefficients are fitted to what the detectors have read, beginning with the media of the case; "
        "the case is then solved with what was found",
    )
    model: Model = Field(
        "full",
        description="full: finite elements on a mesh; truncated: the same where light reaches; charges: fitted to the "
        "boundary, without a mesh; closed-form: the exact series of a sphere or slab; auto: the fastest of these that "
        "gives what is asked for",
    )
    tolerance: Tolerance = Field(
        DEFAULT_TOLERANCE,
        description="wanted relative L2 error of the exitance, or exitance, detectors, everywhere, volume",
    )
    detectors: list[DetectorSpec] = Field([])
    camera: CameraSpec | None = Field(None, description="where the picture is taken from; default: chosen by the light")
    up: Direction = Field((0.0, 0.0, 1.0), description="the direction that is up in the picture")
    picture: Pictures | None = Field(None, description="what the picture shows, or a list for several pictures")
    outputs: list[Output] = Field(
        ["surface", "volume", "picture"],
        description="default: surface, volume, picture; with another model than full without volume",
    )
    compare: Annotated[list[ClosedForm], Field(min_length=1)] | None = Field(
        None,
        description="closed forms to compare with: robin, images, dipole for slabs; series for spheres and cylinders",
    )
    sweep: SweepSpec | None = Field(
        None, description="values by dotted key; one run for each, several keys make a grid"
    )
    base: str | None = Field(
        None, description="another case file, relative to this one; its keys hold where this one has none"
    )

    @property
    def tolerances(self) -> ToleranceSpec:
        """Those of each quantity."""
        if isinstance(self.tolerance, ToleranceSpec):
            return self.tolerance
        return ToleranceSpec(exitance=self.tolerance, detectors=None, everywhere=None, volume=None)

    @property
    def pictures(self) -> list[PictureSpec]:
        """All pictures."""
        if self.picture is None:
            return [PictureSpec.model_validate({})]
        return self.picture if isinstance(self.picture, list) else [self.picture]

    @model_validator(mode="after")
    def _some_tolerance(self) -> "CaseSpec":
        given = {name: value for name, value in self.tolerances if value is not None}
        if not given or (self.model == "closed-form" and "exitance" not in given):
            needed = {"closed-form": "of the exitance", "charges": "of exitance or detectors"}.get(
                self.model, "of exitance, detectors, everywhere or volume"
            )
            raise PydanticCustomError(
                "tolerance", "give a tolerance {needed}, or leave tolerance out", {"needed": needed}
            )
        if "detectors" in given and not self.detectors:
            raise PydanticCustomError("tolerance", "there is a tolerance for detectors, and no detector; give some")
        for name in given:
            if name not in TOLERANCES_WITHOUT_MESH.get(self.model, given):
                raise PydanticCustomError(
                    "tolerance",
                    'tolerance.{name} is for finite elements, not for model "{model}"; leave it out',
                    {"name": name, "model": self.model},
                )
        return self

    @model_validator(mode="before")
    @classmethod
    def _outputs_of_model(cls, data: Any) -> Any:
        if isinstance(data, dict) and data.get("model") in (*WITHOUT_MESH, "auto") and "outputs" not in data:
            return {**data, "outputs": ["surface", "picture"]}
        return data

    @model_validator(mode="after")
    def _without_mesh(self) -> "CaseSpec":
        if self.model in WITHOUT_MESH:
            for key, what, given in (
                ("mesh", "a mesh", self.mesh),
                ("outputs", "volume", "volume" in self.outputs),
                ("compare", "compare", self.compare),
                ("modulation", "modulation", self.modulation and self.model != "charges"),
            ):
                if given:
                    raise PydanticCustomError(
                        "no_mesh",
                        '{what} needs finite elements, which model "{model}" does not use; leave it out, or '
                        "write model: full",
                        {"key": key, "what": what, "model": self.model},
                    )
        if self.fluorescence and self.model != "full":
            raise PydanticCustomError(
                "no_mesh", "dyes are solved for by model full; leave fluorescence or model out", {"key": "fluorescence"}
            )
        return self

    @model_validator(mode="after")
    def _beside_pulse(self) -> "CaseSpec":
        if self.pulse is not None:
            wanted = self.tolerances
            fields = {"tolerance.everywhere": wanted.everywhere, "tolerance.volume": wanted.volume}
            refuse_beside_pulse(
                self.model, {"modulation": self.modulation, "fluorescence": self.fluorescence, **fields}
            )
        elif "film" in self.outputs:
            raise PydanticCustomError(
                "pulse", "a film shows a pulse; add pulse, or leave film out of outputs", {"key": "outputs"}
            )
        return self

    @model_validator(mode="after")
    def _with_sensitivities(self) -> "CaseSpec":
        if "sensitivity" in self.outputs:
            refuse_without_readings(
                self.model, {"pulse": self.pulse, "fluorescence": self.fluorescence}, self.detectors
            )
        return self

    @model_validator(mode="after")
    def _beside_fit(self) -> "CaseSpec":
        if self.fit is not None:
            sections = ("mesh", "pulse", "fluorescence", "compare")
            refuse_beside_fit(self.model, {name: getattr(self, name) for name in sections}, self.detectors)
        return self

    @model_validator(mode="after")
    def _one_body(self) -> "CaseSpec":
        if self.mesh is None:
            for name in ("surface", "medium"):
                if getattr(self, name) is None:
                    raise PydanticCustomError(
                        "body", "{name} is missing; a case needs surface and medium, or mesh", {"name": name}
                    )
            return self
        beside = [name for name in ("surface", "medium", "regions", "compare") if getattr(self, name)]
        if beside:
            raise PydanticCustomError(
                "body",
                "mesh replaces surface, medium, regions and compare; leave {beside} out",
                {"beside": " and ".join(beside)},
            )
        return self
