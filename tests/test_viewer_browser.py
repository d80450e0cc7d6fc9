"""The viewer in Chromium: what it shows, and what it reads."""

import io
import json
import math
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from PIL import Image

from tests.viewer_made import CHROMIUM, OPTIONS, data_of, run_with_viewer, unpack
from tetlux.cases.viewer.pack import pack_floats
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.search.rays import RayCaster

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on the path"),
    pytest.mark.skipif(find_spec("playwright") is None, reason="playwright, which drives Chromium, is not installed"),
]
SIZES = {"wide": (1280, 900), "phone": (390, 844)}
SMALL = (872, 500)
FIRST = (
    "quantity: 'exitance', channel: 'all', light: 'all', logarithmic: true, map: 'inferno', edges: false, "
    "lights: true, detectors: true, regions: true, cut: 'off', position: 0.5, moment: 0"
)
# Draw what is asked for, then as finely as at rest.
AT_REST = (
    "new Promise(requestAnimationFrame).then(() => new Promise(requestAnimationFrame)).then(() => tetlux.render(true))"
)
RESTED = "new Promise(done => {const look = () => tetlux.sharpness.resting ? done() : setTimeout(look, 20); look()})"
# What the driver of the screen says of its own speed.
OF_THE_DRIVER = "GPU stall due to ReadPixels"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_with_viewer(tmp_path_factory.mktemp("browser"))


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright  # noqa: PLC0415

    with sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=CHROMIUM, args=OPTIONS)
        yield chromium
        chromium.close()


class Page:
    """The viewer in a window, with all that it said and asked for."""

    def __init__(self, browser: Any, path: Path, size: tuple[int, int]) -> None:
        self.page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        self.said: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("html[data-ready]")

    def do(self, script: str) -> Any:
        return self.page.evaluate(script)

    def change(self, changes: str) -> FloatArray:
        """Change the state, and return what the canvas shows then."""
        self.do(f"tetlux.change({{{changes}}})")
        return self.shown()

    def shown(self) -> FloatArray:
        """The canvas of the body at rest, red, green and blue from 0 to 255."""
        self.do(AT_REST)
        return self.screenshot()

    def screenshot(self) -> FloatArray:
        """The canvas as it is."""
        box = self.do("(({left, top, width, height}) => [left, top, width, height])(view.getBoundingClientRect())")
        clip = dict(zip(("x", "y", "width", "height"), box, strict=True))
        with Image.open(io.BytesIO(self.page.screenshot(clip=clip))) as image:
            return np.asarray(image.convert("RGB"), dtype=float)

    def place_of(self, point: FloatArray) -> tuple[float, float]:
        """Where a point of the case is in the canvas, pixels."""
        x, y = self.do(
            f"(p => {{const v = tetlux.view.camera.position.clone().set(...p.map((x, i) => x - tetlux.data.origin[i]))"
            f".project(tetlux.view.camera); return [(v.x + 1) / 2 * tetlux.size[0], (1 - v.y) / 2 * tetlux.size[1]]}})"
            f"({np.asarray(point).tolist()})"
        )
        return float(x), float(y)


@pytest.fixture(scope="module", params=SIZES)
def page(request: pytest.FixtureRequest, browser: Any, folder: Path) -> Iterator[Page]:
    shown = Page(browser, folder / "viewer.html", SIZES[request.param])
    yield shown
    assert shown.requests == [(folder / "viewer.html").as_uri()]
    assert [text for text in shown.said if OF_THE_DRIVER not in text] == []


@pytest.fixture(scope="module")
def opened(browser: Any, folder: Path) -> Page:
    return Page(browser, folder / "viewer.html", SMALL)


@pytest.fixture
def wide(opened: Page) -> Iterator[Page]:
    """A window as of a desktop, smaller since drawing takes time, as it was opened."""
    shown = opened
    shown.do("tetlux.view.reset(); tetlux.picked = null")
    shown.change(FIRST)
    yield shown
    assert [text for text in shown.said if OF_THE_DRIVER not in text] == []


