"""A body as an emitter for Mitsuba 3: its triangles, an image of the radiance on each, and a scene to begin with.

Mitsuba samples an area emitter by its texture, for which each point of the image has to be one point of the surface:
each triangle has a place of its own in the image, half a cell of 5 x 5 pixels.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from tetlux.cases.picture.view import upright_axes
from tetlux.cases.write.ply import write_ply
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.surface.surface import Surface

EMITTER, IMAGE, SCENE = "emitter.ply", "emitter.pfm", "mitsuba.xml"
# Pixels along the side of a cell, and of the corners of both triangles in it. Bilinear interpolation inside the first
# reaches pixels with i + j up to 3, inside the second from 5.
CELL = 5
CORNERS = np.array([[[0, 0], [2, 0], [0, 2]], [[4, 4], [2, 4], [4, 2]]])
TEMPLATE = """\
<!-- {title}, for Mitsuba 3: mitsuba {scene} (in its RGB variants). Lengths in {unit}, radiance in W/({unit}² sr). -->
<scene version="3.0.0">
  <integrator type="path"/>
  <sensor type="perspective">
    <float name="fov" value="30"/>
    <transform name="to_world"><lookat origin="{origin}" target="{target}" up="{up}"/></transform>
    <film type="hdrfilm"><integer name="width" value="800"/><integer name="height" value="600"/></film>
    <sampler type="independent"><integer name="sample_count" value="64"/></sampler>
  </sensor>

  <!-- The body: what leaves each point of it, the same in all directions. -->
  <shape type="ply">
    <string name="filename" value="{emitter}"/>
    <emitter type="area">
      <texture name="radiance" type="bitmap">
        <string name="filename" value="{image}"/>
        <boolean name="raw" value="true"/>
      </texture>
    </emitter>
  </shape>

  <!-- A floor that it lights. -->
  <shape type="rectangle">
    <transform name="to_world">
      <scale value="{floor}"/>
      <lookat origin="{ground}" target="{above}" up="{aside}"/>
    </transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf>
  </shape>
</scene>
"""
# The eye is so many diagonals of the body away from its middle; half the side of the floor.
AWAY, FLOOR = 2.6, 4.0


def write_mitsuba(
    surface: Surface, folder: Path, exitance: FloatArray, toward: FloatArray, up: Vector, title: str
) -> None:
    """Write ``emitter.ply``, ``emitter.pfm`` and ``mitsuba.xml`` into a folder.

    Parameters
    ----------
    surface : Surface
    folder : Path
    exitance : (v, 3) ndarray
        Red, green and blue at the vertices, W/unit². An area emitter takes radiance, which is the exitance over pi
        where light leaves alike in all directions; see `tetlux.fem.radiance` for its true, slightly forward, lobe.
    toward : (3,) ndarray
        Unit vector from the body to the eye.
    up : (3,) floats
        The direction that is up.
    title : str
    """
    radiance = np.clip(exitance, 0.0, None) / np.pi
    image, places = make_atlas(radiance[surface.faces])
    corners = surface.faces.ravel()
    apart = replace(surface, points=surface.points[corners], faces=np.arange(len(corners)).reshape(-1, 3))
    columns = dict(zip("uvrgb", np.column_stack([places.reshape(-1, 2), radiance[corners]]).T, strict=True))
    write_ply(apart, folder / EMITTER, columns, [f"radiance in W/({surface.unit}² sr)"])
    side = len(image)
    # The rows of a PFM begin at the bottom.
    (folder / IMAGE).write_bytes(f"PF\n{side} {side}\n-1.0\n".encode() + image[::-1].astype("<f4").tobytes())
    middle = 0.5 * (surface.points.min(axis=0) + surface.points.max(axis=0))
    across, _, above = upright_axes(up)
    heights = (surface.points - middle) @ above
    ground = middle + heights.min() * above
    text = TEMPLATE.format(
        title=title.replace("--", "- -"),
        scene=SCENE,
        unit=surface.unit,
        emitter=EMITTER,
        image=IMAGE,
        origin=_numbers(middle + AWAY * surface.diagonal * toward),
        target=_numbers(middle),
        up=_numbers(above),
        floor=f"{FLOOR * surface.diagonal:.6g}",
        ground=_numbers(ground),
        above=_numbers(ground + surface.diagonal * above),
        aside=_numbers(across),
    )
    (folder / SCENE).write_text(text, encoding="utf-8")


def make_atlas(radiance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Draw each triangle into a place of its own.

    Parameters
    ----------
    radiance : (m, 3, 3) ndarray
        Red, green and blue at the corners of each triangle.

    Returns
    -------
    image : (s, s, 3) ndarray
        Linear between the corners of each triangle.
    places : (m, 3, 2) ndarray
        The corners in it, u to the right and v downwards, 0 to 1.
    """
    number = np.arange(len(radiance))
    half = number % 2
    across = math.ceil(math.sqrt((len(radiance) + 1) // 2))
    cell = CELL * np.column_stack([(number // 2) % across, (number // 2) // across])
    side = CELL * across
    image = np.zeros((side, side, 3))
    for kind, corners in enumerate(CORNERS):
        for i, j in np.ndindex(CELL, CELL):
            second, third = abs(i - corners[0, 0]) / 2, abs(j - corners[0, 1]) / 2
            if second + third > 1.5:
                continue
            shares = np.array([1 - second - third, second, third])
            chosen = half == kind
            column, row = (cell[chosen] + [i, j]).T
            image[row, column] = np.maximum(np.einsum("k,mkc->mc", shares, radiance[chosen]), 0.0)
    return image, (cell[:, None] + CORNERS[half] + 0.5) / side


def _numbers(vector: FloatArray) -> str:
    return ", ".join(f"{value:.6g}" for value in vector)
