"""`load_cases`: from a case file to its runs, with all that can be checked before meshing."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tetlux.cases.file.body import CaseBody, join_regions, read_body, read_emission
from tetlux.cases.file.case import Case, Channel
from tetlux.cases.file.channel_context import ChannelContext
from tetlux.cases.file.channels import ALL, channel_names, check_unique_names, names_with_emission, value_in_channel
from tetlux.cases.file.detectors import NamedDetector, build_detector
from tetlux.cases.file.documents.base import read_with_base
from tetlux.cases.file.documents.document import Document, Key
from tetlux.cases.file.fit import read_fit
from tetlux.cases.file.light_names import field_keys, light_names
from tetlux.cases.file.measured.table import Names
from tetlux.cases.file.reader import FilesRead, Reader
from tetlux.cases.file.schema.case import CaseSpec, ModulationSpec
from tetlux.cases.file.schema.pulse import PulseSpec
from tetlux.cases.file.sweeps.expand import expand_sweep
from tetlux.cases.file.sweeps.names import LONGEST_NAME
from tetlux.cases.file.validation import validate
from tetlux.cases.picture.requests import check_pictures
from tetlux.cases.picture.view import toward_camera
from tetlux.cases.start import take_start_seconds
from tetlux.fem.inputs import unit_vector
from tetlux.fem.lights import Deposit, Light
from tetlux.fem.media.medium import Medium
from tetlux.fem.meshless.closed_form import homogeneous
from tetlux.fem.meshless.exact_field import exact_field
from tetlux.fem.meshless.solve import check_deposit, check_simple, homogeneous_medium
from tetlux.fem.models.modulation import shifts_of_scenes
from tetlux.fem.transient.times import check_times
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.surface.surface import Surface

if TYPE_CHECKING:
    from tetlux.cases.compare.comparison import Comparison


def load_cases(
    path: Path, files: FilesRead | None = None, expect: Callable[[int], None] = lambda _: None
) -> list[Case]:
    """Read a case file and check all that can be checked before meshing.

    That is keys and values, surfaces, the size of the body in mean free paths, and that lights meet the body.

    Parameters
    ----------
    path : Path
    files : FilesRead, optional
        What other case files have read already; what this one reads is added to it.
    expect : callable
        Called with the number of runs, before they are checked.

    Returns
    -------
    list of Case
        One, or one for each run of the sweep.

    Raises
    ------
    InputError
        With the file, the line and the key.

    Examples
    --------
    >>> from tetlux.cases.shipped import find_case_file
    >>> (case,) = load_cases(find_case_file("sphere"))
    >>> case.name, case.channel_names, case.surface.unit
    ('sphere', ('all',), 'mm')
    """
    start_seconds, started = take_start_seconds(), time.perf_counter()
    document = read_with_base(path)
    spec = validate(document, document.data)
    reader = Reader(path.parent, files or FilesRead())
    runs = expand_sweep(document, spec)
    expect(len(runs))
    cases = []
    for run in runs:
        of_run = document if run.label is None else Document(path, run.data, run.places, run.label)
        spec_of_run = spec if run.label is None else validate(of_run, run.data)
        name = spec_of_run.name or path.stem
        if name in (".", "..") or not name.isprintable() or len(name.encode(errors="replace")) > LONGEST_NAME:
            raise of_run.error(("name",), "this cannot be the name of a folder; give a short, printable name.")
        folder = name if run.label is None else f"{name}/{run.label}"
        case = _build_case(of_run, spec_of_run, folder, reader, run.values)
        # What several runs share is read for the first.
        now = time.perf_counter()
        cases.append(replace(case, start_seconds=start_seconds, reading_seconds=now - started))
        start_seconds, started = 0.0, now
    return cases


def _build_case(document: Document, spec: CaseSpec, name: str, reader: Reader, values: Mapping[str, Any]) -> Case:
    channels = channel_names(document, spec)
    body = read_body(document, spec, len(channels), reader)
    if spec.model == "charges":
        _check_for_charges(document, body)
    names = light_names(spec)
    check_unique_names(document, "lights", names)
    emitting, dyes = read_emission(document, spec.fluorescence, body, reader)
    all_names = channels if emitting is None else names_with_emission(channels)
    _check_value_names(document, all_names, names)
    check_pictures(document, spec, body.surface, all_names, names)
    frequencies = _build_frequencies(document, spec, body)
    _check_times(document, spec, body)
    lights, deposits = _build_lights(document, spec, names, body, channels, reader)
    of_fit = Names(channels, names, tuple(detector.name for detector in spec.detectors))
    if spec.model == "closed-form":
        _check_for_closed_form(document, body, deposits)
    return Case(
        name=name,
        source=document.path,
        surface=body.surface,
        channels=_channels_of(all_names, [body] if emitting is None else [body, emitting], lights, frequencies),
        fluorophores=dyes,
        light_names=names,
        regions=body.regions if emitting is None else join_regions(body, emitting),
        mesh=body.mesh,
        tolerance=spec.tolerances.exitance,
        detector_tolerance=spec.tolerances.detectors,
        everywhere_tolerance=spec.tolerances.everywhere,
        volume_tolerance=spec.tolerances.volume,
        outputs=tuple(dict.fromkeys(spec.outputs)),
        spec=spec,
        sweep_values=values,
        detectors=_build_detectors(document, spec, body),
        camera=spec.camera.position if spec.camera else None,
        up=spec.up,
        toward=_direction_to_camera(document, spec, body.surface),
        comparison=_build_comparison(document, spec, body, deposits),
        fit=read_fit(document, spec, body, of_fit, lights, frequencies, reader),
    )


def _channels_of(
    names: Sequence[str],
    bodies: Sequence[CaseBody],
    lights: Sequence[Mapping[str, Light]],
    frequencies: Sequence[float],
) -> tuple[Channel, ...]:
    """The channels, those of each body after one another."""
    media = [medium for body in bodies for medium in body.media]
    in_parts = [medium for body in bodies for medium in body.by_label or body.media]
    return tuple(map(Channel, names, media, [*lights] * len(bodies), in_parts, [*frequencies] * len(bodies)))


def _build_frequencies(document: Document, spec: CaseSpec, body: CaseBody) -> list[float]:
    """The frequency of each channel, Hz."""
    modulation = spec.modulation
    if modulation is None:
        return [0.0] * len(body.media)
    frequencies = [value_in_channel(modulation.frequency, channel) for channel in range(len(body.media))]
    with document.at(("modulation",), {name: (name,) for name in ModulationSpec.model_fields}):
        outer = [each.outer for each in body.bodies]
        shifts_of_scenes(frequencies, outer, body.surface.unit, modulation.outside_index)
    return frequencies


def _check_times(document: Document, spec: CaseSpec, body: CaseBody) -> None:
    """Refuse times of a pulse that are none, or too early for diffusion."""
    if spec.pulse is not None:
        with document.at(("pulse",), {name: (name,) for name in PulseSpec.model_fields}):
            for each in body.bodies:
                check_times(spec.pulse.all_times, each.outer, body.surface.unit, spec.pulse.outside_index)


def _build_comparison(
    document: Document, spec: CaseSpec, body: CaseBody, deposits: list[Deposit]
) -> "Comparison | None":
    if not spec.compare:
        return None
    # Closed forms take a tenth of a second to import.
    from tetlux.cases.compare.comparison import comparison_for  # noqa: PLC0415

    with document.at(("compare",)):
        if spec.modulation or spec.fluorescence:
            beside = "modulation" if spec.modulation else "fluorescence"
            raise InputError(f"closed forms here are those of steady light alone; leave compare or {beside} out.")
        if len(body.media) > 1 or body.regions or not isinstance(body.media[0], Medium):
            raise InputError("closed forms exist for one channel and one uniform medium only; leave compare out.")
        return comparison_for(body.surface.shape, body.media[0], deposits, spec.compare)


def _build_detectors(document: Document, spec: CaseSpec, body: CaseBody) -> tuple[NamedDetector, ...]:
    check_unique_names(document, "detectors", [detector.name for detector in spec.detectors])
    detectors = []
    for i, detector in enumerate(spec.detectors):
        with document.at(("detectors", i)):
            detectors.append(build_detector(detector, body.surface, body.bodies[0].outer))
    return tuple(detectors)


def _direction_to_camera(document: Document, spec: CaseSpec, surface: Surface) -> FloatArray | None:
    """Unit vector from the body to the eye; None if the light chooses it."""
    with document.at(("up",)):
        unit_vector(spec.up, "up")
    with document.at(("camera", "position")):
        return toward_camera(spec.camera, surface, spec.up) if spec.camera else None


def _build_lights(
    document: Document,
    spec: CaseSpec,
    names: tuple[str, ...],
    body: CaseBody,
    channels: tuple[str, ...],
    reader: Reader,
) -> tuple[list[dict[str, Light]], list[Deposit]]:
    """Build the lights of each channel, by name, and, where they are needed, deposits of the first channel."""
    bodies = body.bodies
    lights: list[dict[str, Light]] = [{} for _ in bodies]
    deposits = []
    for i, light_spec in enumerate(spec.lights):
        with document.at(("lights", i), field_keys(light_spec)):
            for channel, body_in_channel in enumerate(bodies):
                light = light_spec.light(ChannelContext(channel, len(bodies), body.parts, reader.pixels))
                if light is None:
                    continue
                lights[channel][names[i]] = light
                # Whether a light is refused depends on the coefficients for charges only.
                known = (light, body.shape, body_in_channel.outer.boundary)
                if spec.model in ("full", "auto") and not spec.compare and known in reader.files.lights:
                    continue
                deposit = light.deposit_in(body_in_channel)
                reader.files.lights.add(known)
                if spec.model == "charges":
                    check_deposit(light, deposit, body_in_channel, [region.surface for region in body.regions])
                if channel == 0:
                    deposits.append(deposit)
    if not all(lights):
        dark = channels[[bool(lights_of_channel) for lights_of_channel in lights].index(False)]
        raise document.error(
            ("lights",),
            f"all lights are dark in channel {dark}; give one of them power there, or drop the channel.",
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
            for body_in_channel in body.bodies:
                homogeneous_medium(body_in_channel.by_label[number])


def _check_for_closed_form(document: Document, body: CaseBody, deposits: Sequence[Deposit]) -> None:
    """Refuse a body or a light without a closed form.

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    with document.at(("model",)):
        try:
            exact_field(body.surface.shape, homogeneous(body.bodies[0]), deposits)
        except InputError as error:
            raise InputError(error.text, remedy="write model: auto, or full") from error


def _check_value_names(document: Document, channels: tuple[str, ...], lights: tuple[str, ...]) -> None:
    """Refuse names of lights and channels that would give two arrays in a file one name.

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
