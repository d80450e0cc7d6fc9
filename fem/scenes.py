"""`Scenes`: one body with its checked media in each scene, by regions or by labels of a mesh."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tetlux.fem.body.body import Body
from tetlux.fem.body.partition import MeshPartition, SurfacePartition
from tetlux.fem.labels import GivenMedia, check_single_label, resolve_media, warnings_for_cavities, warnings_for_labels
from tetlux.fem.media.coefficients import AnyMedium
from tetlux.fem.media.region import Region, check_list_of_regions
from tetlux.fem.models.modulation import notes_on_frequency, shifts_of_scenes
from tetlux.fem.operators.assembly import Assembly, Lumping
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
class Scenes:
    """One body in several scenes, which share its shape and differ in media and lights.

    Attributes
    ----------
    surface : Surface
    inner : tuple of Surface
        The surfaces of the regions.
    media : list of tuple of medium
        For each scene the media of the body and of its regions, or those of the labels, in the order of `labels`.
    labels : tuple of int
        Labels of the mesh; empty if the media are those of the body and its regions.
    mesh : TetMesh, optional
        A mesh that is used as it is.
    bodies : list of Body
        For each scene the body with its media; scenes of equal media share one.
    mesh_is_body : bool
        Whether the user gave a mesh in place of a surface, so that its conformity is reported too.
    frequencies : tuple of float
        At which the lights of each scene are modulated, Hz; 0 for steady light.
    shifts : tuple of complex
        What that adds to sigma_a, 1/unit.
    """

    surface: Surface
    inner: tuple[Surface, ...]
    media: list[tuple[AnyMedium, ...]]
    labels: tuple[int, ...]
    mesh: TetMesh | None
    bodies: list[Body]
    mesh_is_body: bool
    frequencies: tuple[float, ...]
    shifts: tuple[complex, ...]

    def system_on(
        self,
        mesh: TetMesh,
        media: tuple[AnyMedium, ...],
        lumping: Lumping,
        assembly: Assembly,
        shift: complex = 0.0,
        *,
        limit: bool,
        expected: int = 0,
    ) -> System:
        """Prepare the system of one set of media on a mesh, for as many lights as its scenes have, or are expected.

        `solve` and `solve_each` make all their systems here, of diffusion: another model enters as `model_of`.
        """
        expected = max(expected, self.media.count(media))
        if self.labels:
            by_label = dict(zip(self.labels, media, strict=True))
            return System(mesh, by_label, self.surface, lumping, expected, (), assembly, limit, shift=shift)
        regions = tuple(Region(surface, medium) for surface, medium in zip(self.inner, media[1:], strict=True))
        return System(mesh, media[0], self.surface, lumping, expected, regions, assembly, limit, shift=shift)

    def warnings(self, number: int, solution: Solution, *, given: bool) -> list[str]:
        """Notes on the regions or labels of scene `number`, and on the mesh if the user gave it."""
        if self.labels:
            found = warnings_for_labels(solution.mesh, self.bodies[number].by_label)
        else:
            found = warnings_for_regions(self.inner, self.media[number])
        found = [*found, *notes_on_frequency(self.frequencies[number], self.shifts[number], self.media[number])]
        if not given:
            return found
        mesh = solution.mesh
        repairs = [Note("mesh-repaired", repair) for repair in mesh.repairs]
        of_mesh = [*repairs, *mesh.warnings, *(conformity_of(mesh) if self.mesh_is_body else ())]
        return [*found, *of_mesh, *warnings_for_cavities(solution)]


def build_scenes(
    body: Surface | TetMesh,
    mesh: TetMesh | None,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    regions: Sequence[Region],
    scenes: int,
    frequency: float | Sequence[float] = 0.0,
    outside_index: float = 1.0,
    *,
    any_size: bool = False,
) -> Scenes:
    """Check a body, its media and the modulation of lights, and assign the media to the scenes.

    `any_size` is as for `check_media`.

    Raises
    ------
    InputError
        If media, regions, labels and mesh do not fit each other.
    """
    if isinstance(body, TetMesh):
        conformity_of(body)
    surface = body.surface if isinstance(body, TetMesh) else body
    check_list_of_regions(regions)
    media, labels = _media_and_labels(body, mesh, medium, regions, scenes)
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
        check_media(bodies[each], any_size=any_size)
    of_scenes = [bodies[each] for each in media]
    modulation = shifts_of_scenes(frequency, [each.outer for each in of_scenes], surface.unit, outside_index)
    return Scenes(surface, inner, media, labels, mesh, of_scenes, isinstance(body, TetMesh), *modulation)


def media_by_channel(
    body: Surface | TetMesh, mesh: TetMesh | None, medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia]
) -> tuple[list[AnyMedium | GivenMedia], bool]:
    """Split what the user gave as `medium` into the media of each channel; the bool tells whether it was a list."""
    if isinstance(medium, AnyMedium):
        return [medium], False
    if not isinstance(medium, Mapping):
        if not isinstance(medium, Sequence):
            raise InputError(f"the medium is {medium!r}; give a Medium, a list of channels, or media by label.")
        return list(medium), True
    several = not all(isinstance(each, AnyMedium) for each in medium.values())
    return list(resolve_media(_mesh_with_labels(body, mesh), medium)), several


def _check_mesh(mesh: TetMesh, surface: Surface, regions: int | None) -> None:
    """Refuse a mesh in another unit, or with another number of regions; None: its labels are its regions."""
    if mesh.unit != surface.unit:
        raise InputError(f"the mesh is in {mesh.unit} and the surface in {surface.unit}; give both in one unit.")
    if regions is None:
        return
    if regions == 0:
        check_single_label(mesh)
        return
    have = max(mesh.region_volumes)
    if have != regions:
        raise InputError(f"the mesh has {have} regions and {regions} are given; give the regions that it was made of.")


def _mesh_with_labels(body: Surface | TetMesh, mesh: TetMesh | None) -> TetMesh:
    """The mesh whose labels the media are given by."""
    found = body if isinstance(body, TetMesh) else mesh
    if isinstance(body, TetMesh):
        conformity_of(body)
    if found is None:
        raise InputError(
            "media by label need a mesh with labelled tetrahedra; for a surface give one medium, and regions."
        )
    return found


def _media_and_labels(
    body: Surface | TetMesh,
    mesh: TetMesh | None,
    medium: AnyMedium | GivenMedia | Sequence[AnyMedium | GivenMedia],
    regions: Sequence[Region],
    scenes: int,
) -> tuple[list[tuple[AnyMedium, ...]], tuple[int, ...]]:
    """The media of each scene, and the labels in their order; no labels if the media are of a body and its regions."""
    each = [medium] if isinstance(medium, AnyMedium | Mapping) else list(medium)
    are_mappings = {isinstance(medium_of_channel, Mapping) for medium_of_channel in each}
    if len(are_mappings) > 1:
        raise InputError("some channels have a medium and some have media by label; give all channels the same kind.")
    if True not in are_mappings:
        return media_by_scene(medium, regions, scenes), ()  # type: ignore[arg-type]
    if len(regions) > 0:
        raise InputError("regions are surfaces within a body of one medium; leave them out where media are by label.")
    channels = resolve_media(_mesh_with_labels(body, mesh), medium)  # type: ignore[arg-type]
    if len(channels) == 1 and scenes > 1 and isinstance(medium, Mapping):
        channels *= scenes
    if len(channels) != scenes:
        raise InputError(f"there are media for {len(channels)} channels and {scenes} scenes; give one for each scene.")
    return [tuple(each.values()) for each in channels], tuple(channels[0])


def media_by_scene(
    medium: AnyMedium | Sequence[AnyMedium], regions: Sequence[Region], scenes: int
) -> list[tuple[AnyMedium, ...]]:
    """List for each scene the media of the body and of its regions.

    Raises
    ------
    InputError
        If there are not as many media as scenes, or their refractive indices differ within a body.
    """

    def repeat(given: AnyMedium | Sequence[AnyMedium], whose: str) -> list[AnyMedium]:
        if isinstance(given, AnyMedium):
            return [given] * scenes
        if len(given) != scenes:
            raise InputError(f"{whose} has {len(given)} media for {scenes} channels; give one, or one for each.")
        return list(given)

    columns = [repeat(medium, "the body")]
    columns += [repeat(region.medium, f"region {number}") for number, region in enumerate(regions, 1)]
    return list(zip(*columns, strict=True))
