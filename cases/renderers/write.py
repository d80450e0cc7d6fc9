"""`write_for_renderers`: the files of a run that 3D programs and renderers read."""

from pathlib import Path

import numpy as np

from tetlux.cases.file.colours import RGB
from tetlux.cases.picture.draw import PictureScene, scene_stage, vertex_colours
from tetlux.cases.renderers.glb import write_glb
from tetlux.cases.renderers.mitsuba import write_mitsuba
from tetlux.cases.write.results import Results


def write_for_renderers(results: Results, scene: PictureScene, folder: Path) -> None:
    """Write ``surface.glb`` and the emitter for Mitsuba, as far as the case asks for them."""
    case = results.case
    if "glb" in case.outputs:
        notes = {"case": case.name, "units": f"lengths in m, _EXITANCE in W/{scene.unit}^2"}
        colours = vertex_colours(scene)
        write_glb(results.surface, folder / "surface.glb", colours, scene.exitance, case.up, notes)
    if "mitsuba" in case.outputs:
        channels = [results.exitance(name) for name in RGB] if results.has_colours else [scene.exitance] * 3
        toward = scene_stage(scene).camera.toward
        write_mitsuba(results.surface, folder, np.column_stack(channels), toward, case.up, case.name)
