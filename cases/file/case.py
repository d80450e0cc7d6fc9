"""`Case`: one run of a case file, ready to be solved."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tetlux.cases.file.detectors import NamedDetector
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.picture.view import UPRIGHT
from tetlux.fem.assessment import Tolerances
from tetlux.fem.inverse.request import FitRequest
from tetlux.fem.lights import Light
from tetlux.fem.media.coefficients import AnyMedium, MediaByLabel, base_of
from tetlux.fem.media.fluorophore import Fluorophore
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region
from tetlux.fem.outcome.plan import Plan
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.describe import one_line
from tetlux.meshing.notes import Note, in_region
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

if TYPE_CHECKING:
    from tetlux.cases.compare.comparison import Comparison


@dataclass(frozen=True, eq=False)
class Channel:
    """One wavelength or colour of a case.

    Attributes
    ----------
    name : str
    medium : Medium or VaryingMedium
        The medium of the body, or of the outermost label of a mesh.
    lights : mapping of str to Light
        The lights that are not dark in this channel, by name.
    media : Medium, VaryingMedium, or mapping of int to these
        The medium of the body, or the media of a mesh by label.
    frequency : float
        At which its lights are modulated, Hz; 0 for steady light.
    """

    name: str
    medium: AnyMedium
    lights: Mapping[str, Light]
    media: AnyMedium | MediaByLabel
    frequency: float = 0.0

    __repr__ = one_line


@dataclass(frozen=True, eq=False)
class Case:
    """One run of a case file, with its surface loaded and its lights checked to meet the body.

    Attributes
    ----------
    name : str
        Its folder of results, relative to the output folder; each run of a sweep has a folder of its own within
        that of the case.
    source : Path
        The case file.
    surface : Surface
    channels : tuple of Channel
    light_names : tuple of str
        The names of all lights, in the order of the case file.
    regions : tuple of Region
        Each with a medium for each channel; the name of its surface is that of the region.
    tolerance : float, optional
        Of the exitance.
    outputs : tuple of str
    detectors : tuple of NamedDetector
    detector_tolerance : float, optional
        Of what the detectors read.
    everywhere_tolerance, volume_tolerance : float, optional
        Of the exitance at almost every point of the surface, and of the fluence inside.
    camera : (3,) floats, optional
        Where the picture is taken from and radiance is computed, unit.
    up : (3,) floats
        The direction that is up in the picture.
    toward : (3,) ndarray, optional
        Unit vector from the body to the eye of the picture; if not given, it is chosen by the light.
    start_seconds : float
        From the start of the command until its first case file was read; 0 for other cases.
    reading_seconds : float
        Time spent on reading and checking the case and its files.
    mesh : TetMesh, optional
        A mesh that is used as it is; `surface` is then its boundary.
    comparison : Comparison, optional
        Closed forms to compare the run with.
    spec : CaseSpec
        The validated case file of this run.
    sweep_values : mapping
        The values of this run of a sweep, plain data by dotted key; empty without a sweep.
    plan : Plan, optional
        Which model solves it, where the case file leaves that to the program.
    fluorophores : tuple of Fluorophore
        If there are any, the second half of the channels are what they emit, lit by the first half; and regions have
        media for all of these.
    fit : FitRequest, optional
        What is fitted before it is solved, beginning with its media.
    """

    name: str
    source: Path
    surface: Surface
    channels: tuple[Channel, ...]
    light_names: tuple[str, ...]
    regions: tuple[Region, ...]
    tolerance: float | None
    outputs: tuple[str, ...]
    spec: CaseSpec
    sweep_values: Mapping[str, Any]
    detectors: tuple[NamedDetector, ...] = ()
    detector_tolerance: float | None = None
    everywhere_tolerance: float | None = None
    volume_tolerance: float | None = None
    camera: Vector | None = None
    up: Vector = UPRIGHT
    toward: FloatArray | None = None
    start_seconds: float = 0.0
    reading_seconds: float = 0.0
    comparison: "Comparison | None" = None
    mesh: TetMesh | None = None
    plan: Plan | None = None
    fluorophores: tuple[Fluorophore, ...] = ()
    fit: FitRequest | None = None

    @property
    def tolerances(self) -> Tolerances:
        """All tolerances, as what a mesh is refined for."""
        return Tolerances(
            self.tolerance,
            self.detector_tolerance,
            everywhere=self.everywhere_tolerance,
            volume=self.volume_tolerance,
        )

    @property
    def excitations(self) -> tuple[Channel, ...]:
        """The channels that are lit, of a case with dyes the first half."""
        return self.channels[: len(self.channels) // 2] if self.fluorophores else self.channels

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(channel.name for channel in self.channels)

    @property
    def frequencies(self) -> tuple[float, ...]:
        """The frequency of each channel, Hz."""
        return tuple(channel.frequency for channel in self.channels)

    @property
    def outside_index(self) -> float:
        """Refractive index of what surrounds the body."""
        given = self.spec.modulation or self.spec.pulse
        return given.outside_index if given else 1.0

    @property
    def times(self) -> list[float]:
        """Times after a pulse, s; none of other light."""
        return self.spec.pulse.all_times if self.spec.pulse else []

    @property
    def repairs(self) -> tuple[str, ...]:
        """The repairs made when the surfaces, or the mesh, were read."""
        return self.mesh.repairs if self.mesh else self._notes_of_surfaces("repairs")

    @property
    def region_warnings(self) -> tuple[str, ...]:
        """Warnings about the surfaces of regions; a solution's warnings hold those about the surface of the body."""
        return self._notes_of_surfaces("warnings")[len(self.surface.warnings) :]

    def name_region(self, warning: str) -> str:
        """Replace the number of a region in a warning by the name of the region."""
        if not isinstance(warning, Note) or warning.region is None:
            return warning
        names = {f"region {i}": region.surface.name for i, region in enumerate(self.regions, 1)}
        return warning.in_region(names.get(warning.region, warning.region))

    def _notes_of_surfaces(self, name: str) -> tuple[str, ...]:
        inner = [
            in_region(note, region.surface.name) for region in self.regions for note in getattr(region.surface, name)
        ]
        return (*getattr(self.surface, name), *inner)

    @property
    def has_single_medium(self) -> bool:
        """Whether it has a single channel and one uniform medium."""
        channel = self.channels[0]
        return len(self.channels) == 1 and not self.regions and self.mesh is None and isinstance(channel.medium, Medium)

    @property
    def medium(self) -> Medium:
        """The medium of the body in the first channel; of one that varies, its base."""
        return base_of(self.channels[0].medium)

    @property
    def lights(self) -> tuple[Light, ...]:
        """The lights of the first channel."""
        return tuple(self.channels[0].lights.values())

    __repr__ = one_line
