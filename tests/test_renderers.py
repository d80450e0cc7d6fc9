"""What 3D programs, renderers and papers take: surface.glb, the emitter for Mitsuba, figures."""

import json
import re
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from tetlux.cases.file.colours import to_linear
from tetlux.cases.file.load import load_cases
from tetlux.cases.picture.colour_maps import color_table
from tetlux.cases.renderers.mitsuba import make_atlas
from tetlux.cases.run import run_case
from tetlux.meshing.arrays import FloatArray

CASE = """\
name: ball
surface: {sphere: {radius: 10}}
up: [0, 1, 0]
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights: [{point: {position: [3, 0, 5], power: 1.0}}]
model: closed-form
outputs: [surface, glb, mitsuba, figures]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("renderers")
    (folder / "ball.yaml").write_text(CASE)
    (case,) = load_cases(folder / "ball.yaml")
    return run_case(case, folder / "out")


@pytest.fixture(scope="module")
def exitance(folder: Path) -> FloatArray:
    return np.asarray(meshio.read(folder / "surface.ply").point_data["exitance"], dtype=float)


def parts_of(path: Path) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """The scene in a GLB, and the arrays of its triangles."""
    data = path.read_bytes()
    assert data[:4] == b"glTF"
    length = int(np.frombuffer(data, "<u4", 1, 12)[0])
    scene = json.loads(data[20 : 20 + length])
    binary = data[20 + length + 8 :]
    arrays = {}
    for name, index in scene["meshes"][0]["primitives"][0]["attributes"].items():
        accessor = scene["accessors"][index]
        start = scene["bufferViews"][accessor["bufferView"]]["byteOffset"]
        width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        arrays[name] = np.frombuffer(binary, "<f4", accessor["count"] * width, start).reshape(-1, width).squeeze()
    return scene, arrays


def test_glb_has_the_colours_of_the_picture_in_linear_light(folder: Path, exitance: FloatArray) -> None:
    scene, arrays = parts_of(folder / "surface.glb")
    np.testing.assert_allclose(arrays["_EXITANCE"], exitance, rtol=1e-6)
    shares = np.log(exitance / exitance.min()) / np.log(exitance.max() / exitance.min())
    colours = color_table()[np.minimum((256 * shares).astype(int), 255)]
    np.testing.assert_allclose(arrays["COLOR_1"], colours, atol=0.02)
    np.testing.assert_allclose(arrays["COLOR_0"], to_linear(arrays["COLOR_1"].astype(float)), atol=1e-6)
    assert scene["materials"][0]["extensions"] == {"KHR_materials_unlit": {}}
    # Blender 4.5 mixes up several arrays of names of one's own.
    assert [name for name in arrays if name.startswith("_")] == ["_EXITANCE"]


def test_glb_is_in_metres_and_upright(folder: Path) -> None:
    loaded: Any = trimesh.load(folder / "surface.glb", force="mesh")
    np.testing.assert_allclose(loaded.bounds, [[-0.01] * 3, [0.01] * 3], atol=2e-4)
    assert loaded.volume == pytest.approx(4 / 3 * np.pi * 1e-6, rel=0.01)
    scene, _ = parts_of(folder / "surface.glb")
    matrix = np.array(scene["nodes"][0]["matrix"]).reshape(4, 4).T[:3, :3]
    # y of the case stays up, and x stays to the right.
    np.testing.assert_allclose(matrix, 1e-3 * np.eye(3), atol=1e-12)


def test_the_image_of_an_emitter_is_linear_on_each_triangle() -> None:
    corners = np.random.default_rng(1).uniform(1, 2, (7, 3, 3))
    image, places = make_atlas(corners)
    side = len(image)
    for shares in np.random.default_rng(2).dirichlet([1, 1, 1], 20):
        x, y = (np.einsum("k,mkc->mc", shares, places) * side - 0.5).T
        i, j = np.clip(np.floor(x).astype(int), 0, side - 2), np.clip(np.floor(y).astype(int), 0, side - 2)
        a, b = (x - i)[:, None], (y - j)[:, None]
        found = (1 - b) * ((1 - a) * image[j, i] + a * image[j, i + 1]) + b * (
            (1 - a) * image[j + 1, i] + a * image[j + 1, i + 1]
        )
        np.testing.assert_allclose(found, np.einsum("k,mkc->mc", shares, corners), rtol=1e-9)


def test_an_emitter_radiates_the_power_that_leaves(folder: Path, exitance: FloatArray) -> None:
    emitter = meshio.read(folder / "emitter.ply")
    triangles = emitter.points[emitter.cells_dict["triangle"]]
    areas = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    radiance = np.asarray(emitter.point_data["g"]).reshape(-1, 3).mean(axis=1)
    exited = json.loads((folder / "summary.json").read_text())["channels"][0]["power"]["exited"]
    assert np.pi * areas @ radiance == pytest.approx(exited, rel=0.01)
    header, size, scale, data = (folder / "emitter.pfm").read_bytes().split(b"\n", 3)
    assert (header, scale) == (b"PF", b"-1.0")
    side = int(size.split()[0])
    image = np.frombuffer(data, "<f4").reshape(side, side, 3)[::-1]
    u, v = (np.asarray(emitter.point_data[name]) for name in "uv")
    at = image[np.floor(v * side).astype(int), np.floor(u * side).astype(int)]
    np.testing.assert_allclose(at[:, 0], emitter.point_data["r"], rtol=1e-5)


def test_mitsuba_sees_the_exitance(folder: Path, exitance: FloatArray) -> None:
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    image = np.array(mitsuba.render(mitsuba.load_file(str(folder / "mitsuba.xml")), spp=1))
    seen = image[:, :, 1][image[:, :, 1] > 0.5 * exitance.min() / np.pi]
    assert np.quantile(seen, 0.999) < 1.01 * exitance.max() / np.pi
    # The middle of the picture is the body.
    middle = image[300, 400]
    assert exitance.min() / np.pi < middle[1] < exitance.max() / np.pi
    np.testing.assert_allclose(middle, middle[0], rtol=1e-4)


def test_figures_show_exitance_and_power(folder: Path) -> None:
    text = (folder / "figures.svg").read_text()
    for words in ("distance from the light, mm", "mean exitance, W/mm", "exited", "share of the incident power, %"):
        assert words in text
    exited = json.loads((folder / "summary.json").read_text())["channels"][0]["power"]["exited"]
    assert f"{100 * exited:.3g} %" in text
    assert len(re.findall("<use", text)) > 30
    assert (folder / "figures.pdf").read_bytes()[:5] == b"%PDF-"


def test_the_mean_exitance_by_distance_is_that_of_the_rings(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tetlux.cases.solve import solve_case  # noqa: PLC0415
    from tetlux.cases.write import figures  # noqa: PLC0415
    from tetlux.cases.write.figures import RINGS, exitance_by_distance  # noqa: PLC0415
    from tetlux.cases.write.results import collect_results  # noqa: PLC0415

    (case,) = load_cases(folder.parent.parent / "ball.yaml")
    results = collect_results(case, solve_case(case, lambda _: None, cache=False))
    distances, means = exitance_by_distance(results, np.array([[3.0, 0.0, 5.0]]))
    assert len(distances) == RINGS - int(RINGS * (10 - np.hypot(3, 5)) / (10 + np.hypot(3, 5)))
    assert (np.diff(means["all"]) < 0).all()
    axis = np.array([3.0, 0.0, 5.0]) / np.hypot(3, 5)
    near, far = results.solutions[0].exitance_at(np.array([10 * axis, -10 * axis]))
    assert means["all"][0] == pytest.approx(near, rel=0.2)
    assert means["all"][-1] == pytest.approx(far, rel=0.1)
    # The axis ends with the part of the curve that is drawn.
    monkeypatch.setattr(figures, "FLOOR", 0.1)
    axes = Figure().subplots()
    figures._draw_exitance(axes, results, np.array([[3.0, 0.0, 5.0]]))
    last = distances[means["all"] >= 0.1 * means["all"].max()][-1]
    assert last < axes.get_xlim()[1] < 1.1 * last < distances[-1]