def number(text: str) -> float:
    """A number as the page writes it."""
    value = text.split(maxsplit=1)[0]
    power = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    mantissa, _, exponent = value.partition("×10")
    return float(mantissa) * 10.0 ** int(exponent.translate(power) or 0)


def body_of(image: FloatArray) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Whether each pixel is the body, which has the map's colours, not greys."""
    return np.asarray(np.ptp(image, axis=2) > 40)


def test_the_body_is_in_the_middle_in_colours(page: Page) -> None:
    image = page.shown()
    height, width = image.shape[:2]
    rows, columns = np.nonzero(body_of(image)[:, : width - 84])
    assert 0.12 < len(rows) / (height * width) < 0.8
    assert abs(columns.mean() - (width - 84) / 2) < 0.06 * width
    assert abs(rows.mean() - height / 2) < 0.08 * height
    # It ends before the legend and the window do.
    assert columns.min() > 0
    assert columns.max() < width - 84
    assert page.do("document.documentElement.scrollWidth <= innerWidth")
    assert page.do("getComputedStyle(document.getElementById('trouble')).display") == "none"


def test_a_bright_place_has_the_colour_of_the_picture(wide: Page, folder: Path) -> None:
    data = data_of(folder / "viewer.html")
    surface = meshio.read(folder / "surface.ply")
    wide.change("lights: false, regions: false, detectors: false")
    # The upper face is lit, and seen: its vertices in the middle of it.
    exitance = np.asarray(surface.point_data["exitance"])
    points = np.asarray(surface.points)
    inside = (np.abs(points[:, 0] - 100) < 3) & (np.abs(points[:, 1]) < 3) & (points[:, 2] > 3.999)
    assert inside.sum() > 10
    bottom, top = data["fields"][0]["ends"]
    image = wide.shown()
    off = []
    for point, value in zip(points[inside], exitance[inside], strict=True):
        x, y = wide.place_of(point)
        share = math.log(value / bottom) / math.log(top / bottom)
        colour = np.array(list(bytes.fromhex(data["maps"]["inferno"][int(share * 255.999)])))
        seen = image[int(y), int(x)]
        # A lamp shades by a factor.
        factor = float(seen @ colour / (colour @ colour))
        assert 0.64 < factor < 1.02
        off.append(np.abs(seen - factor * colour).max())
    assert np.median(off) < 4
    assert max(off) < 30


@pytest.mark.parametrize(("channel", "light"), [("all", "all"), ("far", "all"), ("near", "lamp")])
def test_a_point_reads_what_python_finds(wide: Page, folder: Path, channel: str, light: str) -> None:
    surface = meshio.read(folder / "surface.ply")
    points, triangles = np.asarray(surface.points, dtype=float), surface.cells_dict["triangle"]
    wide.change(f"channel: '{channel}', light: '{light}'")
    parts = [name for name in (light, channel) if name != "all"]
    values = np.asarray(surface.point_data["_".join(["exitance", *parts])], dtype=float)
    for place in ([101.3, 0.4, 4.0], [98.1, 1.7, 4.0]):
        x, y = wide.place_of(np.array(place))
        lines = wide.do(f"tetlux.pick({x}, {y})")
        found = np.array([float(part) for part in lines["place"].removesuffix(" mm").split(", ")])
        np.testing.assert_allclose(found, place, atol=2e-3)
        caster = RayCaster(points, triangles)
        _, hit = caster.first(found[None] + [[0.0, 0.0, 1.0]], np.array([[0.0, 0.0, -1.0]]))
        corners = points[triangles[hit[0]]]
        weights = np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), np.append(found, 1.0), rcond=None)[0]
        name = ", ".join(["exitance", *reversed(parts)])
        assert number(lines[name]) == pytest.approx(float(weights @ values[triangles[hit[0]]]), rel=1e-3)
        assert 0 < number(lines["valid"]) <= 1
        share = number(lines["diffusion itself"].removeprefix("± ")) / 100
        assert share == pytest.approx(1 - number(lines["valid"]), rel=0.06)
        assert lines["error, whole surface"].endswith(" %")


