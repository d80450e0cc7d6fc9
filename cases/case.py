"""`Case`: one run, ready to be solved; and how a case file becomes a list of them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tetlux.cases.channels import ALL, channel_names, check_different
from tetlux.cases.compare.comparison import Comparison, comparison_for
from tetlux.cases.document import Document, Key, read_document
from tetlux.cases.lighting import BODY, keys_of, light_names, light_of
from tetlux.cases.media import media_of
from tetlux.cases.reading import Reader
from tetlux.cases.schema import CaseSpec
from tetlux.cases.sensors import Sensor, sensor_of
from tetlux.cases.sweep import LONGEST_NAME, swept
from tetlux.cases.validation import validated
from tetlux.fem.coefficients import AnyMedium, base_of
from tetlux.fem.lights import Deposit, Light
from tetlux.fem.medium import Medium
from tetlux.fem.region import Region
from tetlux.fem.validity import check_media, check_size
from tetlux.meshing.arrays import Vector
from tetlux.meshing.errors import InputError
from tetlux.meshing.mesher import check_thickness
from tetlux.meshing.notes import Note, in_region
from tetlux.meshing.paths import exists
from tetlux.meshing.read import SUFFIXES
from tetlux.meshing.regions import check_regions
from tetlux.meshing.surface import Surface


@dataclass(frozen=True, eq=False)
class Channel:
    """One wavelength or colour of a case.

    Attributes
    ----------
    name : str
    medium : Medium or VaryingMedium
        Of the body.
    lights : mapping of str to Light
        Those that are not dark in it, by name.
    """

    name: str
    medium: AnyMedium
    lights: Mapping[str, Light]


@dataclass(frozen=True, eq=False)
class Case:
    """One scene of a case file, with its surface read and its lights known to meet it.

    Attributes
    ----------
    name : str
        Its folder of results, relative to the output folder; a sweep's runs have a folder of their own
        within the case's.
    source : Path
    surface : Surface
    channels : tuple of Channel
    light_names : tuple of str
        Of all lights, in their order.
    regions : tuple of Region
        Each with one medium for each channel; its surface bears its name.
    tolerance : float
    outputs : tuple of str
    sensors : tuple of Sensor
        The detectors, by name.
    camera : (3,) floats, optional
        From where the surface is seen, unit.
    reading_seconds : float
        Spent on reading and checking the surface.
    comparison : Comparison, optional
        Closed forms to compare the run with.
    from_sweep : bool
        Whether it is one of the runs of a sweep.
    """

    name: str
    source: Path
    surface: Surface
    channels: tuple[Channel, ...]
    light_names: tuple[str, ...]
    regions: tuple[Region, ...]
    tolerance: float
    outputs: tuple[str, ...]
    sensors: tuple[Sensor, ...] = ()
    camera: Vector | None = None
    reading_seconds: float = 0.0
    comparison: Comparison | None = None
    from_sweep: bool = False

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(channel.name for channel in self.channels)

    @property
    def repairs(self) -> tuple[str, ...]:
        """What was mended when its surfaces were read."""
        return self._of_surfaces("repairs")

    @property
    def region_warnings(self) -> tuple[str, ...]:
        """What a user should know of the surfaces of regions; that of the body is among a solution's warnings."""
        return self._of_surfaces("warnings")[len(self.surface.warnings) :]

    def named(self, warning: str) -> str:
        """A warning with the name of the region that it numbers."""
        if not isinstance(warning, Note) or warning.region is None:
            return warning
        names = {f"region {i}": region.surface.name for i, region in enumerate(self.regions, 1)}
        return warning.in_region(names.get(warning.region, warning.region))

    def _of_surfaces(self, name: str) -> tuple[str, ...]:
        inner = [
            in_region(note, region.surface.name) for region in self.regions for note in getattr(region.surface, name)
        ]
        return (*getattr(self.surface, name), *inner)

    @property
    def is_simple(self) -> bool:
        """Whether it is of one channel and one medium, the same everywhere."""
        return len(self.channels) == 1 and not self.regions and isinstance(self.channels[0].medium, Medium)

    @property
    def medium(self) -> Medium:
        """The medium of a simple case; else what stands for the body's in the first channel."""
        return base_of(self.channels[0].medium)

    @property
    def lights(self) -> tuple[Light, ...]:
        """The lights of the first channel."""
        return tuple(self.channels[0].lights.values())


def library_folder() -> Path:
    """The folder of the case files that ship with the package."""
    return Path(__file__).with_name("library")


def find_case_file(request: str) -> Path:
    """A path as given, or the shipped case file of that name where there is no such path."""
    path = Path(request)
    shipped = library_folder() / f"{request}.yaml"
    known = exists(path)
    if not known and path.name == request and shipped.is_file():
        return shipped
    if not known and path.name == request and not path.suffix:
        names = ", ".join(sorted(p.stem for p in library_folder().glob("*.yaml")))
        raise InputError(f"{request} is neither a file nor one of the cases that ship: {names}.")
    if path.suffix.lower() in SUFFIXES:
        raise InputError(f"{path} is a surface file; name it in a case file, as surface: {{file: {path.name}}}.")
    return path


