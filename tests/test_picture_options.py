"""What the key ``picture`` of a case file chooses: fields, colours, cuts, sizes, turns."""

import math
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image

from tetlux.cases.file.load import load_cases
from tetlux.cases.picture.cut import cut_open
from tetlux.cases.picture.frame import AROUND, LEFT, TOP
from tetlux.cases.picture.stage import SHADED
from tetlux.cases.picture.view import MARGIN, PANEL
from tetlux.cases.run import run_case
from tetlux.meshing import InputError, TetMesh
from tetlux.meshing.arrays import FloatArray

CASE = """\
name: ball
surface: {sphere: {radius: 10}}
medium: {sigma_a: [0.02, 0.1], sigma_s_prime: 1.0, eta: 1.4}
channels: [near, far]
lights:
  - {name: glow, point: {position: [3, 0, 5], power: 1.0}}
  - {name: room, diffuse: {irradiance: 0.001}}
tolerance: 0.2
outputs: [surface, volume, picture]
"""
PICTURES = """\
picture:
  - {camera: {azimuth: -90, elevation: 0}}
  - {name: plain, camera: {azimuth: -90, elevation: 0}, map: viridis, range: [1.0e-4, 1.0e-2]}
  - {name: linear, camera: {azimuth: -90, elevation: 0}, scale: linear, channel: far, light: glow}
  - {name: valid, camera: {azimuth: -90, elevation: 0}, field: valid, map: grey}
  - {name: cut, cut: {normal: [0, -1, 0]}, camera: {azimuth: -90, elevation: 0}, channel: near, map: viridis}
  - {name: small, pixels: [500, 600]}
  - {name: turn, turntable: 8, pixels: [500, 500]}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pictures")
    (folder / "case.yaml").write_text(CASE + PICTURES)
    (case,) = load_cases(folder / "case.yaml")
    return run_case(case, folder / "out")


def pixels(path: Path) -> FloatArray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"), dtype=np.float64)


def panel_of(path: Path) -> FloatArray:
    return pixels(path)[TOP:-1, LEFT:-1][: PANEL[1], : PANEL[0]]


def from_the_front(place: FloatArray) -> tuple[int, int]:
    """Row and column of the panel at which a ball of radius 10, seen along y, shows a place."""
    pixel = 20.0 / ((1.0 - 2.0 * MARGIN) * PANEL[1])
    return round(PANEL[1] / 2 - place[2] / pixel - 0.5), round(PANEL[0] / 2 + place[0] / pixel - 0.5)


def check_colours(path: Path, points: FloatArray, values: FloatArray, share: Any, name: str) -> None:
    """Places on the near side have the colour of their value, but for the lamp's factor."""
    image = panel_of(path)
    # The mark of the point source stands over the body.
    seen = np.flatnonzero((points[:, 1] < -3) & (np.hypot(points[:, 0] - 3, points[:, 2] - 5) > 1))
    assert len(seen) > 50
    off = []
    for i in seen[::7]:
        shown = image[from_the_front(points[i])]
        wanted = 255 * np.array(colormaps[name](float(np.clip(share(values[i]), 0, 1)))[:3])
        factor = float(shown @ wanted / (wanted @ wanted))
        assert SHADED - 0.02 < factor < 1.02
        off.append(np.abs(shown - factor * wanted).max())
    # Over the ball at this fineness the median was 1.2 and the 90th percentile 4.
    assert np.median(off) < 3
    assert np.quantile(off, 0.9) < 10


@pytest.fixture(scope="module")
def surface(folder: Path) -> meshio.Mesh:
    return meshio.read(folder / "surface.ply")


def test_a_range_and_a_map_set_the_colours(folder: Path, surface: meshio.Mesh) -> None:
    share = lambda value: math.log(value / 1e-4) / math.log(1e-2 / 1e-4)  # noqa: E731
    exitance = surface.point_data["exitance"]
    check_colours(folder / "picture-plain.png", surface.points, exitance, share, "viridis")


def test_a_channel_and_a_light_are_chosen_on_a_linear_scale(folder: Path, surface: meshio.Mesh) -> None:
    exitance = surface.point_data["exitance_glow_far"]
    share = lambda value: 0.2 + 0.8 * value / exitance.max()  # noqa: E731
    check_colours(folder / "picture-linear.png", surface.points, exitance, share, "inferno")


