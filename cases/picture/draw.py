"""`draw_picture`: the body in the colours of its exitance, with lights, regions and detectors."""

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL.Image import Image as PillowImage

from tetlux.cases.picture.canvas import Canvas
from tetlux.cases.picture.frame import AROUND, draw_frame
from tetlux.cases.picture.marks import RegionOutline, project_marks
from tetlux.cases.picture.scale import Scale, scale_of
from tetlux.cases.picture.shading import draw_stage
from tetlux.cases.picture.stage import Image, Stage, build_stage
from tetlux.cases.picture.view import MARGIN, PANEL, UPRIGHT, Camera, Ray, upright_axes
from tetlux.meshing.arrays import FloatArray, IntArray, Vector

__all__ = ["PictureScene", "Ray", "RegionOutline", "draw_picture"]

# Of a picture, pixels, unless the case gives one; seconds of a turn and of a film.
SIZE = (PANEL[0] + AROUND[0], PANEL[1] + AROUND[1])
SECONDS, FILM_SECONDS = 4, 6
# Pictures smaller than this along one side are drawn twice as large and shrunk, or letters would leave no room.
SMALL = 640
# Of one picture of a film, milliseconds, at most.
SLOWEST = 800


@dataclass(frozen=True, eq=False)
class PictureScene:
    """What a picture shows.

    Parameters
    ----------
    points : (n, 3) ndarray
        Vertices of the body, in `unit`.
    triangles : (m, 3) ndarray
        Anticlockwise seen from outside.
    exitance : (n,) ndarray
        Exitance at the vertices, W/unit².
    unit, title : str
    lights : tuple of Ray
        Arrows and points of the lights.
    colours : ((n, 3) ndarray of uint8, float), optional
        Colours of the vertices, which replace those of the colour map, and the luminance of white, W/unit².
    up : (3,) floats
        The direction that is up in the picture.
    toward : (3,) ndarray, optional
        Unit vector from the body to the eye; if not given, it is chosen by the light.
    regions : tuple of RegionOutline
        Regions to outline.
    detectors : tuple of (str, Vector)
        Names of the detectors, and their positions on the surface.
    values : (n,) ndarray, optional
        What the colours show in place of the exitance.
    scale : Scale, optional
        Which colour stands for which value; by default the logarithm of the exitance, six decades at most.
    size : (int, int)
        Of the picture, pixels.
    """

    points: FloatArray
    triangles: IntArray
    exitance: FloatArray
    unit: str
    title: str
    lights: tuple[Ray, ...] = ()
    colours: tuple[Image, float] | None = None
    up: Vector = UPRIGHT
    toward: FloatArray | None = None
    regions: tuple[RegionOutline, ...] = ()
    detectors: tuple[tuple[str, Vector], ...] = ()
    values: FloatArray | None = None
    scale: Scale | None = None
    size: tuple[int, int] = SIZE

    @property
    def panel(self) -> tuple[int, int]:
        """Pixels of the panel that shows the body."""
        return self.size[0] - AROUND[0], self.size[1] - AROUND[1]


def draw_picture(scene: PictureScene, path: Path) -> None:
    """Draw a body in the colours of its exitance, or of what the scene gives.

    The camera looks at the lit side, unless the scene gives a direction. Arrows are translucent.

    Parameters
    ----------
    scene : PictureScene
    path : Path
        The PNG to write; an older one is replaced only when the new one is complete.

    Raises
    ------
    OSError
        If the picture cannot be written.
    """
    with replacing(path) as unfinished:
        canvas_of(scene).save(unfinished)