def load_cases(path: Path) -> list[Case]:
    """Read a case file: one case, or as many as its sweep makes.

    Everything that can be known before meshing is checked: keys and values, the surface, that lights meet
    the body, and its size in mean free paths.

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    document = read_document(path)
    spec = validated(document, document.data)
    reader = Reader(path.parent)
    cases = []
    for label, data, keys in swept(document, spec):
        single = document if label is None else Document(path, data, {**document.lines, **keys})
        one = spec if label is None else validated(single, data)
        name = one.name or path.stem
        if name in (".", "..") or not name.isprintable() or len(name.encode(errors="replace")) > LONGEST_NAME:
            raise single.error(("name",), "this makes no name of a folder, or too long a one; give a short name.")
        case = _case(single, one, name if label is None else f"{name}/{label}", reader)
        cases.append(replace(case, from_sweep=label is not None))
    return cases


def _case(document: Document, spec: CaseSpec, name: str, reader: Reader) -> Case:
    reader.seconds = 0.0
    with document.at(("surface",)):
        surface = reader.surface(spec.surface, spec.unit)
        check_thickness(surface)
    channels = channel_names(document, spec)
    media = media_of(document, ("medium",), spec.medium, surface, len(channels), reader)
    with document.at(("surface",)):
        for medium in media:
            check_size(surface, base_of(medium))
    region_names, regions = _regions(document, spec, surface, media, reader)
    names = light_names(spec)
    check_different(document, "lights", names)
    _check_value_names(document, channels, names)
    lights, deposits = _lights(document, spec, names, surface, media, region_names, channels, reader)
    with document.at(("compare",)):
        comparison = None
        if spec.compare:
            if len(media) > 1 or regions or not isinstance(media[0], Medium):
                raise InputError("closed forms are those of one channel and one even medium; leave compare out.")
            comparison = comparison_for(surface.shape, media[0], deposits, spec.compare)
    check_different(document, "detectors", [detector.name for detector in spec.detectors])
    sensors = []
    for i, detector in enumerate(spec.detectors):
        with document.at(("detectors", i)):
            sensors.append(sensor_of(detector, surface, base_of(media[0])))
    if spec.camera and surface.contains(np.array([spec.camera.position]))[0]:
        with document.at(("camera", "position")):
            raise InputError("the camera is inside the body, where no light of its surface goes; move it outside.")
    return Case(
        name=name,
        source=document.path,
        surface=surface,
        channels=tuple(map(Channel, channels, media, lights)),
        light_names=names,
        regions=regions,
        tolerance=spec.tolerance,
        outputs=tuple(dict.fromkeys(spec.outputs)),
        sensors=tuple(sensors),
        camera=spec.camera.position if spec.camera else None,
        reading_seconds=reader.seconds,
        comparison=comparison,
    )


def _regions(
    document: Document, spec: CaseSpec, surface: Surface, media: tuple[AnyMedium, ...], reader: Reader
) -> tuple[tuple[str, ...], tuple[Region, ...]]:
    """Names of the regions, and the regions."""
    names = tuple(region.name or f"region_{i}" for i, region in enumerate(spec.regions, 1))
    check_different(document, "regions", names)
    if BODY in names:
        raise document.error(("regions", names.index(BODY)), f'"{BODY}" is what is outside all regions; rename it.')
    regions = []
    for i, region in enumerate(spec.regions):
        key: Key = ("regions", i)
        with document.at((*key, "surface")):
            inner = replace(reader.surface(region.surface, spec.unit), name=names[i])
        own = media_of(document, (*key, "medium"), region.medium, inner, len(media), reader)
        with document.at((*key, "medium")):
            for outside, inside in zip(media, own, strict=True):
                check_media(surface, [base_of(outside), base_of(inside)])
        regions.append(Region(inner, own))
    with document.at(("regions",)):
        check_regions(surface, [region.surface for region in regions])
    return names, tuple(regions)


def _lights(
    document: Document,
    spec: CaseSpec,
    names: tuple[str, ...],
    surface: Surface,
    media: tuple[AnyMedium, ...],
    regions: tuple[str, ...],
    channels: tuple[str, ...],
    reader: Reader,
) -> tuple[list[dict[str, Light]], list[Deposit]]:
    """The lights of each channel by name, and what those of the first leave in the body."""
    lights: list[dict[str, Light]] = [{} for _ in media]
    deposits = []
    for i, light_spec in enumerate(spec.lights):
        with document.at(("lights", i), keys_of(light_spec)):
            for channel, medium in enumerate(media):
                light = light_of(light_spec, channel, len(media), regions, reader)
                if light is None:
                    continue
                lights[channel][names[i]] = light
                uniform = not regions and isinstance(medium, Medium)
                deposit = light.deposit_in(surface, base_of(medium), uniform=uniform)
                if channel == 0:
                    deposits.append(deposit)
    if not all(lights):
        dark = channels[[bool(those) for those in lights].index(False)]
        raise document.error(
            ("lights",), f"all lights are dark in channel {dark}; give one of them some power there, or leave it out."
        )
    return lights, deposits


def _check_value_names(document: Document, channels: tuple[str, ...], lights: tuple[str, ...]) -> None:
    """Refuse names by which two sets of values in a file would be called the same.

    Raises
    ------
    InputError
    """
    if ALL in lights:
        raise document.error(("lights", lights.index(ALL)), f'"{ALL}" is the sum of all lights; give another name.')
    names = [*channels, *lights, *(f"{light}_{channel}" for light in lights for channel in channels)]
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    if twice:
        raise document.error(
            ("lights",), f'names of lights and channels make "{twice[0]}" twice; give one of them another name.'
        )
