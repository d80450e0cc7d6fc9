"""The viewer without a browser: what is in the page, and what is not."""

import hashlib
import json
import re
import webbrowser
from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.viewer_made import CASE, data_of, run_with_viewer, unpack
from tetlux.cases import viewer
from tetlux.cases.cli import main
from tetlux.cases.picture.colour_maps import color_table
from tetlux.cases.picture.scale import exitance_range
from tetlux.cases.viewer.pack import pack_bytes, pack_floats, pack_indices
from tetlux.meshing.arrays import FloatArray

HERE = Path(viewer.__file__).parent


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_with_viewer(tmp_path_factory.mktemp("viewer"))


@pytest.mark.parametrize(
    "values",
    [
        np.array([1e-300, 3e-295, 0.0, -2e-299]),
        np.array([1e200, np.nan, np.inf, 1.0]),
        np.zeros(3),
        np.full(2, np.nan),
        np.array([[1.0, 2.0, 3.0], [-4.0, 5.0, 6e-7]]),
        np.zeros((0, 3)),
    ],
)
def test_floats_are_packed_to_seven_digits_in_any_unit(values: FloatArray) -> None:
    packed = json.loads(json.dumps(pack_floats(values), allow_nan=False))
    np.testing.assert_allclose(unpack(packed), values, rtol=1.2e-7, atol=1e-38 * packed["factor"])


def test_indices_and_bytes_are_packed_as_they_are() -> None:
    rng = np.random.default_rng(1)
    indices = rng.integers(0, 70_000, (1000, 3))
    colours = rng.integers(0, 256, (1000, 3)).astype(np.uint8)
    assert np.array_equal(unpack(pack_indices(indices)), indices)
    assert np.array_equal(unpack(pack_bytes(colours)), colours)


def test_the_page_has_what_the_files_have(folder: Path) -> None:
    data, surface, volume = (
        data_of(folder / "viewer.html"),
        meshio.read(folder / "surface.ply"),
        meshio.read(folder / "volume.vtu"),
    )
    origin = np.array(data["origin"])
    np.testing.assert_allclose(unpack(data["points"]) + origin, surface.points, atol=1e-6)
    assert np.array_equal(unpack(data["triangles"]), surface.cells_dict["triangle"])
    found = {}
    for field in data["fields"]:
        parts = [field["quantity"], *(name for name in (field["light"], field["channel"]) if name != "all")]
        found["_".join(parts)] = unpack(field["values"])
    assert set(found) == set(surface.point_data)
    for name, values in found.items():
        np.testing.assert_allclose(values, surface.point_data[name], rtol=1e-6, err_msg=name)
    np.testing.assert_allclose(unpack(data["volume"]["points"]) + origin, volume.points, atol=1e-6)
    assert np.array_equal(unpack(data["volume"]["tetrahedra"]), volume.cells_dict["tetra"])
    fluence = {f"fluence_{field['channel']}": unpack(field["values"]) for field in data["volume"]["fields"]}
    for name, values in fluence.items():
        np.testing.assert_allclose(values, volume.point_data[name], rtol=1e-6, err_msg=name)


def test_colours_and_their_range_are_those_of_the_picture(folder: Path) -> None:
    data, exitance = data_of(folder / "viewer.html"), meshio.read(folder / "surface.ply").point_data["exitance"]
    assert (data["fields"][0]["quantity"], data["fields"][0]["unit"]) == ("exitance", "W/mm²")
    assert data["fields"][0]["ends"] == pytest.approx(exitance_range(np.asarray(exitance, dtype=float)))
    colours = [list(bytes.fromhex(colour)) for colour in data["maps"]["inferno"]]
    np.testing.assert_allclose(colours, 255 * color_table(), atol=0.51)


