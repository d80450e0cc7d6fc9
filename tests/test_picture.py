"""Pictures: what they show, and what happens when one cannot be written."""

import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image

from tetlux.cases.picture.canvas import Canvas
from tetlux.cases.picture.colour_maps import DARKEST, color_table
from tetlux.cases.picture.draw import PictureScene, Ray, draw_picture
from tetlux.cases.picture.frame import LEFT, TOP
from tetlux.cases.picture.rasterizer import visible_triangles
from tetlux.cases.picture.scale import bar_ticks, scale_of
from tetlux.cases.picture.shading import draw_stage, place_samples, samples_of
from tetlux.cases.picture.stage import (
    BACKGROUND,
    DARK,
    FULL,
    OVERSAMPLING,
    SHADED,
    build_stage,
    corner_normals,
)
from tetlux.cases.picture.view import PANEL, Camera
from tetlux.meshing import box, sphere, torus
from tetlux.meshing.arrays import FloatArray, Vector
from tetlux.meshing.search.rays import RayCaster
from tetlux.meshing.surface.surface import Surface


def lit(surface: Surface, entry: Vector, start: Vector) -> PictureScene:
    """A body that glows round an entry point, over more decades than are drawn."""
    distance = np.linalg.norm(surface.points - np.asarray(entry), axis=1)
    exitance = 0.1 * np.exp(-1.5 * distance) / (distance + 0.5)
    return PictureScene(surface.points, surface.faces, exitance, "mm", "a case", (Ray(start, entry),))


@pytest.fixture(scope="module")
def ball() -> PictureScene:
    # Its entry point is oblique to every axis, so that a mirrored picture would show.
    entry = (8.0, 0.0, 6.0)
    return lit(sphere(10.0, subdivisions=3), entry, (16.0, 0.0, 12.0))


def pixels(path: Path) -> FloatArray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"), dtype=np.float64)


def camera_of(scene: PictureScene) -> Camera:
    return build_stage(scene.points, scene.triangles, scene.exitance, scene.lights).camera


def brightest(image: FloatArray, camera: Camera, scene: PictureScene) -> tuple[FloatArray, FloatArray]:
    """Middle of the yellow pixels of the panel, and where the entry point should be, in pixels of the panel."""
    panel = image[TOP : TOP + PANEL[1], LEFT : LEFT + PANEL[0]]
    # Yellow, as no other colour of the picture: much green, and more of it than of blue.
    rows, columns = np.nonzero((panel[..., 1] > 170) & (panel[..., 1] > panel[..., 2] + 40))
    assert len(rows) > 50
    entry = camera.project(np.array([scene.lights[0].end]))[0, :2]
    return np.array([columns.mean(), rows.mean()]), entry


def test_brightest_colours_are_at_the_entry_point(ball: PictureScene, tmp_path: Path) -> None:
    target = tmp_path / "picture.png"
    draw_picture(ball, target)
    image = pixels(target)
    assert image.shape == (1050, 1400, 3)
    found, wanted = brightest(image, camera_of(ball), ball)
    # The arrow hides a part of the bright spot: measured 0.04 of the radius.
    radius = 10.0 / camera_of(ball).pixel
    assert np.linalg.norm(found - wanted) < 0.1 * radius
    assert [p.name for p in tmp_path.iterdir()] == ["picture.png"]


def test_rays_hit_the_triangles_that_are_visible() -> None:
    body = torus(10.0, 4.0, segments=48)
    scene = lit(body, (-14.0, 0.0, 0.0), (-30.0, 0.0, 0.0))
    camera = camera_of(scene)
    drawn = visible_triangles(place_samples(camera, body.points[body.faces]), samples_of(camera), closed=True)
    row, column = np.divmod(np.arange(17, drawn.owner.size, 997), samples_of(camera)[0])
    across, down = (column + 0.5) / OVERSAMPLING - 0.5 * PANEL[0], 0.5 * PANEL[1] - (row + 0.5) / OVERSAMPLING
    eye = camera.center + 100.0 * camera.toward
    origins = eye + camera.pixel * (across[:, None] * camera.right + down[:, None] * camera.up)
    distance, hit = RayCaster(body.points, body.faces).first(origins, np.broadcast_to(-camera.toward, origins.shape))
    owner, nearness = drawn.owner[row, column], drawn.nearness[row, column]
    # A ray through a common edge may hit either triangle: measured for none to 2 of some 1,000.
    assert ((hit < 0) == (owner < 0)).mean() > 0.999
    assert (hit == owner).mean() > 0.997
    both = (hit >= 0) & (owner >= 0)
    assert both.sum() > 500
    found = 100.0 - nearness[both] / OVERSAMPLING * camera.pixel
    np.testing.assert_allclose(found, distance[both], atol=1e-3)