def draw_turntable(scene: PictureScene, frames: int, path: Path) -> None:
    """Write a GIF in which the body turns once about the direction that is up, anticlockwise seen from above.

    Parameters
    ----------
    scene : PictureScene
    frames : int
    path : Path

    Raises
    ------
    OSError
        If it cannot be written.
    """
    first, second, above = upright_axes(scene.up)
    toward = scene_stage(scene).camera.toward
    level, height = (toward @ first, toward @ second), toward @ above
    # All pictures have one scale: the body in a ball fits whatever side is seen.
    images = []
    for step in range(frames):
        turn = -2.0 * math.pi * step / frames
        x = math.cos(turn) * level[0] - math.sin(turn) * level[1]
        y = math.sin(turn) * level[0] + math.cos(turn) * level[1]
        images.append(canvas_of(replace(scene, toward=x * first + y * second + height * above), turning=True).image)
    _write_frames(images, [SECONDS * 1000 // frames] * frames, path)


def draw_film(scenes: Sequence[PictureScene], path: Path) -> None:
    """Write scenes one after the other, from one side, and the last for longer.

    Parameters
    ----------
    scenes : sequence of PictureScene
    path : Path
        A GIF, or WebP by its suffix ``.webp``.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    toward = scene_stage(scenes[0]).camera.toward
    images = [canvas_of(replace(scene, toward=toward)).image for scene in scenes]
    each = min(FILM_SECONDS * 1000 // len(images), SLOWEST)
    _write_frames(images, [each] * (len(images) - 1) + [each + 1000], path)


def _write_frames(images: Sequence[PillowImage], durations: list[int], path: Path) -> None:
    """Write pictures that follow each other for ever, each for so many milliseconds."""
    kind = "WEBP" if path.suffix.lower() == ".webp" else "GIF"
    with replacing(path) as unfinished:
        images[0].save(
            unfinished, format=kind, save_all=True, append_images=images[1:], duration=durations, loop=0, method=4
        )


def canvas_of(scene: PictureScene, *, turning: bool = False) -> Canvas:
    """Draw a scene; `turning`: at a scale in which any side of the body fits into the panel."""
    if min(scene.size) < SMALL:
        width, height = scene.size
        return canvas_of(replace(scene, size=(2 * width, 2 * height)), turning=turning).halved()
    stage = scene_stage(scene)
    if turning:
        stage = replace(stage, camera=_fixed(stage.camera, scene.points))
    scale = scene.scale or scale_of(scene.exitance, "exitance", f"W/{scene.unit}²")
    extent = np.ptp(scene.points, axis=0)
    diagonal = float(np.linalg.norm(extent))
    marks = project_marks(stage.camera, stage.corners, scene.regions, scene.detectors, scene.lights, diagonal)
    return draw_frame(
        draw_stage(stage),
        stage.camera,
        scene.lights,
        marks,
        scale=scale,
        below=scale.has_below(scene.exitance if scene.values is None else scene.values),
        white=None if scene.colours is None else scene.colours[1],
        unit=scene.unit,
        title=scene.title,
        extent=extent,
    )


def scene_stage(scene: PictureScene) -> Stage:
    """What is drawn of a scene."""
    return build_stage(
        scene.points,
        scene.triangles,
        scene.exitance,
        scene.lights,
        None if scene.colours is None else scene.colours[0] / 255.0,
        up=scene.up,
        toward=scene.toward,
        panel=scene.panel,
        scale=scene.scale,
        values=scene.values,
    )


def vertex_colours(scene: PictureScene) -> Image:
    """The colours of the vertices, sRGB as bytes (n, 3), without the shades of the lamp."""
    if scene.colours is not None:
        return scene.colours[0]
    scale = scene.scale or scale_of(scene.exitance, "exitance", "")
    shares = scale.shares(scene.exitance if scene.values is None else scene.values)
    rows = np.clip(shares * len(scale.table), 0, len(scale.table) - 1).astype(np.int64)
    return np.round(255 * scale.table[rows]).astype(np.uint8)


def _fixed(camera: Camera, points: FloatArray) -> Camera:
    """A camera with the same direction, at whose scale the ball around the body fits into the panel."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    reach = float(np.linalg.norm(points - middle, axis=1).max())
    return replace(camera, center=middle, pixel=2.0 * reach / ((1.0 - 2.0 * MARGIN) * min(camera.panel)))


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file beside a path, which takes its place when the block is complete."""
    unfinished = path.with_name(path.name + ".part")
    try:
        yield unfinished
        os.replace(unfinished, path)  # noqa: PTH105
    finally:
        unfinished.unlink(missing_ok=True)