def test_detectors_have_their_readings(folder: Path) -> None:
    data = data_of(folder / "viewer.html")
    rows = json.loads((folder / "summary.json").read_text())["detectors"]
    shown = [
        (detector["name"], each["channel"], each["light"], each["exitance"], each["error"])
        for detector in data["detectors"]
        for each in detector["readings"]
    ]
    keys = ("name", "channel", "light", "exitance", "relative_error")
    assert sorted(shown) == sorted(tuple(row[key] for key in keys) for row in rows)
    assert np.add(data["detectors"][1]["place"], data["origin"]) == pytest.approx([104, 0, 0])


def test_the_page_asks_nothing_of_any_server(folder: Path) -> None:
    page = (folder / "viewer.html").read_text(encoding="utf-8")
    # A name of a kind of document, which nothing is loaded from, is all that is left.
    assert set(re.findall(r"(?:https?|wss?):?//[^\s\"'`)<>]*", page)) <= {"http://www.w3.org/1999/xhtml"}
    # The title, the data, and the script each end once.
    assert page.count("</script>") == 2
    assert not re.search(r"<link[^>]*href=\"(?!data:)|<script[^>]*src|@import|url\(", page)
    assert "default-src 'none'" in page
    assert len(page) < 1_000_000


def test_a_name_cannot_break_the_page(tmp_path: Path) -> None:
    name = "<!--<script>&amp;{{SCRIPT}}"
    text = CASE.removeprefix("name: block\n").replace("[surface, volume, viewer]", "[viewer]")
    folder = run_with_viewer(tmp_path, text, name)
    assert sorted(path.name for path in folder.iterdir()) == ["detectors.csv", "summary.json", "viewer.html"]
    page = (folder / "viewer.html").read_text(encoding="utf-8")
    assert data_of(folder / "viewer.html")["title"] == name
    assert "<title>&lt;!--&lt;script&gt;&amp;amp;{{SCRIPT}}</title>" in page
    assert name not in page
    assert page.count("three.js authors") == 1


def test_colours_of_the_phase_reach_its_largest_value(tmp_path: Path) -> None:
    case = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
modulation: {frequency: 300e6}
lights: [{point: {position: [0, 0, 6], power: 1.0}}]
tolerance: 0.3
outputs: [surface, viewer]
"""
    folder = run_with_viewer(tmp_path, case, "modulated")
    (phase,) = (field for field in data_of(folder / "viewer.html")["fields"] if field["quantity"] == "phase")
    shown = np.asarray(meshio.read(folder / "surface.ply").point_data["phase"])
    assert shown.max() > 20
    assert phase["ends"] == pytest.approx([0, shown.max()])


def test_the_script_is_built_from_its_source() -> None:
    # The source is not in the wheel.
    folder = Path(__file__).parents[1] / "cases/viewer/source"
    source = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(folder.iterdir())))
    script = (HERE / "viewer.min.js").read_text(encoding="utf-8")
    assert source.hexdigest() in script[:200], "run: cd cases/viewer && npm ci && npm run build"
    assert "The MIT License" in script[:500]
    assert "Copyright © 2010-2026 three.js authors" in script[:500]


def test_view_opens_the_page(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    opened: list[str] = []

    def browser(address: str) -> bool:
        opened.append(address)
        return True

    monkeypatch.setattr(webbrowser, "open", browser)
    assert main(["view", str(folder)]) == 0
    assert main(["view", str(folder / "viewer.html")]) == 0
    assert opened == [(folder / "viewer.html").resolve().as_uri()] * 2
    assert capsys.readouterr().out.splitlines() == [f"opened {folder / 'viewer.html'}"] * 2


def test_view_says_what_is_missing(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(webbrowser, "open", lambda _: False)
    asked = [tmp_path, tmp_path / "none", folder]
    sentences = [
        f"{tmp_path} has no viewer.html; add viewer to outputs in the case file, and run it again.",
        f"there is no folder {tmp_path / 'none'}; give the folder of a finished run.",
        f"no web browser was found; open {(folder / 'viewer.html').resolve()} in one.",
    ]
    for place, sentence in zip(asked, sentences, strict=True):
        assert main(["view", str(place)]) == 2
        assert capsys.readouterr().err == f"tetlux: {sentence}\n"