def test_edges_are_smooth() -> None:
    ball = sphere(10.0, subdivisions=4)
    stage = build_stage(ball.points, ball.faces, np.ones(len(ball.points)), ())
    image = draw_stage(stage).astype(float)
    ground = 255 * np.array(BACKGROUND)
    # Along the outline, which is some 2,000 pixels long, there are colours between those of the body and of the ground.
    share = ((image - ground) / (image[PANEL[1] // 2, PANEL[0] // 2] - ground))[..., 2]
    between = (share > 0.1) & (share < 0.75)
    assert 600 < between.sum() < 3000
    # As many as there are numbers of rays that hit: measured 10 to 12, and 4 for the 2 x 2 samples.
    assert len(np.unique(np.round(16 * share[between]))) >= 8


def test_the_colour_map_is_inferno_without_its_darkest_part() -> None:
    wanted = colormaps["inferno"](np.linspace(DARKEST, 1.0, 256))[:, :3]
    # Matplotlib takes the nearest of 256 colours: measured 0.014.
    np.testing.assert_allclose(color_table(), wanted, atol=0.016)


def test_a_body_in_its_own_colours_is_drawn_on_a_dark_ground(tmp_path: Path) -> None:
    cube = box((2.0, 2.0, 2.0))
    colours = np.tile(np.array([200, 100, 50], dtype=np.uint8), (8, 1))
    target = tmp_path / "picture.png"
    draw_picture(PictureScene(cube.points, cube.faces, np.ones(8), "mm", "orange", (), (colours, 0.25)), target)
    image = pixels(target)
    middle = image[TOP + PANEL[1] // 2, LEFT + PANEL[0] // 2]
    # Shaded, the same in all three colours.
    assert middle / middle[0] == pytest.approx([1.0, 0.5, 0.25], abs=0.02)
    assert SHADED * 200 - 1 <= middle[0] <= 200
    np.testing.assert_array_equal(image[2, 2], np.round(255 * np.array(DARK)))
    # A patch of white stands where the colour bar would be, and nothing else at the right is as bright.
    rows, columns = np.nonzero((image[:, LEFT + PANEL[0] :] == 255).all(axis=2))
    assert len(rows) > 3000
    assert np.ptp(rows) == pytest.approx(64, abs=2)
    assert np.ptp(columns) == pytest.approx(64, abs=2)


def test_an_even_ball_has_its_colour_and_is_shaded_by_its_normals(tmp_path: Path) -> None:
    ball = sphere(10.0, subdivisions=4)
    even, target = np.ones(len(ball.points)), tmp_path / "picture.png"
    draw_picture(PictureScene(ball.points, ball.faces, even, "mm", "even"), target)
    image = pixels(target)[TOP : TOP + PANEL[1], LEFT : LEFT + PANEL[0]]
    camera = build_stage(ball.points, ball.faces, even, ()).camera
    middle, *axes = camera.project(np.vstack([np.zeros(3), np.eye(3)]))[:, :2]
    right, down = camera.pixel * (np.array(axes) - middle).T
    row, column = np.mgrid[: PANEL[1], : PANEL[0]] + 0.5
    x, y = (camera.pixel / 10.0 * (at - start) for at, start in zip((column, row), middle, strict=True))
    inside = np.hypot(x, y) < 0.95
    x, y = x[inside], y[inside]
    normals = np.outer(x, right) + np.outer(y, down) + np.outer(np.sqrt(1.0 - x**2 - y**2), camera.toward)
    shade = SHADED + (FULL - SHADED) * np.clip(normals @ camera.lamp, 0.0, 1.0)
    # Measured: .3 in the mean, 1.1 at most, of 255.
    off = np.abs(image[inside] - 255.0 * shade[:, None] * color_table()[-1])
    assert off.mean() < 1.0
    assert off.max() < 4.0


def test_a_failure_leaves_the_old_picture_and_nothing_else(
    ball: PictureScene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def half(_: Canvas, path: Path) -> None:
        path.write_bytes(b"half a picture")
        raise OSError("the disk is full")

    monkeypatch.setattr(Canvas, "save", half)
    target = tmp_path / "picture.png"
    target.write_bytes(b"the old one")
    with pytest.raises(OSError, match="disk is full"):
        draw_picture(ball, target)
    assert target.read_bytes() == b"the old one"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("exitance", [np.append(np.nan, np.zeros(7)), np.full(8, 0.25)])
def test_dark_and_even_bodies_are_drawn(exitance: FloatArray, tmp_path: Path) -> None:
    cube = box((2.0, 2.0, 2.0))
    target = tmp_path / "picture.png"
    draw_picture(PictureScene(cube.points, cube.faces, exitance, "mm", "$ in a title", ()), target)
    middle = pixels(target)[TOP + PANEL[1] // 2, LEFT + PANEL[0] // 2]
    assert np.abs(middle - 255 * np.asarray(BACKGROUND)).max() > 30


def test_the_light_is_seen_from_its_side() -> None:
    ball = sphere(10.0, subdivisions=2)
    for direction in np.vstack([np.eye(3), -np.eye(3), [[0.6, 0.0, -0.8]]]):
        end, start = tuple(-10.0 * direction), tuple(-20.0 * direction)
        camera = camera_of(lit(ball, end, start))
        assert camera.toward @ -direction > 0.3
        # z stays up, and all of the body and the arrow's tip stays in the panel.
        assert camera.up[2] > 0.3
        placed = camera.project(ball.points)[:, :2]
        assert (placed > 0).all()
        assert (placed < PANEL).all()


def test_the_camera_moves_so_that_the_body_does_not_hide_the_entry_point() -> None:
    # A wall beside the entry point hides it from the first view, 50 degrees anticlockwise of the light.
    base, wall = box((10.0, 10.0, 10.0)), box((20.0, 2.0, 40.0), center=(15.0, 7.0, 5.0))
    both = Surface(np.vstack([base.points, wall.points]), np.vstack([base.faces, wall.faces + 8]))
    camera = camera_of(lit(both, (5.0, 0.0, 0.0), (10.0, 0.0, 0.0)))
    assert camera_of(lit(base, (5.0, 0.0, 0.0), (10.0, 0.0, 0.0))).toward[1] > 0.5
    assert camera.toward[1] < -0.5


def test_colours_follow_the_logarithm_over_six_decades_at_most() -> None:
    exitance = np.array([0.0, -1e-18, np.nan, 1e-12, 1e-7, 1e-4, 1e-1])
    scale = scale_of(exitance, "exitance", "W/mm²")
    assert scale.ends == pytest.approx((1e-7, 1e-1))
    np.testing.assert_allclose(scale.shares(exitance), [0, 0, 0, 0, 0, 0.5, 1], atol=1e-12)
    assert scale.has_below(exitance)
    # Noise on an even glow must not fill the colour map.
    even = scale_of(np.array([1.0, 1.0 + 1e-9]), "exitance", "").ends
    assert even is not None
    assert math.isclose(even[1] / even[0], 2.0)


@pytest.mark.parametrize("ends", [(3e-8, 2e-2), (0.4, 0.5), (0.3, 2.5), (0.5, 1.0), (1e-12, 1e-6), (2e4, 9e4)])
def test_every_colour_bar_has_labels_within_its_ends(ends: tuple[float, float]) -> None:
    ticks = bar_ticks(*ends)
    assert 2 <= len(ticks) <= 8
    assert all(ends[0] * 0.999 <= value <= ends[1] * 1.001 for value, _ in ticks)
    assert len({label for _, label in ticks}) == len(ticks)


def test_normals_are_smooth_on_a_sphere_and_break_at_the_edges_of_a_box() -> None:
    ball = sphere(1.0, subdivisions=3)
    corners = ball.points[ball.faces]
    # The mean of six triangles round a vertex misses the sphere's normal by 0.011 at this fineness.
    assert np.abs(corner_normals(corners, ball.faces) - corners).max() < 0.02
    cube = box((1.0, 2.0, 3.0))
    normals = corner_normals(cube.points[cube.faces], cube.faces)
    np.testing.assert_allclose(normals, np.repeat(cube.normals[:, None], 3, axis=1), atol=1e-12)