def test_a_click_reads_a_point_and_empty_space_none(page: Page) -> None:
    width, height = page.do("tetlux.size")
    page.change("channel: 'all', light: 'all'")
    page.page.mouse.click((width - 84) / 2, height / 2)
    page.page.wait_for_selector("#reading tr:nth-child(4)")
    assert "exitance" in page.page.inner_text("#reading")
    assert "W/mm²" in page.page.inner_text("#reading")
    page.page.mouse.click(5, height - 80)
    page.page.wait_for_selector("#reading tr", state="detached")
    assert page.page.is_visible("#hint")


def test_a_picked_detector_is_read_with_its_error(wide: Page) -> None:
    x, y = wide.place_of(np.array([102, 0, 4]))
    lines = wide.do(f"tetlux.pick({x}, {y})")
    assert "±" in lines["top, near"]
    assert "±" in lines["top, far"]


def test_channel_light_scale_and_map_change_the_colours(wide: Page) -> None:
    first = wide.shown()
    assert np.array_equal(wide.change(""), first)
    for changes in ("channel: 'far'", "light: 'lamp'", "logarithmic: false", "map: 'viridis'", "edges: true"):
        changed = wide.change(changes)
        body = body_of(first) | body_of(changed)
        assert (np.abs(changed - first).max(axis=2) > 3)[body].mean() > 0.05, changes
        assert np.array_equal(wide.change(FIRST), first), changes


def test_a_linear_scale_begins_at_zero(wide: Page, folder: Path) -> None:
    bottom, top = data_of(folder / "viewer.html")["fields"][0]["ends"]
    assert wide.do("tetlux.range") == pytest.approx([bottom, top])
    wide.change("logarithmic: false")
    assert wide.do("tetlux.range") == pytest.approx([0, top])
    assert wide.page.input_value("#bottom") == "0"
    wide.page.fill("#top", "1e-3")
    wide.page.press("#top", "Enter")
    assert wide.do("tetlux.range") == pytest.approx([0, 1e-3])
    # What makes no sense is not taken.
    for wrong in ("-1", "much"):
        wide.page.fill("#top", wrong)
        wide.page.press("#top", "Enter")
        assert wide.do("tetlux.range") == pytest.approx([0, top])


def test_the_cut_shows_the_fluence_of_the_volume(wide: Page, folder: Path) -> None:
    volume = meshio.read(folder / "volume.vtu")
    points, cells = np.asarray(volume.points, dtype=float), volume.cells_dict["tetra"]
    values = np.asarray(volume.point_data["fluence_far"], dtype=float)
    wide.change("cut: 'z', position: 0.55, channel: 'far'")
    x, y = wide.place_of(np.array([102.0, 0.7, 0.4]))
    lines = wide.do(f"tetlux.pick({x}, {y})")
    found = np.array([float(part) for part in lines["place"].removesuffix(" mm").split(", ")])
    np.testing.assert_allclose(found, [102.0, 0.7, 0.4], atol=5e-3)
    corners = points[cells]
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    inner = np.linalg.solve(edges, (found - corners[:, 0])[:, :, None])[:, :, 0]
    weights = np.column_stack([1 - inner.sum(axis=1), inner])
    own = int(np.argmax(weights.min(axis=1)))
    assert number(lines["fluence"]) == pytest.approx(float(weights[own] @ values[cells[own]]), rel=1e-3)


def test_it_is_drawn_coarsely_in_motion_and_finely_at_rest(wide: Page) -> None:
    wide.do(RESTED)
    width = "tetlux.renderer.domElement.width / tetlux.size[0]"
    assert wide.do(width) == 2
    # As on a machine that is slow.
    moving = wide.do("tetlux.view.turn(0.1, 0), tetlux.sharpness.moving = 0.5, tetlux.render(false), " + width)
    assert moving == 0.5
    wide.do(RESTED)
    assert wide.do(width) == 2


