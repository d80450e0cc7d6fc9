"""Media of the case file, built as `Medium` or `VaryingMedium`."""

from typing import Any

from tetlux.cases.file.channels import value_in_channel
from tetlux.cases.file.documents.document import Document, Key
from tetlux.cases.file.reader import Reader
from tetlux.cases.file.schema.media import FieldSpec, MaterialSpec, Media, MediumSpec, PhaseSpec, TissueSpec
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.materials import material
from tetlux.fem.media.medium import Medium
from tetlux.fem.media.phase import PhaseFunction, henyey_greenstein, table, two_term
from tetlux.fem.media.spectra import SPECTRA, Spectrum
from tetlux.fem.media.tissue import tissue
from tetlux.fem.media.varying import Field, VaryingMedium
from tetlux.fem.validity.notes import check_scattering
from tetlux.meshing.arrays import FloatArray


def read_media(
    document: Document, key: Key, spec: Media, points: FloatArray, unit: str, count: int, reader: Reader
) -> tuple[AnyMedium, ...]:
    """Build the media of a body, a region or a label.

    Parameters
    ----------
    document : Document
    key : Key
        The key of the medium in it.
    spec : MediumSpec, MaterialSpec, TissueSpec or list of MediumSpec
    points : (n, 3) ndarray
        Vertices of the body or region, or nodes of the label: coefficients that vary must be known at all of them.
    unit : str
        Unit of length.
    count : int
        Number of channels.
    reader : Reader

    Returns
    -------
    tuple of Medium or VaryingMedium
        One for each channel.

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    if isinstance(spec, MaterialSpec):
        with document.at((*key, "material")):
            return material(spec.material, unit=unit)
    if isinstance(spec, TissueSpec):
        return _tissue(document, key, spec, unit, reader)
    if isinstance(spec, list):
        return tuple(_medium(document, (*key, i), each, points, i, reader) for i, each in enumerate(spec))
    return tuple(_medium(document, key, spec, points, channel, reader) for channel in range(count))


def _medium(
    document: Document, key: Key, spec: MediumSpec, points: FloatArray, channel: int, reader: Reader
) -> AnyMedium:
    fields: dict[str, Field] = {}
    numbers: dict[str, float] = {}
    for name in ("sigma_a", "eta", "sigma_s_prime", "sigma_s", "g"):
        value = getattr(spec, name)
        if isinstance(value, FieldSpec):
            with document.at((*key, name)):
                fields[name] = reader.field(value)
                numbers[name] = float(fields[name](points).mean())
        elif value is not None:
            numbers[name] = value_in_channel(value, channel)
    with document.at((*key, "phase")):
        phase = _phase(spec.phase) if spec.phase else None
    with document.at(key, {name: (name,) for name in MediumSpec.model_fields}):
        medium = Medium(**numbers, phase=phase, boundary=spec.boundary)
        check_scattering(medium)
        if not fields:
            return medium
        varying = VaryingMedium(base=medium, **fields)
        varying.at(points)
        return varying


def tissue_arguments(key: Key, spec: TissueSpec, unit: str, document: Document, reader: Reader) -> dict[str, Any]:
    """The arguments of `tissue` for a medium by chromophores, with the spectra that it names.

    Raises
    ------
    InputError
        If a file of a spectrum cannot be read.
    """
    others: dict[str, tuple[Spectrum, float]] = {}
    for name, substance in spec.chromophores.others.items():
        with document.at((*key, *_keys_of_tissue(spec)[name])):
            others[name] = reader.spectrum(substance)
    return {
        "wavelengths": spec.wavelengths,
        **{name: getattr(spec.chromophores, name) for name in SPECTRA},
        "others": others,
        **dict(spec.scattering),
        "eta": spec.eta,
        "unit": unit,
        "boundary": spec.boundary,
    }


def _keys_of_tissue(spec: TissueSpec) -> dict[str, Key]:
    """The keys of amounts, scattering and the rest within the section of a medium, by name."""
    keys: dict[str, Key] = {name: (name,) for name in TissueSpec.model_fields}
    keys |= {name: ("chromophores", "others", name) for name in spec.chromophores.others}
    keys |= {name: ("chromophores", name) for name in SPECTRA}
    return keys | {"a": ("scattering", "a"), "b": ("scattering", "b")}


def _tissue(document: Document, key: Key, spec: TissueSpec, unit: str, reader: Reader) -> tuple[AnyMedium, ...]:
    arguments = tissue_arguments(key, spec, unit, document, reader)
    with document.at(key, _keys_of_tissue(spec)):
        media = tissue(**arguments)
        for medium in media:
            check_scattering(medium)
    return tuple(media)


def _phase(spec: PhaseSpec) -> PhaseFunction:
    if spec.henyey_greenstein is not None:
        return henyey_greenstein(spec.henyey_greenstein)
    if spec.two_term:
        return two_term(spec.two_term.g1, spec.two_term.g2, spec.two_term.share)
    assert spec.table is not None
    return table(spec.table.angles, spec.table.values)
