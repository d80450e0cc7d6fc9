"""The picture of a run: the body in the colours of its exitance."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tetlux.cases.picture.frame import frame
from tetlux.cases.picture.marks import Shape, marks_of
from tetlux.cases.picture.plain import draw_plain
from tetlux.cases.picture.stage import FULL, LIGHT, OVERSAMPLING, SHADED, Image, Stage, build_stage, exitance_range
from tetlux.cases.picture.view import PANEL, UPRIGHT, Ray
from tetlux.meshing.arrays import FloatArray, IntArray, Vector
from tetlux.meshing.host.scratch import run_child, scratch
from tetlux.meshing.notes import Note

__all__ = ["Ray", "Scene", "Shape", "draw"]

# The command that draws a body with PyVista; the names of two files and the number of this process are added.
RENDERER: tuple[str, ...] = (sys.executable, "-m", "tetlux.cases.picture._render_process")
# Seconds; 50,000 triangles take about two without a graphics card.
TIME_LIMIT = 120.0
# Measured on a bare Debian 12: either package alone is not enough.
WITHOUT_PYVISTA = Note(
    "no-pyvista",
    "the picture was drawn without PyVista, which could not render on this machine; "
    "on Debian, `apt-get install libgl1 libegl1` brings what it needs.",
)


@dataclass(frozen=True, eq=False)
class Scene:
    """What is to be seen.

    Parameters
    ----------
    points : (n, 3) ndarray
        Vertices of the body, in `unit`.
    triangles : (m, 3) ndarray
        Anticlockwise seen from outside.
    exitance : (n,) ndarray
        W/unit², at the vertices.
    unit, title : str
    lights : tuple of Ray
        The lights to draw in.
    colours : ((n, 3) ndarray of uint8, float), optional
        Colours of the vertices, in place of those of their exitance, and what white stands for, W/unit².
    up : (3,) floats
        What is up in the picture.
    toward : (3,) ndarray, optional
        Unit vector to the eye; chosen by the light if not given.
    regions : tuple of Shape
        Regions to outline.
    detectors : tuple of (str, Vector)
        Names of the detectors, and their places on the surface.
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
    regions: tuple[Shape, ...] = ()
    detectors: tuple[tuple[str, Vector], ...] = ()


def draw(scene: Scene, path: Path) -> list[str]:
    """Draw a body in the colours of its exitance.

    The colours follow the logarithm of the exitance, down to six decades below its maximum, or are those given. The
    camera looks at the lit side, unless it is given. Arrows are seen through, and regions as outlines.

    Parameters
    ----------
    scene : Scene
    path : Path
        Where the PNG goes, 1400 x 1050 pixels; replaced only when the new picture is complete.

    Returns
    -------
    list of str
        A sentence if PyVista could not render here and a plainer drawing was made instead.

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
    marks = marks_of(stage.camera, stage.corners, scene.regions, scene.detectors, float(np.linalg.norm(extent)))
    image = _drawn_with_pyvista(stage)
    warnings: list[str] = [] if image is not None else [WITHOUT_PYVISTA]
    unfinished = path.with_name(path.name + ".part")
    try:
        frame(
            unfinished,
            _averaged(draw_plain(stage) if image is None else image),
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


def _drawn_with_pyvista(stage: Stage) -> Image | None:
    """The body as PyVista draws it in a process of its own, or None where it cannot."""
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
    # A broken driver may also return without an error and leave the window empty.
    blank = image.shape != expected or bool((image == image[0, 0]).all())
    return None if blank else image


def _averaged(image: Image) -> Image:
    """Every square of `OVERSAMPLING` pixels as one."""
    n = OVERSAMPLING
    height, width = image.shape[0] // n, image.shape[1] // n
    mean = image.reshape(height, n, width, n, 3).mean(axis=(1, 3), dtype=np.float32)
    return np.asarray(np.round(mean), dtype=np.uint8)
