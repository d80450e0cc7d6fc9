"""The body of a case with its media, built from the case file: a surface and regions, or a mesh and labels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from tetlux.cases.file.channel_context import find_part
from tetlux.cases.file.channels import check_unique_names
from tetlux.cases.file.documents.document import Document, Key
from tetlux.cases.file.light_names import BODY
from tetlux.cases.file.media import read_media
from tetlux.cases.file.reader import Reader
from tetlux.cases.file.schema.body import MeshSpec
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.file.schema.fluorescence import DyeSpec, FluorescenceSpec
from tetlux.cases.file.schema.media import Media
from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import MeshPartition, SurfacePartition
from tetlux.fem.labels import find_label, order_outermost_first
from tetlux.fem.media.coefficients import AnyMedium, MediaByLabel, check_labels
from tetlux.fem.media.fluorophore import Fluorophore
from tetlux.fem.media.region import Region
from tetlux.fem.scenes import media_by_scene
from tetlux.fem.validity.notes import check_compatible, check_media, check_size
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.errors import InputError
from tetlux.meshing.mesher.api import check_thickness
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.nesting import check_regions

# Models that take bodies larger than finite elements can mesh as a whole.
OF_ANY_SIZE = ("auto", "truncated")


@dataclass(frozen=True, eq=False)
class CaseBody:
    """The body of a case, with its media in every channel.

    Attributes
    ----------
    surface : Surface
        The surface of the body; the boundary of a mesh.
    media : tuple of AnyMedium
        The medium of the body, or of its outermost label, in each channel.
    parts : mapping of str to int
        Numbers of regions, or labels, by name; None stands for the whole body.
    regions : tuple of Region
    mesh : TetMesh, optional
        A mesh that the case gives.
    by_label : tuple of mapping
        The media by label of that mesh, in each channel.
    """

    surface: Surface
    media: tuple[AnyMedium, ...]
    parts: Mapping[str, int | None]
    regions: tuple[Region, ...] = ()
    mesh: TetMesh | None = None
    by_label: tuple[MediaByLabel, ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """Ids of its surfaces, or of its mesh, which runs of the same shape share."""
        parts = (self.surface, *(region.surface for region in self.regions)) if self.mesh is None else (self.mesh,)
        return tuple(map(id, parts))

    @cached_property
    def bodies(self) -> list[Body]:
        """The body as lights see it, in each channel."""
        if self.mesh is not None:
            return [Body(self.surface, media, MeshPartition(self.mesh)) for media in self.by_label]
        partition = SurfacePartition([region.surface for region in self.regions])
        by_channel = media_by_scene(self.media, self.regions, len(self.media))
        return [Body(self.surface, media, partition) for media in by_channel]


def read_body(document: Document, spec: CaseSpec, channels: int, reader: Reader) -> CaseBody:
    """Read the body of a case and check it.

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    if spec.mesh is not None:
        return _read_mesh_body(document, spec.mesh, spec.unit, channels, reader)
    assert spec.surface is not None
    assert spec.medium is not None
    with document.at(("surface",)):
        surface = reader.surface(spec.surface, spec.unit)
        check_thickness(surface)
    media = read_media(document, ("medium",), spec.medium, surface.points, surface.unit, channels, reader)
    names, regions = _read_regions(document, spec, surface, media, reader)
    parts = {name: number for number, name in enumerate((BODY, *names))} if regions else {BODY: None}
    body = CaseBody(surface, media, parts, regions)
    with document.at(("surface",)):
        for each in body.bodies:
            check_size(each, any_size=spec.model in OF_ANY_SIZE)
    return body


def _read_regions(
    document: Document, spec: CaseSpec, surface: Surface, media: tuple[AnyMedium, ...], reader: Reader
) -> tuple[tuple[str, ...], tuple[Region, ...]]:
    """Read the regions and their names."""
    names = tuple(region.name or f"region_{i}" for i, region in enumerate(spec.regions, 1))
    check_unique_names(document, "regions", names)
    if BODY in names:
        raise document.error(
            ("regions", names.index(BODY)),
            f'"{BODY}" is the part outside of all regions; give another name.',
        )
    regions = []
    for i, region in enumerate(spec.regions):
        key: Key = ("regions", i)
        with document.at((*key, "surface")):
            inner = reader.region(region.surface, spec.unit, names[i])
        own = read_media(document, (*key, "medium"), region.medium, inner.points, inner.unit, len(media), reader)
        with document.at((*key, "medium")):
            for outside, inside in zip(media, own, strict=True):
                check_compatible((outside, inside))
        regions.append(Region(inner, own))
    inner_surfaces = [region.surface for region in regions]
    body = (id(surface), *map(id, inner_surfaces))
    if body not in reader.files.nested:
        with document.at(("regions",)):
            check_regions(surface, inner_surfaces)
        reader.files.nested.add(body)
    return names, tuple(regions)


