"""From where a picture is taken, and what is drawn over the body: regions, detectors, arrows that hide nothing."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.cases.picture import draw as picture
from tetlux.cases.picture.canvas import Canvas
from tetlux.cases.picture.draw import PictureScene, Ray, RegionOutline, draw_picture
from tetlux.cases.picture.frame import LEFT, TOP
from tetlux.cases.picture.marks import Marks, draw_marks
from tetlux.cases.picture.shading import draw_stage
from tetlux.cases.picture.stage import (
    ARROW_OPACITY,
    LIGHT,
    SHADED,
    build_stage,
)
from tetlux.cases.picture.view import PANEL, Camera, camera_at, choose_view, direction_of, upright_axes
from tetlux.cases.run import run_case
from tetlux.cases.write import pictures
from tetlux.meshing import InputError, box, sphere
from tetlux.meshing.arrays import FloatArray, Vector

CASE = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights: [{diffuse: {irradiance: 1}}]
tolerance: 0.5
outputs: [picture]
"""
Z, Y, X = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)


@pytest.fixture
def _grey(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is drawn over the body is easier to see over one that is grey all over."""
    image = np.full((PANEL[1], PANEL[0], 3), 150, dtype=np.uint8)
    monkeypatch.setattr(picture, "draw_stage", lambda _: image)


def case_of(more: str, folder: Path) -> Case:
    (folder / "case.yaml").write_text(CASE + more)
    (case,) = load_cases(folder / "case.yaml")
    return case


def pixels(path: Path) -> FloatArray:
    """The panel of a picture."""
    with Image.open(path) as image:
        whole = np.asarray(image.convert("RGB"), dtype=np.float64)
    return whole[TOP : TOP + PANEL[1], LEFT : LEFT + PANEL[0]]


@pytest.mark.parametrize("up", [Z, Y, X, (0.0, 0.0, -1.0), (0.0, -2.0, 0.0), (1.0, 1.0, 1.0)])
@pytest.mark.parametrize("light", [Z, Y, X, (0.0, 0.0, -1.0), (0.3, -0.5, 0.8)])
def test_up_is_upright_whatever_the_light(up: Vector, light: Vector) -> None:
    ball = sphere(10.0, subdivisions=1)
    ray = Ray(tuple(20 * np.array(light)), tuple(10 * np.array(light)))
    corners, above = ball.points[ball.faces], np.array(up) / np.linalg.norm(up)
    toward = choose_view(corners, np.ones(len(corners)), (ray,), ball.diagonal, up)
    camera = camera_at(ball.points, toward, up)
    assert camera.up @ above > 0.3
    assert abs(camera.right @ above) < 1e-12
    np.testing.assert_allclose(np.cross(camera.right, camera.up), camera.toward, atol=1e-12)


def test_angles_are_counted_from_x_anticlockwise_seen_from_above() -> None:
    for up in (Z, Y, X, (1.0, 2.0, 3.0)):
        axes = upright_axes(up)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_allclose(direction_of(0, 0, Z), X, atol=1e-12)
    np.testing.assert_allclose(direction_of(90, 0, Z), Y, atol=1e-12)
    np.testing.assert_allclose(direction_of(-90, 90, Z), Z, atol=1e-12)
    # The front of a model whose y is up.
    np.testing.assert_allclose(direction_of(-90, 0, Y), Z, atol=1e-12)
    np.testing.assert_allclose(direction_of(0, 30, Y), [np.cos(np.pi / 6), 0.5, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "toward"),
    [
        ("", None),
        ("up: [0, 1, 0]\n", None),
        ("camera: {azimuth: 0, elevation: 0}\n", X),
        ("camera: {azimuth: 90}\n", (0.0, np.cos(np.pi / 9), np.sin(np.pi / 9))),
        ("up: [0, 3, 0]\ncamera: {azimuth: -90, elevation: 0}\n", Z),
        ("camera: {position: [0, -30, 0]}\n", (0.0, -1.0, 0.0)),
        ("camera: {position: [0, 0, 30]}\n", Z),
    ],
)
def test_the_case_file_turns_the_picture(keys: str, toward: Vector | None, tmp_path: Path) -> None:
    case = case_of(keys, tmp_path)
    if toward is None:
        assert case.toward is None
    else:
        assert case.toward == pytest.approx(np.array(toward), abs=1e-12)
    assert case.up[1] == (1 if "[0, 1" in keys else 3 if "[0, 3" in keys else 0)
    # Radiance is that towards a place; two angles name none.
    assert (case.camera is not None) == ("position" in keys)


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ("camera: {}", "camera: give position or azimuth, not neither"),
        ("camera: {azimuth: 3, position: [0, 0, 30]}", "camera: give position or azimuth, not both"),
        ("camera: {elevation: 3, position: [0, 0, 30]}", "camera: elevation goes with azimuth"),
        ("camera: {azimuth: 3, elevation: 91}", "camera.elevation: expected a number less than or equal to 90"),
        ("camera: {position: [0, 0, 3]}", "camera.position: the camera is inside the body"),
        ("up: [0, 0, 0]", "line 6: up: up"),
        ("up: y", "up: write the axis as a vector, [0, 1, 0]"),
    ],
)
def test_a_wrong_view_gets_one_sentence(keys: str, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        case_of(keys + "\n", tmp_path)
    assert sentence in str(error.value)


def test_a_ring_may_be_seen_from_its_middle(tmp_path: Path) -> None:
    """No side of it is, and the light chooses."""
    (tmp_path / "ring.yaml").write_text(
        CASE.replace("sphere: {radius: 10}", "torus: {major: 10, minor: 3}") + "camera: {position: [0, 0, 0]}\n"
    )
    (case,) = load_cases(tmp_path / "ring.yaml")
    assert case.camera == (0.0, 0.0, 0.0)
    assert case.toward is None


def test_from_right_above_x_runs_to_the_right() -> None:
    camera = camera_at(sphere(1.0, subdivisions=1).points, np.array(Z), Z)
    np.testing.assert_allclose([camera.right, camera.up], [X, Y], atol=1e-12)


def cube_from_the_front(**more: Any) -> PictureScene:
    """A cube of 10 mm that looks the same everywhere, seen from -y."""
    cube = box((10.0, 10.0, 10.0))
    return PictureScene(cube.points, cube.faces, np.ones(8), "mm", "cube", toward=np.array([0.0, -1.0, 0.0]), **more)


def front_camera() -> Camera:
    return camera_at(box((10.0, 10.0, 10.0)).points, np.array([0.0, -1.0, 0.0]), Z)


@pytest.mark.usefixtures("_grey")
def test_regions_are_outlined_and_named(tmp_path: Path) -> None:
    ball = sphere(2.5, center=(1.0, 0.0, 0.0))
    draw_picture(
        cube_from_the_front(regions=(RegionOutline("core", ball.points, ball.faces),)), tmp_path / "outlined.png"
    )
    changed = np.abs(pixels(tmp_path / "outlined.png") - 150).max(axis=2)
    camera = front_camera()
    (middle,) = camera.project(np.array([[1.0, 0.0, 0.0]]))[:, :2]
    rows, columns = np.nonzero(changed > 60)
    radius = np.hypot(columns + 0.5 - middle[0], rows + 0.5 - middle[1]) * camera.pixel
    # All round the ball a line, and the name above it.
    line = np.abs(radius - 2.5) < 4 * camera.pixel
    angles = np.degrees(np.arctan2(rows[line] - middle[1], columns[line] - middle[0]))
    assert len(np.unique(np.round(angles / 10))) == 37
    assert (radius[~line] > 2.5).all()
    assert (rows[~line] < middle[1] - 2.5 / camera.pixel).all()
    assert 100 < len(rows[~line]) < 2000
    # Within it the body is seen through a faint tint.
    assert 5 < changed[int(middle[1]), int(middle[0])] < 30


@pytest.mark.usefixtures("_grey")
def test_detectors_are_dots_with_names_and_those_behind_the_body_are_hollow(tmp_path: Path) -> None:
    camera = front_camera()
    places: dict[str, Vector] = {"front": (-2.0, -5.0, 1.0), "back": (3.0, 5.0, -2.0)}
    draw_picture(cube_from_the_front(detectors=tuple(places.items())), tmp_path / "marked.png")
    marked = pixels(tmp_path / "marked.png")
    for name, place in places.items():
        (x, y) = camera.project(np.array([place]))[0, :2].astype(int)
        assert (marked[y, x] == 255).all() == (name == "front")
        assert (marked[y, x] == 150).all() == (name == "back")
        # A ring round it, and its name to the right.
        assert np.abs(marked[y, x - 8 : x + 9] - 150).max() > 40
        assert np.abs(marked[y - 8 : y + 8, x + 15 : x + 50] - 150).max() > 100


@pytest.mark.usefixtures("_grey")
def test_names_do_not_cover_each_other_and_are_left_out_where_there_is_no_room(tmp_path: Path) -> None:
    row = tuple((f"detector_{i}", (0.05 * i, -5.0, 0.0)) for i in range(60))
    draw_picture(cube_from_the_front(detectors=row), tmp_path / "row.png")
    dark = (pixels(tmp_path / "row.png") < 60).all(axis=2)
    # Sixty names would need some 60 * 12 * 50 pixels of ink.
    assert 500 < dark.sum() < 15_000


def test_an_arrow_does_not_hide_what_it_lights() -> None:
    cube = box((10.0, 10.0, 10.0))
    # It comes from above to the middle of the face, all of it in front of the body.
    ray = Ray((0.0, -9.0, 6.0), (0.0, -5.0, 0.0))
    toward = np.array([0.0, -1.0, 0.0])
    stage = build_stage(cube.points, cube.faces, np.ones(8), (ray,), toward=toward)
    lit = draw_stage(stage).astype(np.float64)
    bare = draw_stage(replace(stage, arrows=np.empty((0, 3, 3)), arrow_normals=np.empty((0, 3, 3))))
    over = (np.abs(lit - bare) > 3).any(axis=2)
    assert 500 < over.sum() < 0.01 * over.size
    # What is seen is half the face, of one colour, and half the arrow, whose colours are LIGHT's, shaded.
    (face,) = np.unique(bare[over], axis=0)
    arrow = (lit[over] - (1 - ARROW_OPACITY) * face) / ARROW_OPACITY / (255 * np.array([1.0, *LIGHT[1:]]))
    inner = np.abs(arrow[:, 0]) < 0.01
    # Measured 0.97; in the pixels on its outline there is more of the face.
    assert inner.mean() > 0.9
    assert arrow[inner, 1:].min() > SHADED - 0.02
    assert arrow[inner, 1:].max() < 1.02


def test_light_along_the_line_of_sight_is_a_ring_with_a_cross(tmp_path: Path) -> None:
    front, back = Ray((0.5, -15.0, 0.5), (0.0, -5.0, 0.0)), Ray((2.0, 15.0, 0.0), (2.0, 5.0, 0.0))
    shown = []
    for lights in ((), (front, back)):
        draw_picture(cube_from_the_front(lights=lights), tmp_path / "cube.png")
        shown.append(pixels(tmp_path / "cube.png"))
    rows, columns = np.nonzero((np.abs(shown[1] - shown[0]) > 3).any(axis=2))
    x, y = front_camera().project(np.array([front.end]))[0, :2]
    # One mark, of the beam that is seen, which leaves most of what it lights free: an arrow covers all of the middle.
    assert (np.hypot(columns + 0.5 - x, rows + 0.5 - y) < 18).all()
    assert 300 < len(rows) < 750
    quarters = {(bool(c > x), bool(r > y)) for c, r in zip(columns, rows, strict=True)}
    assert len(quarters) == 4


def test_arrows_in_front_of_nothing_are_solid() -> None:
    cube = box((10.0, 10.0, 10.0))
    # Beside the cube; another marks the other side, so that the first lies within the panel.
    rays = (Ray((8.0, -9.0, 0.0), (6.0, -9.0, 0.0)), Ray((-8.0, -9.0, 0.0), (-6.0, -9.0, 0.0)))
    stage = build_stage(cube.points, cube.faces, np.ones(8), rays, toward=np.array([0.0, -1.0, 0.0]))
    lit = draw_stage(stage).astype(np.float64)
    # The arrow's own colour, without red, is shaded and not mixed with the ground.
    arrow = lit[..., 0] < 1.0
    assert arrow.sum() > 300
    share = lit[arrow][:, 1:] / (255 * np.array(LIGHT[1:]))
    assert SHADED - 0.02 < share.min() <= share.max() < 1.02


def test_a_run_draws_its_regions_and_detectors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenes: list[PictureScene] = []

    def kept(scene: PictureScene, path: Path) -> None:
        scenes.append(scene)
        path.write_bytes(b"")

    monkeypatch.setattr(pictures, "draw_picture", kept)
    case = case_of(
        "up: [0, 1, 0]\ncamera: {azimuth: 10}\n"
        "regions: [{name: core, surface: {sphere: {radius: 4}}, medium: {sigma_a: 0.1, sigma_s_prime: 1, eta: 1.4}}]\n"
        "detectors: [{name: top, point: [0, 0, 10.2]}, {name: side, disc: {center: [10, 0, 0], radius: 1}}]\n",
        tmp_path,
    )
    run_case(case, tmp_path / "out")
    (scene,) = scenes
    assert scene.up == (0.0, 1.0, 0.0)
    assert scene.toward is case.toward
    assert [(region.name, len(region.triangles)) for region in scene.regions] == [("core", 5120)]
    assert [name for name, _ in scene.detectors] == ["top", "side"]
    # On the surface, where it is read.
    np.testing.assert_allclose(scene.detectors[0][1], [0, 0, 10], atol=0.05)


def _drawn_marks(name: str, region: str, arrows: FloatArray) -> FloatArray:
    """A dot at (100, 60) and a round region of 30 pixels radius around (100, 160), with their names, on white."""
    rows, columns = np.mgrid[:240, :200]
    coverage = (np.hypot(columns - 100, rows - 160) < 30).astype(float)
    canvas = Canvas((200, 240), (1.0, 1.0, 1.0))
    marks = Marks([(region, coverage)], [name], np.array([[100.0, 60.0]]), np.zeros(1, bool), np.empty((0, 2)), arrows)
    draw_marks(canvas, marks, 0, 0)
    return np.asarray(np.asarray(canvas.image, dtype=float).min(axis=2))


def test_names_of_detectors_leave_their_rings_free() -> None:
    plain, named = (_drawn_marks(name, "", np.empty((0, 2))) for name in ("", "10mmmm"))
    changed = np.argwhere(plain != named)[:, ::-1]
    assert len(changed) > 100
    assert np.linalg.norm(changed - [100, 60], axis=1).min() > 8.3


def test_names_of_regions_keep_off_arrows() -> None:
    arrow = np.column_stack([np.full(16, 100.0), np.linspace(100, 150, 16)])
    for arrows, above in ((np.empty((0, 2)), True), (arrow, False)):
        plain, named = (_drawn_marks("", region, arrows) for region in ("", "core"))
        rows = np.argwhere(plain != named)[:, 0]
        assert len(rows) > 50
        assert (rows.max() < 130) if above else (rows.min() > 190)
