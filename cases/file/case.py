"""`Case`: one run, ready to be solved; and how a case file becomes a list of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tetlux.cases.compare.comparison import Comparison, comparison_for
from tetlux.cases.file.body import CaseBody, body_of
from tetlux.cases.file.channels import ALL, channel_names, check_different
from tetlux.cases.file.document import Document, Key, read_document
from tetlux.cases.file.in_channel import InChannel
from tetlux.cases.file.lighting import keys_of, light_names
from tetlux.cases.file.reading import Reader
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.sensors import Sensor, sensor_of
from tetlux.cases.file.sweep import LONGEST_NAME, swept
from tetlux.cases.file.validation import validated
from tetlux.cases.picture.view import UPRIGHT, toward_camera
from tetlux.fem.meshless.solve import check_deposit, check_simple, even_medium
from tetlux.fem.inputs import unit_vector
from tetlux.fem.lights import Deposit, Light
from tetlux.fem.media.coefficients import AnyMedium, MediaByLabel, base_of
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.region import Region
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.describe import one_line
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note, in_region
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Channel:
    """One wavelength or colour of a case.

    Attributes
    ----------
    name : str
    medium : Medium or VaryingMedium
        Of the body, or of the outermost label of a mesh.
    lights : mapping of str to Light
        Those that are not dark in it, by name.
    media : Medium, VaryingMedium, or mapping of int to these
        The medium, or that of each label of a mesh.
    """

    name: str
    medium: AnyMedium
    lights: Mapping[str, Light]
    media: AnyMedium | MediaByLabel

    __repr__ = one_line


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
        Where radiance is wanted, unit; the picture is taken from there.
    up : (3,) floats
        What is up in the picture.
    toward : (3,) ndarray, optional
        Unit vector to the eye of the picture; chosen by the light if not given.
    reading_seconds : float
        Spent on reading and checking the surface.
    mesh : TetMesh, optional
        Tetrahedra that are used as they are; `surface` is then their boundary.
    comparison : Comparison, optional
        Closed forms to compare the run with.
    spec : CaseSpec
        What the case file says of this run.
    swept : mapping of str to float or str
        The values of this run of a sweep, by their dotted keys; empty if there is none.
    """

    name: str
    source: Path
    surface: Surface
    channels: tuple[Channel, ...]
    light_names: tuple[str, ...]
    regions: tuple[Region, ...]
    tolerance: float
    outputs: tuple[str, ...]
    spec: CaseSpec
    swept: Mapping[str, float | str]
    sensors: tuple[Sensor, ...] = ()
    camera: Vector | None = None
    up: Vector = UPRIGHT
    toward: FloatArray | None = None
    reading_seconds: float = 0.0
    comparison: Comparison | None = None
    mesh: TetMesh | None = None

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(channel.name for channel in self.channels)

    @property
    def repairs(self) -> tuple[str, ...]:
        """What was mended when its surfaces, or its mesh, were read."""
        return self.mesh.repairs if self.mesh else self._of_surfaces("repairs")

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
        channel = self.channels[0]
        return len(self.channels) == 1 and not self.regions and self.mesh is None and isinstance(channel.medium, Medium)

    @property
    def medium(self) -> Medium:
        """The medium of a simple case; else what stands for the body's in the first channel."""
        return base_of(self.channels[0].medium)

    @property
    def lights(self) -> tuple[Light, ...]:
        """The lights of the first channel."""
        return tuple(self.channels[0].lights.values())

    __repr__ = one_line


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
    for label, values, data, keys in swept(document, spec):
        single = document if label is None else Document(path, data, {**document.lines, **keys}, label)
        one = spec if label is None else validated(single, data)
        name = one.name or path.stem
        if name in (".", "..") or not name.isprintable() or len(name.encode(errors="replace")) > LONGEST_NAME:
            raise single.error(("name",), "this makes no name of a folder, or too long a one; give a short name.")
        cases.append(_case(single, one, name if label is None else f"{name}/{label}", reader, values))
    return cases


def _case(document: Document, spec: CaseSpec, name: str, reader: Reader, values: Mapping[str, float | str]) -> Case:
    reader.seconds = 0.0
    channels = channel_names(document, spec)
    body = body_of(document, spec, len(channels), reader)
    surface, media = body.surface, body.media
    if spec.model == "charges":
        _check_for_charges(document, body)
    names = light_names(spec)
    check_different(document, "lights", names)
    _check_value_names(document, channels, names)
    lights, deposits = _lights(document, spec, names, body, channels, reader)
    with document.at(("compare",)):
        comparison = None
        if spec.compare:
            if len(media) > 1 or body.regions or not isinstance(media[0], Medium):
                raise InputError("closed forms are those of one channel and one even medium; leave compare out.")
            comparison = comparison_for(surface.shape, media[0], deposits, spec.compare)
    check_different(document, "detectors", [detector.name for detector in spec.detectors])
    sensors = []
    for i, detector in enumerate(spec.detectors):
        with document.at(("detectors", i)):
            sensors.append(sensor_of(detector, surface, body.of_channels[0].outer))
    with document.at(("up",)):
        unit_vector(spec.up, "up")
    with document.at(("camera", "position")):
        toward = toward_camera(spec.camera, surface, spec.up) if spec.camera else None
    return Case(
        name=name,
        source=document.path,
        surface=surface,
        channels=tuple(map(Channel, channels, media, lights, body.by_label or media)),
        light_names=names,
        regions=body.regions,
        mesh=body.mesh,
        tolerance=spec.tolerance,
        outputs=tuple(dict.fromkeys(spec.outputs)),
        spec=spec,
        swept=values,
        sensors=tuple(sensors),
        camera=spec.camera.position if spec.camera else None,
        up=spec.up,
        toward=toward,
        reading_seconds=reader.seconds,
        comparison=comparison,
    )


def _lights(
    document: Document,
    spec: CaseSpec,
    names: tuple[str, ...],
    body: CaseBody,
    channels: tuple[str, ...],
    reader: Reader,
) -> tuple[list[dict[str, Light]], list[Deposit]]:
    """The lights of each channel by name, and what those of the first leave in the body."""
    bodies = body.of_channels
    lights: list[dict[str, Light]] = [{} for _ in bodies]
    deposits = []
    for i, light_spec in enumerate(spec.lights):
        with document.at(("lights", i), keys_of(light_spec)):
            for channel, of_channel in enumerate(bodies):
                light = light_spec.light(InChannel(channel, len(bodies), body.parts, reader.pixels))
                if light is None:
                    continue
                lights[channel][names[i]] = light
                deposit = light.deposit_in(of_channel)
                if spec.model == "charges":
                    check_deposit(light, deposit, of_channel, [region.surface for region in body.regions])
                if channel == 0:
                    deposits.append(deposit)
    if not all(lights):
        dark = channels[[bool(those) for those in lights].index(False)]
        raise document.error(
            ("lights",), f"all lights are dark in channel {dark}; give one of them some power there, or leave it out."
        )
    return lights, deposits


def _check_for_charges(document: Document, body: CaseBody) -> None:
    """Refuse a body that charges cannot be fitted to.

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    parts: list[tuple[Key, Surface]] = [((), body.surface)]
    parts += [(("regions", i), region.surface) for i, region in enumerate(body.regions)]
    for number, (key, surface) in enumerate(parts):
        with document.at((*key, "surface")):
            check_simple(surface)
        with document.at((*key, "medium")):
            for of_channel in body.of_channels:
                even_medium(of_channel.by_label[number])


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