def test_validity_is_on_a_linear_scale_from_0(folder: Path, surface: meshio.Mesh) -> None:
    valid = surface.point_data["valid"]
    image, seen = panel_of(folder / "picture-valid.png"), surface.points[:, 1] < -5
    grey = (0x30 + (0xF8 - 0x30) * valid / valid.max())[seen]
    shown = np.array([image[from_the_front(place)].mean() for place in surface.points[seen]])
    assert ((shown > (SHADED - 0.02) * grey) & (shown < 1.02 * grey)).mean() > 0.95


def test_a_cut_shows_the_fluence_of_its_plane(folder: Path) -> None:
    volume = meshio.read(folder / "volume.vtu")
    mesh = TetMesh(np.asarray(volume.points, dtype=float), volume.cells_dict["tetra"].astype(np.int64))
    fluence = np.asarray(volume.point_data["fluence_near"])
    top = fluence.max()
    bottom = max(fluence[fluence > 0].min(), top * 1e-6)
    image = panel_of(folder / "picture-cut.png")
    places = np.array([[x, 0.0, z] for x in np.linspace(-7, 7, 8) for z in np.linspace(-7, 4, 7)])
    cells, weights = mesh.locate(places + np.array([0, 1e-6, 0]))
    wanted = (weights * fluence[mesh.tetrahedra[cells]]).sum(axis=1)
    span = mesh.points.max(axis=0) - mesh.points.min(axis=0)
    middle, pixel = mesh.points.max(axis=0) - 0.5 * span, span[2] / ((1.0 - 2.0 * MARGIN) * PANEL[1])
    table, shades = 255 * np.array(colormaps["viridis"](np.linspace(0, 1, 256)))[:, :3], []
    off = []
    for place, value in zip(places, wanted, strict=True):
        row, column = PANEL[1] / 2 - (place - middle)[2] / pixel, PANEL[0] / 2 + (place - middle)[0] / pixel
        shown = image[round(row - 0.5), round(column - 0.5)]
        colour = table[int(255.999 * math.log(value / bottom) / math.log(top / bottom))]
        factor = float(shown @ colour / (colour @ colour))
        shades.append(factor)
        off.append(np.abs(shown - factor * colour).max())
    # Colours follow the logarithm between the corners of the cut, the fluence its values.
    assert np.median(off) < 6
    assert max(off) < 40
    # The face of the cut is flat, and turned to the eye: one shade, that of a normal towards it.
    assert np.ptp(shades) < 0.15
    lamp = 0.8 / math.sqrt(0.35**2 + 0.5**2 + 0.8**2)
    assert np.median(shades) == pytest.approx(SHADED + (1 - SHADED) * lamp, abs=0.02)


def test_what_a_cut_leaves_is_closed_and_seen_from_outside(ball_mesh: TetMesh) -> None:
    values = ball_mesh.points[:, 2].copy()
    normal = np.array([0.6, 0.0, 0.8])
    points, triangles, cut = cut_open(ball_mesh.points, ball_mesh.tetrahedra, values, normal, np.zeros(3))
    assert (points @ normal).max() < 1e-6
    np.testing.assert_allclose(cut, points[:, 2], atol=1e-5)
    corners = points[triangles]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(0.5 * ball_mesh.volume, rel=0.01)
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    with pytest.raises(InputError, match="takes all of the body away"):
        cut_open(ball_mesh.points, ball_mesh.tetrahedra, values, normal, -50 * normal)


def test_a_picture_has_its_size_and_its_body_fills_it(folder: Path) -> None:
    image = pixels(folder / "picture-small.png")
    assert image.shape == (600, 500, 3)
    panel = image[TOP : TOP + 600 - AROUND[1], LEFT : LEFT + 500 - AROUND[0]]
    rows, columns = np.nonzero(np.ptp(panel, axis=2) > 40)
    assert np.ptp(columns) > 0.8 * panel.shape[1]
    assert len(rows) > 0.35 * panel.shape[0] * panel.shape[1]
    # Frame and letters take half as much room as on larger pictures: without that the body is 230 pixels wide.
    assert np.ptp(np.nonzero((np.ptp(image[:, :390], axis=2) > 40).any(axis=0))[0]) > 300


