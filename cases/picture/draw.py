"""`draw_picture`: the body in the colours of its exitance, with lights, regions and detectors."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tetlux.cases.picture.frame import draw_frame
from tetlux.cases.picture.marks import RegionOutline, project_marks
from tetlux.cases.picture.rasterizer import rasterize
from tetlux.cases.picture.stage import FULL, LIGHT, OVERSAMPLING, SHADED, Image, Stage, build_stage, exitance_range
from tetlux.cases.picture.view import PANEL, UPRIGHT, Ray
from tetlux.meshing.arrays import FloatArray, IntArray, Vector
from tetlux.meshing.host.scratch import run_child, scratch
from tetlux.meshing.notes import Note

__all__ = ["PictureScene", "Ray", "RegionOutline", "draw_picture"]

# The command that renders a body with PyVista; two file names and the id of this process are appended.
RENDERER: tuple[str, ...] = (sys.executable, "-m", "tetlux.cases.picture._render_process")
# Seconds; 50,000 triangles take about 2 s without a graphics card.
TIME_LIMIT = 120.0
# Tried on a bare Debian 12: both packages are needed.
WITHOUT_PYVISTA = Note(
    "no-pyvista",
    "the picture was drawn without PyVista, which could not render on this machine; "
    "on Debian, `apt-get install libgl1 libegl1` installs what it needs.",
)


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


def draw_picture(scene: PictureScene, path: Path) -> list[str]:
    """Draw a body in the colours of its exitance.

    Colours map the logarithm of the exitance, down to six decades below its maximum, unless the scene gives colours.
    The camera looks at the lit side, unless the scene gives a direction. Arrows are translucent.

    Parameters
    ----------
    scene : PictureScene
    path : Path
        The PNG to write, 1400 x 1050 pixels; an older one is replaced only when the new one is complete.

    Returns
    -------
    list of str
        A note if PyVista could not render here, so that the built-in rasterizer drew the body.

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
    image = _render_with_pyvista(stage)
    warnings: list[str] = [] if image is not None else [WITHOUT_PYVISTA]
    unfinished = path.with_name(path.name + ".part")
    try:
        draw_frame(
            unfinished,
            _downsample(rasterize(stage) if image is None else image),
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
    return warnings


def _render_with_pyvista(stage: Stage) -> Image | None:
    """Render the body with PyVista in a process of its own; None if that fails."""
    camera = stage.camera
    try:
        with scratch("picture") as folder:
            job, output = folder / "stage.npz", folder / "image.npy"
            np.savez(
                job,
                size=OVERSAMPLING * np.array(PANEL),
                background=stage.background,
                light=LIGHT,
                shading=(SHADED, FULL),
                lamp=camera.lamp,
                corners=stage.corners,
                normals=stage.normals,
                shares=stage.shares,
                colours=np.zeros(0) if stage.colours is None else stage.colours,
                table=stage.table,
                arrows=stage.arrows,
                arrow_normals=stage.arrow_normals,
                center=camera.center,
                toward=camera.toward,
                up=camera.up,
                distance=4.0 * camera.pixel * max(PANEL),
                half_height=0.5 * camera.pixel * PANEL[1],
            )
            done = run_child([*RENDERER, str(job), str(output), str(os.getpid())], folder, TIME_LIMIT)
            if done.returncode != 0 or not output.exists():
                return None
            image: Image = np.load(output)
    except (subprocess.TimeoutExpired, OSError):
        return None
    expected = (OVERSAMPLING * PANEL[1], OVERSAMPLING * PANEL[0], 3)
    # A broken driver may report success and render nothing.
    blank = image.shape != expected or bool((image == image[0, 0]).all())
    return None if blank else image


def _downsample(image: Image) -> Image:
    """Average each square of `OVERSAMPLING` by `OVERSAMPLING` pixels."""
    n = OVERSAMPLING
    height, width = image.shape[0] // n, image.shape[1] // n
    mean = image.reshape(height, n, width, n, 3).mean(axis=(1, 3), dtype=np.float32)
    return np.asarray(np.round(mean), dtype=np.uint8)
