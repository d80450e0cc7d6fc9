"""`write_viewer`: one page that shows a run, with all that it needs inside it."""

import json
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from tetlux.cases.picture.colour_maps import hexadecimal_map
from tetlux.cases.picture.draw import PictureScene
from tetlux.cases.picture.scale import exitance_range, linear_range
from tetlux.cases.picture.stage import arrow_ends, choose_camera
from tetlux.cases.picture.view import PANEL
from tetlux.cases.plain import finite
from tetlux.cases.viewer.pack import pack_bytes, pack_floats, pack_indices
from tetlux.cases.write.fields import Field, surface_fields, volume_fields
from tetlux.cases.write.pulse import PulseResults
from tetlux.cases.write.results import Results
from tetlux.meshing.arrays import FloatArray

HERE = Path(__file__).parent
# Colour maps to choose from, that of the pictures first.
MAPS = ("inferno", "viridis", "grey")
# Values of light in time, at vertices and times together: some 3 MB.
MOST_IN_TIME = 1_000_000


def write_viewer(
    results: Results,
    readings: Sequence[dict[str, Any]],
    scene: PictureScene,
    path: Path,
    pulse: PulseResults | None = None,
) -> None:
    """Write a page that shows a run and asks nothing of any server.

    Parameters
    ----------
    results : Results
    readings : sequence of dict
        What the detectors read.
    scene : PictureScene
        What the picture of the run shows: the page begins with its view.
    path : Path
        The file to write.
    pulse : PulseResults, optional
        Light in time, of which the page shows as many times as there is room for.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    data = {**describe_scene(results, readings, scene), **_in_time(pulse, scene.unit)}
    # In a script of HTML, "<" could begin its end.
    text = json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")
    page = (HERE / "page.html").read_text(encoding="utf-8")
    script = (HERE / "viewer.min.js").read_text(encoding="utf-8")
    parts = {"TITLE": escape(scene.title), "DATA": text, "SCRIPT": script}
    path.write_text("".join(_filled(page, parts)), encoding="utf-8")


def _filled(page: str, parts: dict[str, str]) -> Iterator[str]:
    """The page with each of the words in double braces replaced once; what replaces them is not searched."""
    for name, text in parts.items():
        before, _, page = page.partition(f"{{{{{name}}}}}")
        yield before
        yield text
    yield page


def describe_scene(results: Results, readings: Sequence[dict[str, Any]], scene: PictureScene) -> dict[str, Any]:
    """What the page shows, as plain data: arrays packed, positions relative to `origin`."""
    low, high = scene.points.min(axis=0), scene.points.max(axis=0)
    origin = 0.5 * (low + high)
    return {
        "title": scene.title,
        "unit": scene.unit,
        "origin": origin.tolist(),
        "extent": (high - low).tolist(),
        "up": list(scene.up),
        "camera": _camera(scene, origin),
        "points": pack_floats(scene.points - origin),
        "triangles": pack_indices(scene.triangles),
        "fields": [_field(field) for field in surface_fields(results)],
        **_colours(scene),
        **_volume(results, origin),
        "lights": _lights(scene, origin),
        "detectors": _detectors(readings, origin),
        "regions": [
            {
                "name": region.name,
                "points": pack_floats(region.points - origin),
                "triangles": pack_indices(region.triangles),
            }
            for region in scene.regions
        ],
        "errors": _errors(results),
        "maps": {name: hexadecimal_map(name) for name in MAPS},
    }


def _camera(scene: PictureScene, origin: FloatArray) -> dict[str, Any]:
    camera = choose_camera(
        scene.points, scene.triangles, scene.exitance, scene.lights, up=scene.up, toward=scene.toward
    )
    return {
        "right": camera.right.tolist(),
        "up": camera.up.tolist(),
        "toward": camera.toward.tolist(),
        "center": (camera.center - origin).tolist(),
        "width": PANEL[0] * camera.pixel,
        "height": PANEL[1] * camera.pixel,
    }


def _field(field: Field) -> dict[str, Any]:
    return {
        "quantity": field.quantity,
        "unit": field.unit,
        "channel": field.channel,
        "light": field.light,
        "logarithmic": field.logarithmic,
        "ends": _ends(field),
        "values": pack_floats(field.values),
    }


def _in_time(pulse: PulseResults | None, unit: str) -> dict[str, Any]:
    """The exitance at times after a pulse, if there is one, all on one scale, with what detectors read then."""
    if pulse is None:
        return {}
    most = max(2, MOST_IN_TIME // pulse.exitance.shape[1])
    fields = []
    for (time, values), readings in zip(pulse.some(most), pulse.some_readings(most), strict=True):
        field = _field(Field("pulse", values, f"W/{unit}²/J"))
        known = {name: finite(value) for name, value in readings.items()}
        fields.append({**field, "ends": pulse.ends(), "time": time, "readings": known})
    return {"inTime": fields}


def _ends(field: Field) -> tuple[float, float] | None:
    """The ends of the colours at first: of `valid`, a share, from 0 to 1."""
    if field.logarithmic:
        return exitance_range(field.values)
    return (0.0, 1.0) if field.quantity == "valid" else linear_range(field.values)


def _colours(scene: PictureScene) -> dict[str, Any]:
    """Colours of the vertices, if the picture has such in place of a colour map."""
    if scene.colours is None:
        return {}
    colours, white = scene.colours
    return {"colours": {"white": white, "values": pack_bytes(colours)}}


def _volume(results: Results, origin: FloatArray) -> dict[str, Any]:
    """The mesh and its fluence, if the run writes its volume."""
    if "volume" not in results.case.outputs:
        return {}
    mesh = results.mesh_solutions[0].mesh
    return {
        "volume": {
            "points": pack_floats(mesh.points - origin),
            "tetrahedra": pack_indices(mesh.tetrahedra),
            "fields": [_field(field) for field in volume_fields(results)],
        }
    }


def _lights(scene: PictureScene, origin: FloatArray) -> dict[str, Any]:
    diagonal = float(np.linalg.norm(np.ptp(scene.points, axis=0)))
    arrows = [arrow_ends(ray, diagonal) for ray in scene.lights if not ray.is_point]
    return {
        "arrows": [[(tail - origin).tolist(), (tip - origin).tolist()] for tail, tip in arrows],
        "points": [(np.array(ray.end) - origin).tolist() for ray in scene.lights if ray.is_point],
    }


def _detectors(readings: Sequence[dict[str, Any]], origin: FloatArray) -> list[dict[str, Any]]:
    """The detectors with what they read in each channel and of each light."""
    found: dict[str, dict[str, Any]] = {}
    for row in readings:
        place = (np.array(row["position"]) - origin).tolist()
        detector = found.setdefault(row["name"], {"name": row["name"], "place": place, "readings": []})
        detector["readings"].append(
            {
                "channel": row["channel"],
                "light": row["light"],
                "exitance": row["exitance"],
                "error": finite(row["relative_error"]),
            }
        )
    return list(found.values())


def _errors(results: Results) -> list[dict[str, Any]]:
    """Relative numerical errors of each channel: of the whole exitance, and of that at almost every point."""
    return [
        {
            "channel": channel.name,
            "whole": finite(solution.error_estimate),
            "everywhere": finite(getattr(solution, "everywhere_error", None)),
        }
        for channel, solution in zip(results.case.channels, results.solutions, strict=True)
    ]