def test_a_slow_machine_turns_fewer_triangles_and_shows_all_at_rest(wide: Page) -> None:
    drawn = "tetlux.renderer.info.render.triangles"
    wide.change("lights: false, regions: false, edges: true")
    whole = wide.do(drawn)
    frames = wide.do("tetlux.frames")
    # A small body keeps all of its triangles in motion.
    assert wide.do("tetlux.sharpness.slow = true, tetlux.render(false), " + drawn) == whole
    wide.do("tetlux.body.most = 300, tetlux.body.kept = 100, tetlux.sharpness.slow = true")
    assert 50 < wide.do("tetlux.render(false), " + drawn) < whole / 2
    wide.page.mouse.move(250, 250)
    wide.page.mouse.down()
    wide.page.mouse.move(350, 230, steps=4)
    wide.page.mouse.up()
    wide.do(RESTED.replace("tetlux.sharpness.resting", f"tetlux.frames > {frames + 3} && tetlux.sharpness.resting"))
    assert wide.do(drawn) == whole
    seen = wide.screenshot()
    # As if all had been drawn finely all the time.
    wide.do("tetlux.body.most = 1e6, tetlux.sharpness.slow = false, tetlux.sharpness.moving = 2, tetlux.render(false)")
    assert np.array_equal(wide.screenshot(), seen)


def test_keys_turn_zoom_and_switch(wide: Page) -> None:
    # Without names, whose letters are drawn a little otherwise after they moved.
    first = wide.change("detectors: false, regions: false")
    wide.page.focus("#view")
    for key in ("ArrowLeft", "ArrowUp", "+", "e", "l", "c"):
        before = wide.shown()
        wide.page.keyboard.press(key)
        wide.page.wait_for_timeout(200)
        assert (np.abs(wide.shown() - before).max(axis=2) > 3).mean() > 0.01, key
    for key in ("e", "l", "c", "c", "c", "c", "0"):
        wide.page.keyboard.press(key)
    wide.page.wait_for_timeout(300)
    # Without the frame that shows where keys go to.
    assert np.abs(wide.shown() - first)[5:-5, 5:-5].max() < 3


def test_mouse_and_wheel_turn_and_zoom(wide: Page) -> None:
    toward, zoom = wide.do("[tetlux.view.toward.toArray(), tetlux.view.camera.zoom]")
    mouse = wide.page.mouse
    mouse.move(250, 250)
    mouse.down()
    mouse.move(350, 230, steps=4)
    mouse.up()
    mouse.wheel(0, -300)
    wide.page.wait_for_timeout(200)
    turned, nearer = wide.do("[tetlux.view.toward.toArray(), tetlux.view.camera.zoom]")
    assert np.dot(toward, turned) < 0.98
    assert nearer > 1.05 * zoom
    # The end of a turn reads no point.
    assert wide.do("tetlux.picked") is None


