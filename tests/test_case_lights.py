"""Lights, detectors and the camera of case files, and images as light."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tetlux.cases.cli import main
from tetlux.cases.file.case import Case
from tetlux.cases.file.images import read_pixels
from tetlux.cases.file.load import load_cases
from tetlux.cases.picture.arrows import light_rays
from tetlux.fem import CollimatedBeam, DiffusePatch, Disc, Emission, EnvironmentLight, Gaussian, Rectangle
from tetlux.fem import Image as ImageSpot
from tetlux.fem.outcome.detector_kinds import DiscDetector, FibreDetector, PointDetector
from tetlux.meshing import InputError, box

CUBE = """\
surface: {box: {size: [8, 8, 8]}}
medium: MEDIUM
MORE
lights:
  - LIGHT
"""
ONE = "{sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}"
THREE = "{sigma_a: [0.01, 0.02, 0.03], sigma_s_prime: 1.0, eta: 1.4}"
POINT = "point: {position: [0, 0, 0]}"
SPOT = "spot: {image: {file: FILE, center: [0, 0, 4], width: 4}}"
SLIDE = SPOT.replace("FILE", "slide.png")

Load = Callable[..., Case]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    def loaded(light: str = POINT, *, medium: str = ONE, more: str = "") -> Case:
        text = CUBE.replace("MEDIUM", medium).replace("MORE\n", more).replace("LIGHT", light)
        (tmp_path / "cube.yaml").write_text(text, encoding="utf-8")
        (case,) = load_cases(tmp_path / "cube.yaml")
        return case

    return loaded


@pytest.fixture
def slide(tmp_path: Path) -> None:
    """Two pixels: a red of sRGB value 188, and a black one; blue nowhere."""
    pixels = np.array([[[188, 255, 0], [0, 0, 0]]], dtype=np.uint8)
    Image.fromarray(pixels).save(tmp_path / "slide.png")


@pytest.mark.parametrize(
    ("spot", "expected"),
    [
        ("disc: {center: [0, 0, 4], radius: 1}", Disc((0.0, 0.0, 4.0), 1.0)),
        ("gaussian: {center: [0, 0, 4], radius: 1}", Gaussian((0.0, 0.0, 4.0), 1.0)),
        (
            "rectangle: {center: [0, 0, 4], width: 2, height: 1, up: [1, 0, 0]}",
            Rectangle((0.0, 0.0, 4.0), 2.0, 1.0, (1.0, 0.0, 0.0)),
        ),
    ],
)
def test_spots_and_their_power(load: Load, spot: str, expected: Disc) -> None:
    case = load(f"collimated: {{direction: [0, 0, -1], irradiance: 3, spot: {{{spot}}}}}")
    assert case.lights == (CollimatedBeam((0.0, 0.0, -1.0), 3.0, expected),)
    case = load(f"collimated: {{direction: [0, 0, -1], power: [3, 6], spot: {{{spot}}}}}")
    beams = [channel.lights["collimated_1"] for channel in case.channels]
    assert beams == [CollimatedBeam((0.0, 0.0, -1.0), power / expected.area, expected) for power in (3.0, 6.0)]


def test_light_on_the_whole_body_is_drawn_as_parallel_arrows(load: Load) -> None:
    case = load("collimated: {direction: [0, 0, -2], irradiance: 0.5}")
    assert case.lights == (CollimatedBeam((0.0, 0.0, -2.0), 0.5),)
    drawn = light_rays(case.lights[0], case.surface)
    assert len(drawn) == 3
    for ray in drawn:
        start, end = np.array(ray.start), np.array(ray.end)
        assert end[2] == pytest.approx(4.0)
        assert np.abs(end[:2]).max() < 4.0
        assert start - end == pytest.approx([0.0, 0.0, 0.3 * case.surface.diagonal])
    (spot,) = light_rays(CollimatedBeam((0.0, 0.0, -1.0), 1.0, Disc((1.0, 2.0, 0.0), 0.5)), box((8.0, 8.0, 8.0)))
    assert spot.end == pytest.approx((1.0, 2.0, 4.0), abs=0.05)


def test_a_patch_has_a_value_for_each_channel(load: Load) -> None:
    patch = "patch: {center: [1, 2, 4], radius: 1, irradiance: [2, 0, 3]}"
    case = load(f"{patch}\n  - {POINT}", medium=THREE)
    lights = [channel.lights.get("patch_1") for channel in case.channels]
    assert lights == [DiffusePatch((1.0, 2.0, 4.0), 1.0, 2.0), None, DiffusePatch((1.0, 2.0, 4.0), 1.0, 3.0)]
    (drawn,) = light_rays(DiffusePatch((1.0, 2.0, 4.0), 1.0, 2.0), case.surface)
    assert drawn.is_point
    assert drawn.end == pytest.approx((1.0, 2.0, 4.0))


@pytest.mark.usefixtures("slide")
def test_each_of_three_channels_takes_its_colour_of_an_image(load: Load) -> None:
    light = f"collimated: {{direction: [0, 0, -1], irradiance: 2, {SLIDE}}}"
    case = load(f"{light}\n  - {POINT}", medium=THREE)
    # Nothing of it is blue.
    assert [list(channel.lights) for channel in case.channels] == [["collimated_1", "point_1"]] * 2 + [["point_1"]]
    spots = [channel.lights["collimated_1"].spot for channel in case.channels[:2]]  # type: ignore[attr-defined]
    assert all(isinstance(spot, ImageSpot) for spot in spots)
    # 188 is the sRGB value of half the light: ((188/255 + .055)/1.055)^2.4 = .5029.
    assert spots[0].pixels == pytest.approx(np.array([[0.50289, 0.0]]), abs=1e-5)
    assert spots[1].pixels.tolist() == [[1.0, 0.0]]
    assert (spots[0].width, spots[0].height) == (4.0, 2.0)
    # One channel sees luminance.
    (one,) = load(light).lights
    assert one.spot.pixels == pytest.approx(np.array([[0.2126 * 0.50289 + 0.7152, 0.0]]), abs=1e-5)  # type: ignore[attr-defined]
    (linear,) = load(light.replace("width: 4", "width: 4, encoding: linear")).lights
    assert linear.spot.pixels[0, 0] == pytest.approx(0.2126 * 188 / 255 + 0.7152)  # type: ignore[attr-defined]


@pytest.mark.usefixtures("slide")
def test_an_environment_is_as_bright_as_it_is_said(load: Load) -> None:
    light = "environment: {file: slide.png, brightest: [2, 3, 4], front: [1, 0, 0]}"
    case = load(f"{light}\n  - {POINT}", medium=THREE)
    red, green = (channel.lights["environment_1"] for channel in case.channels[:2])
    assert isinstance(red, EnvironmentLight)
    assert isinstance(green, EnvironmentLight)
    assert red.radiance == pytest.approx(np.array([[2 * 0.50289, 0.0]]), abs=1e-4)
    assert green.radiance.tolist() == [[3.0, 0.0]]
    assert (green.up, green.front) == ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    assert "environment_1" not in case.channels[2].lights


REGION = f"regions: [{{name: core, surface: {{sphere: {{radius: 2}}}}, medium: {ONE}}}]\n"


def test_emission_is_of_a_region_by_name(load: Load) -> None:
    assert load("emission: {density: 0.5}").lights == (Emission(0.5),)
    assert load("emission: {density: 0.5, region: core}", more=REGION).lights == (Emission(0.5, 1),)
    assert load("emission: {density: 0.5, region: body}", more=REGION).lights == (Emission(0.5, 0),)
    # Without regions the body is all there is.
    assert load("emission: {density: 0.5, region: body}").lights == (Emission(0.5),)


def test_lights_are_named_by_kind_and_number(load: Load) -> None:
    case = load(f"{POINT}\n  - emission: {{density: 1}}\n  - {POINT}\n  - {{name: glow, emission: {{density: 1}}}}")
    assert case.light_names == ("point_1", "emission_1", "point_2", "glow")


def test_detectors_and_camera(load: Load) -> None:
    case = load(
        more="detectors:\n  - {name: a, point: [0, 0, 4]}\n  - {name: b, disc: {center: [4, 0, 0], radius: 1}}\n"
        "  - {name: c, fibre: {center: [0, -4, 0], radius: 0.5, numerical_aperture: 0.22}}\n"
        "camera: {position: [0, 0, 50]}\n"
    )
    assert [(s.name, s.kind) for s in case.detectors] == [("a", "point"), ("b", "disc"), ("c", "fibre")]
    assert [s.detector for s in case.detectors] == [
        PointDetector((0.0, 0.0, 4.0)),
        DiscDetector((4.0, 0.0, 0.0), 1.0),
        FibreDetector((0.0, -4.0, 0.0), 0.5, 0.22),
    ]
    assert case.camera == (0.0, 0.0, 50.0)


def beam(spot: str) -> str:
    return f"collimated: {{direction: [0, 0, -1], irradiance: 1, {spot}}}"


WRONG = [
    ("collimated: {direction: [0, 0, -1]}", "", r"lights\[0\]\.collimated: give irradiance or power, not neither"),
    ("collimated: {direction: [0, 0, -1], irradiance: 1, power: 1}", "", "give irradiance or power, not both"),
    ("collimated: {direction: [0, 0, -1], power: 1}", "", "power belongs to a spot"),
    (
        "collimated: {direction: [0, 0, 0], irradiance: 1}",
        "",
        r"line 4: .*\.collimated\.direction: direction is zero",
    ),
    (
        "collimated: {direction: [0, 0, -1], irradiance: -1}",
        "",
        r"\.collimated\.irradiance: irradiance is -1",
    ),
    (beam("spot: {disc: {center: [9, 0, 0], radius: 1}}"), "", r"lights\[0\]: the collimated light .* misses"),
    (beam("spot: {disc: {center: [0, 0, 0], radius: 0}}"), "", r"spot\.disc\.radius: expected a number greater than 0"),
    (beam("spot: {}"), "", r"lights\[0\]\.collimated\.spot: give exactly one of disc, gaussian, rectangle, image"),
    (
        beam(SPOT.replace("FILE", "none.png")),
        "",
        r"spot\.image\.file: .*none\.png does not exist",
    ),
    (beam(SPOT.replace("FILE", "cube.yaml")), "", r"spot\.image\.file: .*cube\.yaml is not a readable image"),
    (beam(SPOT.replace("FILE", "black.png")), "", r"lights\[0\]: the image is black"),
    (
        "collimated: {direction: [0, 0, -1], power: [1, 1, 1], " + SLIDE + "}",
        "",
        "the image is black in a channel that has power",
    ),
    (
        "environment: {file: cube.yaml, brightest: 1}",
        "",
        r"environment\.file: .*cube\.yaml is not a readable",
    ),
    ("environment: {file: slide.png, brightest: 1, up: [0, 1, 0]}", "", r"lights\[0\]\.environment\.up: up and front"),
    (
        "emission: {density: 1, region: sgone}",
        REGION,
        r'line 5: lights\[0\]\.emission\.region: there is no region "sgone"; the regions here are body, core',
    ),
    ("environment: {file: slide.png, brightest: 0}", "", r"lights\[0\]\.environment\.brightest: brightest is 0"),
    ("emission: {density: -1}", "", r"lights\[0\]\.emission\.density: density is -1"),
    (
        "point: {position: [0, 0, 0], power: [0, 0]}",
        "",
        "lights: all lights are dark in channel 1; give",
    ),
    ("{name: all, " + POINT + "}", "", r'lights\[0\]: "all" is the sum'),
    ("{name: a, " + POINT + "}\n  - {name: a, " + POINT + "}", "", r'lights\[1\]: the name "a" is given twice'),
    ("{name: red, " + POINT + "}", "channels: [red, ir]\n", r'lights: names of lights and channels make "red" twice'),
    ("{name: a b, " + POINT + "}", "", r"lights\[0\]\.name: expected a name of letters from A to Z, digits and"),
    ("{}", "", r"lights\[0\]: give exactly one of pencil, point, .*, emission, not none"),
    (
        POINT,
        "detectors: [{name: a, point: [0, 0, 4]}, {name: a, point: [0, 4, 0]}]\n",
        r'detectors\[1\]: the name "a" is given twice',
    ),
    (POINT, "detectors: [{point: [0, 0, 4]}]\n", r"detectors\[0\]\.name: this key is missing"),
    (POINT, "detectors: [{name: a}]\n", r"detectors\[0\]: give exactly one of point, disc, fibre"),
    (
        POINT,
        "detectors: [{name: a, point: [0, 0, 9]}]\n",
        r"line 3: detectors\[0\]: the detector's position .* from the surface",
    ),
    (
        POINT,
        "detectors: [{name: a, disc: {center: [0, 0, 4], radius: 30}}]\n",
        r"detectors\[0\]: the disc of radius 30",
    ),
    (
        POINT,
        "detectors: [{name: a, fibre: {center: [0, 0, 4], radius: 1, numerical_aperture: 2}}]\n",
        r"detectors\[0\]: numerical_aperture is 2",
    ),
    (POINT, "camera: {position: [0, 0, 1]}\n", r"camera\.position: the camera is inside the body"),
    (POINT, "camera: {position: [0, 0]}\n", r"camera\.position\[2\]: expected a list of three numbers"),
]


@pytest.mark.usefixtures("slide")
@pytest.mark.parametrize(("light", "more", "message"), WRONG)
def test_a_wrong_light_or_detector_gets_one_sentence(
    light: str, more: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Image.new("RGB", (4, 4)).save(tmp_path / "black.png")
    text = CUBE.replace("MEDIUM", ONE).replace("MORE\n", more).replace("LIGHT", light)
    (tmp_path / "cube.yaml").write_text(text)
    assert main(["run", str(tmp_path / "cube.yaml"), "--out", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr()
    assert re.search(message, printed.err), printed.err
    assert printed.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("pixels", "mode", "expected"),
    [
        (np.array([[0, 255]], dtype=np.uint8), "L", [0.0, 1.0]),
        (np.array([[0, 65535]], dtype=np.uint16), "I;16", [0.0, 1.0]),
        # Half transparent white, and a colour that is not there at all.
        (np.array([[[255, 255, 255, 51], [255, 255, 255, 0]]], dtype=np.uint8), "RGBA", [0.2, 0.0]),
    ],
)
def test_images_of_other_modes(
    pixels: np.ndarray[tuple[int, ...], np.dtype[np.generic]], mode: str, expected: list[float], tmp_path: Path
) -> None:
    image = Image.fromarray(pixels)
    assert image.mode == mode
    image.save(tmp_path / "image.png")
    for channel in range(3):
        assert read_pixels(tmp_path / "image.png", "srgb")[0, :, channel] == pytest.approx(expected)


def test_an_image_that_was_cut_short_is_none(tmp_path: Path) -> None:
    Image.fromarray(np.random.default_rng(1).integers(0, 255, (40, 40, 3), dtype=np.uint8)).save(tmp_path / "a.png")
    whole = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"a\.png is not a readable image"):
        read_pixels(tmp_path / "a.png", "srgb")
