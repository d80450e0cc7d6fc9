"""The pictures of a run: what each of them shows, as the case asks for it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tetlux.cases.file.channels import ALL, EMISSION
from tetlux.cases.file.schema.pictures import CutSpec, PictureSpec, file_names
from tetlux.cases.picture.arrows import light_rays
from tetlux.cases.picture.cut import cut_open
from tetlux.cases.picture.draw import SIZE, PictureScene, RegionOutline, draw_picture, draw_turntable
from tetlux.cases.picture.scale import scale_of
from tetlux.cases.picture.view import toward_camera, unit, upright_axes
from tetlux.cases.write.fields import Field, surface_fields, volume_fields
from tetlux.cases.write.results import Results
from tetlux.meshing.arrays import FloatArray

Readings = Sequence[dict[str, Any]]
# Of a cut, how far the eye is beside its normal and above it.
ASIDE, ABOVE = 0.35, 0.3


def draw_pictures(results: Results, readings: Readings, folder: Path) -> None:
    """Draw the pictures that a case asks for into a folder.

    Raises
    ------
    OSError
        If one cannot be written.
    InputError
        If a cut leaves nothing of the body.
    """
    pictures = results.case.spec.pictures
    scene = picture_scene(results, readings)
    for picture, name in zip(pictures, file_names(pictures), strict=True):
        shown = scene_of(picture, results, scene)
        if picture.turntable:
            draw_turntable(shown, picture.turntable, folder / name)
        else:
            draw_picture(shown, folder / name)


def picture_scene(results: Results, readings: Readings) -> PictureScene:
    """Collect what a picture shows unless the case says otherwise."""
    case = results.case
    # Lights of all channels: one that is dark in the first may be bright in another.
    lights = {name: light for channel in case.channels for name, light in channel.lights.items()}
    return PictureScene(
        points=results.surface.points,
        triangles=results.surface.faces,
        exitance=results.shown(),
        unit=case.surface.unit,
        title=f"{case.name}: {EMISSION}" if case.fluorophores else case.name,
        lights=tuple(ray for light in lights.values() for ray in light_rays(light, case.surface)),
        colours=results.preview if results.has_colours else None,
        up=case.up,
        toward=case.toward,
        regions=tuple(
            RegionOutline(region.surface.name, region.surface.points, region.surface.faces) for region in case.regions
        ),
        detectors=tuple({row["name"]: tuple(row["position"]) for row in readings}.items()),
    )


def scene_of(picture: PictureSpec, results: Results, scene: PictureScene) -> PictureScene:
    """What one picture shows: the scene with all that the picture chooses."""
    scene = replace(scene, size=picture.pixels or SIZE)
    if picture.camera is not None:
        scene = replace(scene, toward=toward_camera(picture.camera, results.case.surface, scene.up))
    if picture.shows_fluence:
        return _with_fluence(picture, results, scene)
    if not picture.chooses_values:
        return scene
    if picture.field or picture.channel or picture.light:
        field = _choose(surface_fields(results), picture.field or "exitance", picture)
    else:
        field = Field("exitance", scene.exitance, f"W/{scene.unit}²")
    return _with_values(replace(scene, colours=None), picture, field)


def _choose(fields: Sequence[Field], quantity: str, picture: PictureSpec) -> Field:
    """The field of a quantity, in the channel and of the light of a picture as far as it is known for each."""
    own = [field for field in fields if field.quantity == quantity]
    wanted = {"channel": picture.channel or ALL, "light": picture.light or ALL}
    matches = [field for field in own if (field.channel, field.light) == tuple(wanted.values())]
    return (matches or own)[0]


def _with_values(scene: PictureScene, picture: PictureSpec, field: Field) -> PictureScene:
    heading = ", ".join([field.quantity, *(each for each in (field.channel, field.light) if each != ALL)])
    scale = scale_of(
        field.values,
        heading,
        field.unit,
        logarithmic=picture.shown_logarithmically,
        ends=picture.range or (None, None),
        colour_map=picture.map,
    )
    return replace(scene, values=field.values, scale=scale)


def _with_fluence(picture: PictureSpec, results: Results, scene: PictureScene) -> PictureScene:
    """The mesh in the colours of its fluence, cut open if the picture asks for it."""
    mesh = results.mesh_solutions[0].mesh
    field = _choose(volume_fields(results), "fluence", picture)
    scene = _with_values(replace(scene, colours=None), picture, field)
    exitance = np.zeros(len(mesh.points))
    nodes = mesh.boundary_nodes
    exitance[nodes] = field.values[nodes]
    if picture.cut is None:
        return replace(
            scene,
            points=mesh.boundary_points,
            triangles=mesh.boundary_triangles,
            values=field.values[nodes],
            exitance=exitance[nodes],
        )
    normal, through = _plane(picture.cut, mesh.points)
    points, triangles, values = cut_open(mesh.points, mesh.tetrahedra, field.values, normal, through)
    away = [(np.array(ray.end) - through) @ normal > 1e-6 * results.case.surface.diagonal for ray in scene.lights]
    return replace(
        scene,
        points=points,
        triangles=triangles,
        values=values,
        exitance=values,
        toward=scene.toward if scene.toward is not None else _before(normal, scene.up),
        # What is taken away takes its lights, detectors and outlines of regions with it.
        lights=tuple(ray for ray, gone in zip(scene.lights, away, strict=True) if not gone),
        detectors=tuple(each for each in scene.detectors if (np.array(each[1]) - through) @ normal <= 0),
    )


def _plane(cut: CutSpec, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit normal and a point of the plane."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return unit(np.array(cut.normal)), middle if cut.through is None else np.array(cut.through)


def _before(normal: FloatArray, up: tuple[float, float, float]) -> FloatArray:
    """Direction to an eye that sees a cut, a little from the side and from above."""
    above = upright_axes(up)[2]
    aside = np.cross(above, normal)
    return unit(normal + ASIDE * unit(aside) + ABOVE * above)