def test_a_finger_turns_and_a_tap_reads(browser: Any, folder: Path) -> None:
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    page = context.new_page()
    page.goto((folder / "viewer.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    toward = page.evaluate("tetlux.view.toward.toArray()")
    width, height = page.evaluate("tetlux.size")
    x, y = (width - 84) / 2, height / 2
    finger = context.new_cdp_session(page)
    for kind, step in (("touchStart", 0), ("touchMove", 20), ("touchMove", 50), ("touchMove", 80), ("touchEnd", None)):
        points = [] if step is None else [{"x": x + step, "y": y}]
        finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    assert np.dot(toward, page.evaluate("tetlux.view.toward.toArray()")) < 0.98
    assert page.evaluate("tetlux.picked") is None
    page.touchscreen.tap(x, y)
    page.wait_for_selector("#reading tr:nth-child(4)")
    assert "W/mm²" in page.inner_text("#reading")
    context.close()


def test_a_point_on_a_cut_is_marked_and_written_without_noise(wide: Page) -> None:
    wide.change("cut: 'y', position: 0.5, lights: false")
    x, y = wide.place_of(np.array([102.0, 0.0, 1.0]))
    lines = wide.do(f"tetlux.pick({x}, {y})")
    assert lines["place"].split(", ")[1] == "0"
    wide.shown()
    # What is cut away does not hide it.
    assert wide.do("document.querySelector('.mark.picked').className") == "mark picked"


def test_a_scale_is_offered_where_there_are_two(wide: Page) -> None:
    assert wide.page.is_visible("#log")
    wide.change("quantity: 'valid'")
    assert not wide.page.is_visible("#log")
    assert wide.page.is_visible("#bottom")


def test_names_of_detectors_and_regions_are_shown_and_hidden(wide: Page) -> None:
    names = "[...document.querySelectorAll('.mark span')].filter(e => e.offsetParent).map(e => e.textContent)"
    assert {"top", "ball"} <= set(wide.do(names))
    wide.change("detectors: false, regions: false")
    assert wide.do(names) == []


def test_a_slider_goes_through_light_in_time(browser: Any, folder: Path, tmp_path: Path) -> None:
    html = (folder / "viewer.html").read_text(encoding="utf-8")
    data = data_of(folder / "viewer.html")
    first = data["fields"][0]
    count = first["values"]["shape"][0]
    # The vertices of a half are bright at first, those of the other later; one of all is not known at all.
    left = unpack(data["points"])[:, 0] < 0
    values = [np.where(left, 100.0, 1.0), np.where(left, 1.0, 100.0)]
    values[0][count - 1] = np.nan
    moments = [
        {
            **{**first, "quantity": "pulse", "unit": "W/mm²/J", "ends": [1, 100]},
            **{"time": time, "values": pack_floats(each), "readings": {"top": read, "side": None}},
        }
        for time, each, read in zip((5e-11, 1.2e-9), values, (7.0, 50.5), strict=True)
    ]
    text = json.dumps({**data, "inTime": moments}).replace("<", "\\u003c")
    before, opening, rest = html.partition('<script type="application/json" id="data">')
    path = tmp_path / "pulse.html"
    path.write_text(f"{before}{opening}{text}</script>{rest.partition('</script>')[2]}")
    shown = Page(browser, path, SMALL)
    assert not shown.page.is_visible("#moment")
    early = shown.change("quantity: 'pulse', lights: false, detectors: false, regions: false")
    assert shown.page.inner_text("#time") == "50 ps"
    shown.page.focus("#moment")
    shown.page.keyboard.press("ArrowRight")
    late = shown.shown()
    assert shown.page.inner_text("#time") == "1.2 ns"
    x, y = shown.place_of(np.array([103.0, 0, 4]))
    assert number(shown.do(f"tetlux.pick({x}, {y})")["exitance at 1.2 ns"]) == pytest.approx(100)
    # Detectors are read at the time, too, where light arrives then.
    assert (
        shown.do(f"tetlux.pick({', '.join(map(str, shown.place_of(np.array([102.0, 0, 4]))))})")["top at 1.2 ns"]
        == "50.5 W/mm²/J"
    )
    # What was bright is dark and the reverse, on one scale.
    body = body_of(early) & body_of(late)
    brighter = (late - early).sum(axis=2)[body] > 60
    assert 0.2 < brighter.mean() < 0.8
    assert ((late - early).sum(axis=2)[body] < -60).mean() > 0.2
    shown.change("quantity: 'exitance'")
    assert not shown.page.is_visible("#moment")
    assert [text for text in shown.said if OF_THE_DRIVER not in text] == []


def test_an_arrow_along_the_line_of_sight_becomes_a_ring(wide: Page) -> None:
    ring = "document.querySelector('.mark.beams.end-on i')"
    wide.shown()
    assert wide.do("tetlux.arrows.children.map(arrow => arrow.visible)") == [True]
    assert wide.do(f"{ring} === null")
    wide.do("tetlux.view.turn(0, 2)")
    wide.shown()
    assert wide.do("tetlux.arrows.children.map(arrow => arrow.visible)") == [False]
    assert wide.do(f"getComputedStyle({ring}).display") == "block"
    # From behind nothing is marked: the body hides where the beam enters.
    wide.do("tetlux.view.turn(0, -4)")
    wide.shown()
    assert wide.do("tetlux.arrows.children.map(arrow => arrow.visible)") == [False]
    assert wide.do(f"{ring} === null")
