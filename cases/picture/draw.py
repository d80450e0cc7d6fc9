"""`draw_picture`: the body in the colours of its exitance, with lights, regions and detectors."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tetlux.cases.picture.frame import draw_frame
from tetlux.cases.picture.marks import RegionOutline, project_marks
from tetlux.cases.picture.shading import draw_stage
from tetlux.cases.picture.stage import Image, build_stage, exitance_range
from tetlux.cases.picture.view import UPRIGHT, Ray
from tetlux.meshing.arrays import FloatArray, IntArray, Vector

__all__ = ["PictureScene", "Ray", "RegionOutline", "draw_picture"]


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


def draw_picture(scene: PictureScene, path: Path) -> None:
    """Draw a body in the colours of its exitance.

    Colours map the logarithm of the exitance, down to six decades below its maximum, unless the scene gives colours.
    The camera looks at the lit side, unless the scene gives a direction. Arrows are translucent.

    Parameters
    ----------
    scene : PictureScene
    path : Path
        The PNG to write, 1400 x 1050 pixels; an older one is replaced only when the new one is complete.

    Raises
    ------
    OSError
        If the picture cannot be written.
    """
    ends = exitance_range(scene.exitance)
    colours = None if scene.colours is None else scene.colours[0] / 255.0
    stage = build_stage(
        scene.points, scene.triangles, scene.exitance, scene.lights, colours, up=scene.up, toward=scene.toward
    )
    extent = np.ptp(scene.points, axis=0)
    marks = project_marks(stage.camera, stage.corners, scene.regions, scene.detectors, float(np.linalg.norm(extent)))
    unfinished = path.with_name(path.name + ".part")
    try:
        draw_frame(
            unfinished,
            draw_stage(stage),
            stage.camera,
            scene.lights,
            marks,
            ends=ends,
            table=stage.table,
            below=ends is not None and bool((scene.exitance < ends[0] * (1 - 1e-9)).any()),
            white=None if scene.colours is None else scene.colours[1],
            unit=scene.unit,
            title=scene.title,
            extent=extent,
        )
        os.replace(unfinished, path)  # noqa: PTH105
    finally:
        unfinished.unlink(missing_ok=True)
