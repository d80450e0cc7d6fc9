"""`compare_results`: two finished runs side by side, and their difference, on one scale."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image

from tetlux.cases.hints import did_you_mean
from tetlux.cases.picture.draw import PictureScene, canvas_of, replacing, scene_stage
from tetlux.cases.picture.scale import Scale, scale_of
from tetlux.cases.results.load import RunResult, load_result
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray, Vector
from tetlux.meshing.describe import percent
from tetlux.meshing.errors import InputError
from tetlux.meshing.search.closest import ClosestPoint
from tetlux.meshing.surface.triangles import barycentric_on_triangles, triangle_areas

# Of each of the pictures side by side, pixels.
SIZE = (900, 800)
# Bodies are one if this share of the vertices of one is nearer to the other than this share of the diagonal.
SHARE, NEAR = 0.95, 0.01
# Differences are relative where the values are above this share of the largest.
FLOOR = 1e-6
# The colours of differences reach this quantile of them, and at least this.
REACH, LEAST = 0.98, 1e-3
FIELD = "exitance"
# Fields on a linear scale.
LINEAR = ("valid", "phase")


@dataclass(frozen=True, eq=False)
class Difference:
    """How one result differs from another, at the vertices of the first.

    Attributes
    ----------
    relative : (v,) ndarray
        ``(B - A) / A``, nan where it is too dark for a relative difference.
    l2 : float
        L2 norm of ``B - A`` over the surface, relative to that of ``A``.
    """

    relative: FloatArray
    l2: float


def compare_results(first: Path, second: Path, picture: Path, field: str = FIELD) -> Iterator[str]:
    """Compare two finished runs: draw both and their difference, and say how they differ.

    Parameters
    ----------
    first, second : Path
        The folders of the runs.
    picture : Path
        The PNG to write.
    field : str
        An array of ``surface.ply``.

    Yields
    ------
    str
        Lines of figures.

    Raises
    ------
    InputError
        If a run is missing, has no surface or no such field, or the two differ in unit.
    OSError
        If the picture cannot be written.
    """
    a, b = (load_result(folder) for folder in (first, second))
    values = field_values(a, field), field_values(b, field)
    if a.summary["unit"] != b.summary["unit"]:
        raise InputError(f"{first} is in {a.summary['unit']}, {second} in {b.summary['unit']}; run both in one unit.")
    found = difference(a, b, *values)
    yield from _figures(a, b)
    if found is None:
        yield "the bodies differ: there is no difference of their surfaces."
    else:
        known = np.abs(found.relative[np.isfinite(found.relative)])
        yield f"{field}: B - A is {percent(found.l2)} of A in the L2 norm"
        if len(known):
            middle, most = np.quantile(known, [0.5, 0.95])
            yield f"{field}: vertex by vertex {percent(middle)} in the median, {percent(most)} at the 95th percentile"
    _draw(a, b, values, found, field, picture)
    yield f"written to {picture}"


def difference(a: RunResult, b: RunResult, of_a: FloatArray, of_b: FloatArray) -> Difference | None:
    """The difference at the vertices of A; None if the surfaces are not those of one body."""
    (points, triangles), (others, others_triangles) = _mesh(a), _mesh(b)
    places, faces = ClosestPoint(others, others_triangles)(points)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    back, _ = ClosestPoint(points, triangles)(others)
    near: BoolArray = np.linalg.norm(places - points, axis=1) < NEAR * diagonal
    near_back: BoolArray = np.linalg.norm(back - others, axis=1) < NEAR * diagonal
    if min(near.mean(), near_back.mean()) < SHARE:
        return None
    corners = others_triangles[faces]
    weights = barycentric_on_triangles(places, others[corners])
    there = (weights * of_b[corners]).sum(axis=1)
    bright = np.abs(of_a) > FLOOR * np.nanmax(np.abs(of_a), initial=0.0)
    relative = np.where(bright, there / np.where(bright, of_a, 1.0) - 1.0, np.nan)
    shares = np.repeat(triangle_areas(points, triangles)[1] / 3.0, 3)
    areas = np.bincount(triangles.ravel(), shares, len(points))
    size = float(areas @ np.nan_to_num(of_a) ** 2)
    return Difference(relative, float(np.sqrt(areas @ np.nan_to_num(there - of_a) ** 2 / size)) if size else np.nan)


def _mesh(result: RunResult) -> tuple[FloatArray, IntArray]:
    """Vertices and triangles of a surface."""
    assert result.points is not None
    assert result.triangles is not None
    return np.asarray(result.points, dtype=np.float64), np.asarray(result.triangles, dtype=np.int64)


def field_values(result: RunResult, field: str) -> FloatArray:
    """The array of a surface, (v,).

    Raises
    ------
    InputError
        If the run has no surface or no such array.
    """
    if result.points is None:
        raise InputError(f"{result.folder} holds no surface; run its case with outputs: [surface].")
    if field not in result.values:
        names = [name for name, values in result.values.items() if np.asarray(values).ndim == 1]
        hint = did_you_mean(field, names)
        raise InputError(f'{result.folder} has no field "{field}"; {hint}its fields are {", ".join(names)}.')
    return np.asarray(result.values[field], dtype=float)


def _figures(a: RunResult, b: RunResult) -> Iterator[str]:
    """Power and readings of both, a line each."""
    yield f"{'':28} {'A':>12} {'B':>12}   B - A"
    of_b = {channel["name"]: channel for channel in b.summary["channels"]}
    for channel in a.summary["channels"]:
        other = of_b.get(channel["name"])
        if other is None:
            continue
        name = "" if len(a.summary["channels"]) == 1 else f", {channel['name']}"
        for part in ("incident", "absorbed", "exited"):
            yield _line(f"{part} power{name}, W", channel["power"][part], other["power"][part])
        yield _line(f"largest exitance{name}", channel["exitance"]["max"], other["exitance"]["max"])
    read = {(row["detector"], row["channel"], row["light"]): row["exitance"] for row in b.readings}
    for row in a.readings:
        key = (row["detector"], row["channel"], row["light"])
        if key in read:
            parts = [each for each in key if each != "all"]
            yield _line(", ".join(parts), row["exitance"], read[key])


def _line(name: str, a: float, b: float) -> str:
    change = f"{100 * (b / a - 1):+.2f} %" if a else ""
    return f"{name:28} {a:12.5g} {b:12.5g}   {change}"


def _draw(
    a: RunResult,
    b: RunResult,
    values: tuple[FloatArray, FloatArray],
    found: Difference | None,
    field: str,
    path: Path,
) -> None:
    """Draw both from one side on one scale, and beside them the difference in per cent."""
    scale = common_scale(values, field, a.summary["unit"])
    first = scene_of_result(a, values[0], f"A: {a.summary['case']}")
    toward = scene_stage(first).camera.toward
    scenes = [replace(first, scale=scale, toward=toward)]
    scenes.append(replace(scene_of_result(b, values[1], f"B: {b.summary['case']}"), scale=scale, toward=toward))
    if found is not None:
        known = np.abs(found.relative[np.isfinite(found.relative)])
        reach = 100 * max(float(np.quantile(known, REACH)) if len(known) else 0.0, LEAST)
        shades = scale_of(
            100 * found.relative, "B - A", "% of A", logarithmic=False, ends=(-reach, reach), colour_map="blue-red"
        )
        scenes.append(replace(scenes[0], title="difference", values=100 * found.relative, scale=shades))
    images = [canvas_of(scene).image for scene in scenes]
    whole = Image.new("RGB", (sum(each.width for each in images), SIZE[1]))
    for number, image in enumerate(images):
        whole.paste(image, (number * SIZE[0], 0))
    with replacing(path) as unfinished:
        whole.save(unfinished, format="PNG")


def common_scale(values: Sequence[FloatArray], field: str, unit: str) -> Scale:
    """One scale for the values of a field in several results; `unit` is that of length."""
    quantity = field.partition("_")[0]
    name = {"exitance": f"W/{unit}²", "phase": "degrees"}.get(quantity, "")
    return scale_of(np.concatenate(values), field, name, logarithmic=quantity not in LINEAR)


def scene_of_result(result: RunResult, values: FloatArray, title: str) -> PictureScene:
    """A finished run in the colours of values at the vertices of its surface."""
    x, y, z = result.summary["as_ran"]["scene"]["up"]
    up: Vector = (float(x), float(y), float(z))
    return PictureScene(*_mesh(result), values, result.summary["unit"], title, up=up, values=values, size=SIZE)