def test_a_turntable_turns_once_at_one_scale(folder: Path) -> None:
    with Image.open(folder / "picture-turn.gif") as image:
        frames = []
        for step in range(image.n_frames):  # type: ignore[attr-defined]
            image.seek(step)
            frames.append(np.asarray(image.convert("RGB"), dtype=float)[TOP:330, LEFT:280])
        assert image.info["loop"] == 0
    assert len(frames) == 8
    bodies = [np.ptp(frame, axis=2) > 60 for frame in frames]
    widths = [np.ptp(np.nonzero(body.any(axis=0))[0]) for body in bodies]
    # The ball stays as wide: its silhouette does not change.
    assert np.ptp(widths) <= 3
    assert min(widths) > 180
    first, half = frames[0], frames[4]
    assert np.abs(first - half).max() > 30


@pytest.mark.parametrize(
    ("picture", "sentence"),
    [
        ("{range: [2, 1]}", "picture: range needs the smaller value first."),
        ("{range: [0, 1]}", "picture: range begins above 0 on a logarithmic scale; write scale: linear."),
        ("{range: [1]}", "picture.range[1]: expected a list of two numbers."),
        ("{pixels: [1400, 3]}", "picture.pixels[1]: expected a number greater than or equal to 500, but found 3."),
        ("{map: virids}", 'picture.map: did you mean "viridis"? expected'),
        ("{field: exitance, cut: {normal: [1, 0, 0]}}", "picture: cut shows the fluence; leave field or cut out."),
        ("{channel: blue}", 'picture: there is no channel "blue"; the channels are near, far.'),
        ("[{}, {light: sun}]", 'picture[1]: there is no light "sun"; the lights are glow, room.'),
        ("{field: fluence}", "picture: the fluence is that of one channel; add channel, one of near, far."),
        ("{field: fluence, light: room}", "picture: the fluence is that of all lights together; leave light out."),
        ("{field: phase}", "picture: the field phase is that of modulated light; add modulation to the case."),
        ("{field: radiance}", "picture: the field radiance needs camera: {position: ...} in the case"),
        ("{field: colours}", "picture: colours are those of channels red, green and blue; write field: exitance."),
        ("{cut: {normal: [0, 0, 0]}, channel: far}", "picture: normal"),
        ("{cut: {normal: [1, 0, 0], through: [-20, 0, 0]}, channel: far}", "picture: the cut takes all of the body"),
        ("[{name: a}, {name: a}]", "picture[1]: two pictures would be picture-a.png; give one of them another name."),
        ("{camera: {position: [0, 0, 1]}}", "picture.camera: the camera is inside the body; move it outside."),
        ("{turntable: 1}", "picture.turntable: expected a number greater than or equal to 2, but found 1."),
        ("{colour: red}", "picture.colour: unknown key"),
    ],
)
def test_what_cannot_be_drawn_is_refused(picture: str, sentence: str, tmp_path: Path) -> None:
    (tmp_path / "case.yaml").write_text(CASE + f"picture: {picture}\n")
    with pytest.raises(InputError) as refused:
        load_cases(tmp_path / "case.yaml")
    assert sentence in str(refused.value)


def test_a_picture_needs_its_output(tmp_path: Path) -> None:
    (tmp_path / "case.yaml").write_text(CASE.replace("volume, picture", "volume") + "picture: {map: grey}\n")
    with pytest.raises(InputError, match="outputs has no picture; add it there, or leave this out"):
        load_cases(tmp_path / "case.yaml")


def test_pictures_of_an_earlier_run_go(folder: Path) -> None:
    own = folder.parent / "later"
    (own / "ball").mkdir(parents=True)
    (own / "ball" / "picture-old.png").write_text("old")
    (own / "ball" / "mine.png").write_text("mine")
    (folder.parent.parent / "later.yaml").write_text(CASE + "picture: {name: new}\n")
    (case,) = load_cases(folder.parent.parent / "later.yaml")
    run_case(case, own)
    assert {path.name for path in (own / "ball").glob("*.png")} == {"mine.png", "picture-new.png"}
