"""`Scene`: a body and its media, checked, whether they are given by regions or by labels of a mesh."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import MeshPartition, SurfacePartition
from tetlux.fem.labelled import GivenMedia, channels_by_label, one_label, warnings_for_cavities, warnings_for_labels
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region, check_list_of_regions
from tetlux.fem.operators.assembly import Assembly, Mass
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.system import System
from tetlux.fem.validity.notes import check_media, warnings_for_regions
from tetlux.meshing.errors import InputError
from tetlux.meshing.notes import Note
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.conformity import conformity_of
from tetlux.meshing.tets.mesh import TetMesh
from tetlux.meshing.tets.nesting import check_regions


@dataclass(frozen=True, eq=False)
class Scene:
    """A body and its media.

    Attributes
    ----------
    surface : Surface
    inner : tuple of Surface
        Of its regions.
    media : list of tuple of medium
        In each scene: those of the body and of its regions, or those of labels.
    labels : tuple of int
        Of a mesh, if media are by label.
    mesh : TetMesh, optional
        That is used as it is.
    bodies : list of Body
        What light falls on in each scene; scenes of the same media have the same.
    checked : bool
        Whether the mesh is the body itself, and had to be looked at.
    """

    surface: Surface
    inner: tuple[Surface, ...]
    media: list[tuple[AnyMedium, ...]]
    labels: tuple[int, ...]
    mesh: TetMesh | None
    bodies: list[Body]
    checked: bool

    def system_on(
        self, mesh: TetMesh, media: tuple[AnyMedium, ...], mass: Mass, assembly: Assembly, *, limit: bool
    ) -> System:
        """The equations of the media of a scene on a mesh."""
        expected = self.media.count(media)
        if self.labels:
            labelled = dict(zip(self.labels, media, strict=True))
            return System(mesh, labelled, self.surface, mass, expected, (), assembly, limit)
        regions = tuple(Region(surface, medium) for surface, medium in zip(self.inner, media[1:], strict=True))
        return System(mesh, media[0], self.surface, mass, expected, regions, assembly, limit)

    def warnings(self, number: int, solution: Solution, *, given: bool) -> list[str]:
        """What a user should know of its parts in one of the scenes, and of a mesh that was given."""
        if self.labels:
            found = warnings_for_labels(solution.mesh, self.bodies[number].by_label)
        else:
            found = warnings_for_regions(self.inner, self.media[number])
        if not given:
            return found
        mesh = solution.mesh
        repairs = [Note("mesh-repaired", repair) for repair in mesh.repairs]
        said = [*repairs, *mesh.warnings, *(conformity_of(mesh) if self.checked else ())]
        return [*found, *said, *warnings_for_cavities(solution)]


def scene_of(
    body: Surface | TetMesh,
    mesh: TetMesh | None,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    regions: Sequence[Region],
    scenes: int,
) -> Scene:
    """A body and its media, checked."""
    if isinstance(body, TetMesh):
        conformity_of(body)
    surface = body.surface if isinstance(body, TetMesh) else body
    check_list_of_regions(regions)
    media, labels = _media(body, mesh, medium, regions, scenes)
    inner = tuple(region.surface for region in regions)
    if mesh is None:
        check_regions(surface, inner)
    else:
        _check_mesh(mesh, surface, None if labels else len(inner))
    bodies = {}
    for each in dict.fromkeys(media):
        if labels and mesh is not None:
            bodies[each] = Body(surface, dict(zip(labels, each, strict=True)), MeshPartition(mesh))
        else:
            bodies[each] = Body(surface, each, SurfacePartition(inner))
        check_media(bodies[each])
    return Scene(surface, inner, media, labels, mesh, [bodies[each] for each in media], isinstance(body, TetMesh))


def channels_of(
    body: Surface | TetMesh, mesh: TetMesh | None, medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia]
) -> tuple[list[AnyMedium | GivenMedia], bool]:
    """The media of each channel, and whether they are given as channels."""
    if isinstance(medium, AnyMedium):
        return [medium], False
    if not isinstance(medium, Mapping):
        if not isinstance(medium, Sequence):
            raise InputError(f"the medium is {medium!r}; give a Medium, a list of channels, or media by label.")
        return list(medium), True
    several = not all(isinstance(each, AnyMedium) for each in medium.values())
    return list(channels_by_label(_labelled(body, mesh), medium)), several


def _check_mesh(mesh: TetMesh, surface: Surface, regions: int | None) -> None:
    """Refuse a mesh that is not of this body, or has other regions than so many, if they have no labels."""
    if mesh.unit != surface.unit:
        raise InputError(f"the mesh is in {mesh.unit} and the surface in {surface.unit}; give both in one unit.")
    if regions is None:
        return
    if regions == 0:
        one_label(mesh)
        return
    have = max(mesh.region_volumes)
    if have != regions:
        raise InputError(f"the mesh has {have} regions and {regions} are given; give those that it was made of.")


def _labelled(body: Surface | TetMesh, mesh: TetMesh | None) -> TetMesh:
    """The mesh that labels are of."""
    found = body if isinstance(body, TetMesh) else mesh
    if isinstance(body, TetMesh):
        conformity_of(body)
    if found is None:
        raise InputError(
            "media by label go with a mesh of labelled tetrahedra; give a surface one medium, and regions."
        )
    return found


def _media(
    body: Surface | TetMesh,
    mesh: TetMesh | None,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    regions: Sequence[Region],
    scenes: int,
) -> tuple[list[tuple[AnyMedium, ...]], tuple[int, ...]]:
    """The media of each scene, and the labels that they are of, none if they are of a body and its regions."""
    each = [medium] if isinstance(medium, AnyMedium | Mapping) else list(medium)
    kinds = {isinstance(one, Mapping) for one in each}
    if len(kinds) > 1:
        raise InputError("some channels have a medium and some have media by label; give all of them alike.")
    if True not in kinds:
        return media_of(medium, regions, scenes), ()  # type: ignore[arg-type]
    if len(regions) > 0:
        raise InputError("regions are surfaces within a body of one medium; leave them out where media are by label.")
    channels = channels_by_label(_labelled(body, mesh), medium)  # type: ignore[arg-type]
    if len(channels) == 1 and scenes > 1 and isinstance(medium, Mapping):
        channels *= scenes
    if len(channels) != scenes:
        raise InputError(f"there are media for {len(channels)} channels and {scenes} scenes; give one for each.")
    return [tuple(each.values()) for each in channels], tuple(channels[0])


def media_of(
    medium: AnyMedium | Sequence[AnyMedium], regions: Sequence[Region], scenes: int
) -> list[tuple[AnyMedium, ...]]:
    """The media of the body and its regions in each scene.

    Raises
    ------
    InputError
        If there are not as many media as scenes, or their refractive indices differ within a body.
    """

    def of_scenes(given: AnyMedium | Sequence[AnyMedium], whose: str) -> list[AnyMedium]:
        if isinstance(given, AnyMedium):
            return [given] * scenes
        if len(given) != scenes:
            raise InputError(f"{whose} has {len(given)} media for {scenes} channels; give one, or one for each.")
        return list(given)

    columns = [of_scenes(medium, "the body")]
    columns += [of_scenes(region.medium, f"region {number}") for number, region in enumerate(regions, 1)]
    return list(zip(*columns, strict=True))