def read_emission(
    document: Document, spec: FluorescenceSpec | None, body: CaseBody, reader: Reader
) -> tuple[CaseBody | None, tuple[Fluorophore, ...]]:
    """Read the body with its media at the wavelength that dyes emit, and the dyes; None and none without dyes.

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    if spec is None:
        return None, ()
    key: Key = ("fluorescence",)
    dyes, count = [], len(body.media)
    whole = body.surface.points if body.mesh is None else body.mesh.points
    for i, dye in enumerate(spec.dyes):
        with document.at((*key, "dyes", i), {name: (name,) for name in DyeSpec.model_fields}):
            region = find_part(body.parts, dye.region)
            dyes.append(Fluorophore(dye.absorption, dye.quantum_yield, dye.lifetime, region))
    own: dict[int | None, tuple[AnyMedium, ...]] = {}

    def read(where: Key, medium: Media, points: FloatArray) -> tuple[AnyMedium, ...]:
        return read_media(document, where, medium, points, body.surface.unit, count, reader)

    for name, medium in spec.regions.items():
        where: Key = (*key, "regions", name)
        with document.at(where):
            number = find_part(body.parts, name)
            if number is None or (body.mesh is None and number == 0):
                raise InputError("this is the medium of the body; give it as fluorescence.emission.", field="regions")
        own[number] = read(where, medium, whole if body.mesh else body.regions[number - 1].surface.points)
    outer = read((*key, "emission"), spec.emission, whole)
    regions = tuple(
        Region(region.surface, own.get(number, region.medium)) for number, region in enumerate(body.regions, 1)
    )
    by_label = tuple(
        {label: own.get(label, outer)[channel] for label in media} for channel, media in enumerate(body.by_label)
    )
    emitting = replace(body, media=outer, regions=regions, by_label=by_label)
    with document.at((*key, "emission")):
        for each in emitting.bodies:
            check_media(each)
    return emitting, tuple(dyes)


def join_regions(body: CaseBody, emitting: CaseBody) -> tuple[Region, ...]:
    """The regions of a body with their media in its channels, and after these in those of the emission."""
    pairs = zip(body.regions, emitting.regions, strict=True)
    return tuple(Region(a.surface, [*_list_of(a.medium), *_list_of(b.medium)]) for a, b in pairs)


def _list_of(medium: AnyMedium | Sequence[AnyMedium]) -> Sequence[AnyMedium]:
    return [medium] if isinstance(medium, AnyMedium) else medium


def _read_mesh_body(document: Document, spec: MeshSpec, unit: str, channels: int, reader: Reader) -> CaseBody:
    """The body of a case that gives a mesh and the media of its labels."""
    with document.at(("mesh",)):
        mesh = reader.mesh(spec, unit)
    media: dict[int, tuple[AnyMedium, ...]] = {}
    for name, medium in spec.labels.items():
        key: Key = ("mesh", "labels", name)
        with document.at(key):
            label = find_label(mesh, name)
            if label in media:
                raise InputError(f"label {mesh.label_text([label])} has two media; give it one.")
        nodes = mesh.points[mesh.tetrahedra[mesh.regions == label].reshape(-1)]
        media[label] = read_media(document, key, medium, nodes, mesh.unit, channels, reader)
    with document.at(("mesh", "labels")):
        check_labels(mesh, media)
        order = order_outermost_first(mesh, media)
        by_label = tuple({label: media[label][channel] for label in order} for channel in range(channels))
    parts: dict[str, int | None] = {str(label): label for label in order}
    parts |= {name: label for label, name in mesh.labels.items() if label in media}
    body = CaseBody(mesh.surface, media[order[0]], parts, mesh=mesh, by_label=by_label)
    with document.at(("mesh", "labels")):
        for each in body.bodies:
            check_media(each)
    return body
