"""From the case file's body to what is solved on: a surface and its regions, or a mesh and its labels."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from tetlux.cases.file.channels import check_different
from tetlux.cases.file.document import Document, Key
from tetlux.cases.file.lighting import BODY
from tetlux.cases.file.media import media_of
from tetlux.cases.file.reading import Reader
from tetlux.cases.file.schema.case import CaseSpec, MeshSpec
from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import MeshPartition, SurfacePartition
from tetlux.fem.labelled import label_of, outermost_first
from tetlux.fem.media.coefficients import AnyMedium, MediaByLabel, check_labels
from tetlux.fem.media.region import Region
from tetlux.fem.scene import media_of as media_of_scenes
from tetlux.fem.validity.notes import check_compatible, check_media, check_size
from tetlux.meshing.errors import InputError
from tetlux.meshing.mesher.api import check_thickness
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.nesting import check_regions


@dataclass(frozen=True, eq=False)
class CaseBody:
    """What a case is solved on.

    Attributes
    ----------
    surface : Surface
        The body's; of a mesh, its boundary.
    media : tuple of AnyMedium
        Of the body, or of its outermost label, one for each channel.
    parts : mapping of str to int
        Numbers of regions, or labels, by name; None is the whole body.
    regions : tuple of Region
    mesh : TetMesh, optional
        If it is given.
    by_label : tuple of mapping
        The media of the mesh's labels, for each channel.
    """

    surface: Surface
    media: tuple[AnyMedium, ...]
    parts: Mapping[str, int | None]
    regions: tuple[Region, ...] = ()
    mesh: TetMesh | None = None
    by_label: tuple[MediaByLabel, ...] = ()

    @property
    def is_uniform(self) -> bool:
        """Whether it is of one medium in each channel."""
        return not self.regions and all(len(media) == 1 for media in self.by_label)

    @cached_property
    def of_channels(self) -> list[Body]:
        """What light falls on in each channel."""
        if self.mesh is not None:
            return [Body(self.surface, media, MeshPartition(self.mesh)) for media in self.by_label]
        partition = SurfacePartition([region.surface for region in self.regions])
        each = media_of_scenes(self.media, self.regions, len(self.media))
        return [Body(self.surface, media, partition) for media in each]


def body_of(document: Document, spec: CaseSpec, channels: int, reader: Reader) -> CaseBody:
    """The body of a case.

    Raises
    ------
    InputError
        With the file, the line and the key.
    """
    if spec.mesh is not None:
        return _of_mesh(document, spec.mesh, spec.unit, channels, reader)
    assert spec.surface is not None
    assert spec.medium is not None
    with document.at(("surface",)):
        surface = reader.surface(spec.surface, spec.unit)
        check_thickness(surface)
    media = media_of(document, ("medium",), spec.medium, surface.points, surface.unit, channels, reader)
    names, regions = _regions(document, spec, surface, media, reader)
    parts = {name: number for number, name in enumerate((BODY, *names))} if regions else {BODY: None}
    body = CaseBody(surface, media, parts, regions)
    with document.at(("surface",)):
        for each in body.of_channels:
            check_size(each)
    return body


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
        own = media_of(document, (*key, "medium"), region.medium, inner.points, inner.unit, len(media), reader)
        with document.at((*key, "medium")):
            for outside, inside in zip(media, own, strict=True):
                check_compatible((outside, inside))
        regions.append(Region(inner, own))
    with document.at(("regions",)):
        check_regions(surface, [region.surface for region in regions])
    return names, tuple(regions)


def _of_mesh(document: Document, spec: MeshSpec, unit: str, channels: int, reader: Reader) -> CaseBody:
    with document.at(("mesh",)):
        mesh = reader.mesh(spec, unit)
    media: dict[int, tuple[AnyMedium, ...]] = {}
    for name, medium in spec.labels.items():
        key: Key = ("mesh", "labels", name)
        with document.at(key):
            label = label_of(mesh, name)
            if label in media:
                raise InputError(f"label {mesh.named([label])} has a medium already; give it one.")
        nodes = mesh.points[mesh.tetrahedra[mesh.regions == label].reshape(-1)]
        media[label] = media_of(document, key, medium, nodes, mesh.unit, channels, reader)
    with document.at(("mesh", "labels")):
        check_labels(mesh, media)
        order = outermost_first(mesh, media)
        by_label = tuple({label: media[label][channel] for label in order} for channel in range(channels))
    parts: dict[str, int | None] = {str(label): label for label in order}
    parts |= {name: label for label, name in mesh.labels.items() if label in media}
    body = CaseBody(mesh.surface, media[order[0]], parts, mesh=mesh, by_label=by_label)
    with document.at(("mesh", "labels")):
        for each in body.of_channels:
            check_media(each)
    return body
