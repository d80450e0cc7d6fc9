"""Media of case files: channels, materials, phase functions, fields and regions."""

import re
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh
from PIL import Image

from tests.conftest import block
from tetlux.cases.chart.benchmark import prepare_benchmark
from tetlux.cases.cli import main
from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.fem import Medium, PencilBeam, PointSource
from tetlux.fem.media.materials import material
from tetlux.fem.media.phase import henyey_greenstein, table, two_term
from tetlux.fem.media.varying import VaryingMedium
from tetlux.meshing import InputError, RunError, box
from tetlux.meshing.files.meshes import write_mesh

CUBE = """\
surface: {box: {size: [8, 8, 8]}}
medium: MEDIUM
lights:
  - point: {position: [0, 0, 0]}
"""
MARBLE = "{material: marble}"
TISSUE = "{sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}"

Load = Callable[..., Case]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    def loaded(medium: str = TISSUE, more: str = "") -> Case:
        (tmp_path / "cube.yaml").write_text(CUBE.replace("MEDIUM", medium) + more, encoding="utf-8")
        (case,) = load_cases(tmp_path / "cube.yaml")
        return case

    return loaded


def media(case: Case) -> list[object]:
    return [channel.medium for channel in case.channels]


def test_lists_make_channels(load: Load) -> None:
    lists = load("{sigma_a: [0.01, 0.02, 0.03], sigma_s_prime: [1, 2, 3], eta: 1.4}")
    assert lists.channel_names == ("red", "green", "blue")
    assert media(lists) == [Medium(sigma_a=0.01 * i, sigma_s_prime=float(i), eta=1.4) for i in (1, 2)] + [
        Medium(sigma_a=0.03, sigma_s_prime=3.0, eta=1.4)
    ]
    mappings = load("[{sigma_a: 0.01, sigma_s: 2, g: 0.5, eta: 1.4}, {sigma_a: 0.1, sigma_s_prime: 1, eta: 1.4}]")
    assert mappings.channel_names == ("1", "2")
    assert media(mappings) == [
        Medium(sigma_a=0.01, sigma_s=2.0, g=0.5, eta=1.4),
        Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4),
    ]
    named = load("{sigma_a: [0.01, 0.02], sigma_s_prime: 1, eta: 1.4}", "channels: [w633, w850]\n")
    assert named.channel_names == ("w633", "w850")
    assert load().channel_names == ("all",)
    # A single value stands for every channel, and so does a light's.
    assert load(more="channels: [a, b, c, d]\n").channels[3].lights == {"point_1": PointSource((0.0, 0.0, 0.0))}


def test_channels_may_be_wavelengths_as_numbers(load: Load) -> None:
    two = "{sigma_a: [0.01, 0.02], sigma_s_prime: 1, eta: 1.4}"
    assert load(two, "channels: [690, 832.5]\npicture: {channel: 832.5}\n").channel_names == ("690", "832.5")
    with pytest.raises(InputError, match=r"channels\[1\]: expected text, but found true"):
        load(two, "channels: [690, true]\n")
    with pytest.raises(InputError, match="channel"):
        load(two, "channels: [690, 830]\npicture: {channel: 800}\n")


def test_powers_make_channels_and_0_leaves_a_light_out(load: Load) -> None:
    case = load(more="  - {name: beam, pencil: {origin: [0, 0, 9], direction: [0, 0, -1], power: [2, 0]}}\n")
    assert case.light_names == ("point_1", "beam")
    assert [list(channel.lights) for channel in case.channels] == [["point_1", "beam"], ["point_1"]]
    assert case.channels[0].lights["beam"] == PencilBeam((0.0, 0.0, 9.0), (0.0, 0.0, -1.0), power=2.0)


def test_a_material_comes_in_the_unit_of_the_case(load: Load) -> None:
    case = load("{material: marble}", "unit: cm\n")
    assert media(case) == list(material("marble", unit="cm"))
    red = case.channels[0].medium
    assert isinstance(red, Medium)
    assert red.sigma_s_prime == pytest.approx(21.9)
    assert case.channel_names == ("red", "green", "blue")


@pytest.mark.parametrize(
    ("phase", "expected"),
    [
        ("{henyey_greenstein: 0.8}", henyey_greenstein(0.8)),
        ("{two_term: {g1: 0.9, g2: -0.3, share: 0.95}}", two_term(0.9, -0.3, 0.95)),
        ("{table: {angles: [0, 90, 180], values: [0.12, 0.08, 0.0391549]}}", None),
    ],
)
def test_phase_functions(load: Load, phase: str, expected: object) -> None:
    (medium,) = media(load(f"{{sigma_a: 0.01, sigma_s: 10, phase: {phase}, eta: 1.4}}"))
    assert isinstance(medium, Medium)
    assert medium.phase == (expected or table([0, 90, 180], [0.12, 0.08, 0.0391549]))


def test_a_field_from_an_array(load: Load, tmp_path: Path) -> None:
    x = np.linspace(-5.0, 5.0, 11)
    np.save(tmp_path / "x.npy", np.broadcast_to(0.05 + 0.01 * x[:, None, None], (11, 11, 11)))
    field = "{array: {file: x.npy, origin: [-5, -5, -5], spacing: 1}}"
    (medium,) = media(load(f"{{sigma_a: {field}, sigma_s_prime: 1, eta: 1.4}}"))
    assert isinstance(medium, VaryingMedium)
    # The corners of the cube lie at x = -4 and 4, as many here as there.
    assert medium.base.sigma_a == pytest.approx(0.05)
    assert medium.base.sigma_s_prime == 1.0
    sigma_a, sigma_s_prime = medium.at(np.array([[2.5, 0.0, 0.0]]))
    assert (sigma_a[0], sigma_s_prime[0]) == (pytest.approx(0.075), 1.0)


def test_a_field_from_images(load: Load, tmp_path: Path) -> None:
    (tmp_path / "slices").mkdir()
    for number, grey in enumerate((0, 255)):
        Image.new("L", (10, 10), grey).save(tmp_path / "slices" / f"{number}.png")
    field = "{images: {files: slices, origin: [-4.5, -4.5, -2.5], spacing: [1, 1, 5], values: [1, 3]}}"
    (medium,) = media(load(f"{{sigma_a: 0.01, sigma_s_prime: {field}, eta: 1.4}}"))
    assert isinstance(medium, VaryingMedium)
    assert medium.at(np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 2.5]]))[1] == pytest.approx([2.0, 3.0])


def test_a_field_from_a_volume_and_channels_beside_it(load: Load, tmp_path: Path) -> None:
    mesh = block((2, 2, 2), (10.0, 10.0, 10.0))
    moved = type(mesh)(mesh.points + np.array([0.0, 0.0, 5.0]), mesh.tetrahedra)
    write_mesh(moved, tmp_path / "body.vtu", {"absorption": 0.02 + 0.001 * moved.points[:, 2]})
    field = "{volume: {file: body.vtu, name: absorption}}"
    first, second = media(load(f"{{sigma_a: {field}, sigma_s_prime: [1, 2], eta: 1.4}}"))
    assert isinstance(first, VaryingMedium)
    assert isinstance(second, VaryingMedium)
    assert (first.base.sigma_s_prime, second.base.sigma_s_prime) == (1.0, 2.0)
    assert first.sigma_a is second.sigma_a
    assert second.at(np.array([[0.0, 0.0, 3.0]]))[0] == pytest.approx([0.023])


REGIONS = """\
regions:
  - name: stone
    surface: {sphere: {radius: 2}}
    medium: {sigma_a: [0.1, 0.2], sigma_s_prime: 1, eta: 1.4}
  - {surface: {box: {size: [1, 1, 1], center: [3, 0, 0]}}, medium: MEDIUM}
"""


def test_regions_have_media_for_every_channel(load: Load) -> None:
    case = load(more=REGIONS.replace("MEDIUM", TISSUE) + "  \n")
    assert len(case.channels) == 2
    stone, cube = case.regions
    assert stone.surface.volume == pytest.approx(4 / 3 * np.pi * 8, rel=0.01)
    assert stone.medium == (
        Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4),
        Medium(sigma_a=0.2, sigma_s_prime=1.0, eta=1.4),
    )
    assert cube.medium == (Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4),) * 2
    assert not case.has_single_medium


def absorbing(field: str) -> str:
    return f"{{sigma_a: {{{field}}}, sigma_s_prime: 1, eta: 1.4}}"


def ball(medium: str = TISSUE, *, radius: float = 1, name: str = "ball") -> str:
    return f"regions: [{{name: {name}, surface: {{sphere: {{radius: {radius}}}}}, medium: {medium}}}]\n"


WRONG = [
    (
        "{sigma_a: [0.1, 0.2], sigma_s_prime: [1, 2, 3], eta: 1.4}",
        "",
        r"line 2: medium\.sigma_s_prime: .*3 channels, and",
    ),
    (
        "{sigma_a: [0.1, 0.2], sigma_s_prime: 1, eta: 1.4}",
        "channels: [a, b, c]\n",
        r"medium\.sigma_a: .*2 channels, and channels makes 3",
    ),
    (
        "{material: marble}",
        "channels: [a]\n",
        r"medium\.material: this makes 3 channels, and channels makes 1 channel;",
    ),
    ("{material: marbel}", "", r'medium\.material: material "marbel" is not known; did you mean "marble"'),
    ("{material: marble, eta: 1.3}", "", r"medium\.eta: unknown key; the keys here are material"),
    (TISSUE, "channels: [a, a]\n", r'line 5: channels\[1\]: the name "a" is given twice'),
    (TISSUE, "channels: [blue, green, red]\n", "channels: give red, green and blue in this order"),
    (TISSUE, "channels: ['a b']\n", r"channels\[0\]: expected a name of letters"),
    ("{sigma_a: [], sigma_s_prime: 1, eta: 1.4}", "", r"medium\.sigma_a: give at least one"),
    (
        "{sigma_a: [0.1, many], sigma_s_prime: 1, eta: 1.4}",
        "",
        r"medium\.sigma_a\[1\]: expected a number, but found 'many'",
    ),
    ("{sigma_a: [0.1, -2], sigma_s_prime: 1, eta: 1.4}", "", r"medium\.sigma_a: sigma_a is -2"),
    ("[{sigma_a: 0.1, sigma_s_prime: 1}]", "", r"medium\[0\]\.eta: this key is missing"),
    ("[{sigma_a: 0.1, sigma_s_prime: 1, eta: 99}]", "", r"medium\[0\]\.eta: eta is 99"),
    ("{sigma_a: 0.1, sigma_s: 1, phase: {henyey_greenstein: 2}, eta: 1.4}", "", r"medium\.phase: g is 2"),
    ("{sigma_a: 0.1, sigma_s: 1, phase: {}, eta: 1.4}", "", r"medium\.phase: give exactly one of henyey_greenstein"),
    (
        "{sigma_a: 0.1, sigma_s: 1, g: 0, phase: {henyey_greenstein: 0}, eta: 1.4}",
        "",
        r"medium\.g: g is given together",
    ),
    (
        absorbing("array: {file: no.npy, origin: [0, 0, 0], spacing: 1}"),
        "",
        r"medium\.sigma_a: .*no\.npy does not exist",
    ),
    (
        absorbing("array: {file: one.npy, origin: [0, 0, 0], spacing: 1}"),
        "",
        r"line 2: medium\.sigma_a: the grid from .* does not cover the body",
    ),
    (absorbing("array: {file: below.npy, origin: [-4, -4, -4], spacing: 8}"), "", r"medium\.sigma_a: sigma_a is -1 at"),
    (
        absorbing("images: {files: a, origin: [0, 0, 0], spacing: 1, values: [1]}"),
        "",
        r"sigma_a\.images\.values\[1\]: expected a list of two numbers",
    ),
    (
        absorbing("array: {file: one.npy, origin: [0, 0, 0], spacing: [1, 1]}"),
        "",
        r"sigma_a\.array\.spacing\[2\]: expected a list of three numbers",
    ),
    (TISSUE, ball(radius=9), r"line 5: regions: .*region 1 \(ball\)"),
    (
        TISSUE,
        ball("{sigma_a: 1, sigma_s_prime: 1, eta: 1.2}"),
        r"regions\[0\]\.medium: a region's refractive index of 1\.2",
    ),
    (TISSUE, ball(radius=-1), r"regions\[0\]\.surface\.sphere\.radius: expected a number greater than 0"),
    (
        TISSUE,
        ball("{sigma_a: [1, 2], sigma_s_prime: [1, 2, 3], eta: 1.4}"),
        r"regions\[0\]\.medium\.sigma_s_prime: .*3 channels",
    ),
    (TISSUE, ball(name="body"), r'regions\[0\]: "body" is'),
    (TISSUE, "channels: [a, b]\ncompare: [series]\n", "compare: closed forms exist for one channel"),
    (TISSUE, ball() + "compare: [robin]\n", "compare: closed forms exist for one channel"),
]


@pytest.mark.parametrize(("medium", "more", "message"), WRONG)
def test_a_wrong_medium_gets_one_sentence(
    medium: str, more: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save(tmp_path / "one.npy", np.ones((2, 2, 2)))
    np.save(tmp_path / "below.npy", np.where(np.indices((2, 2, 2))[0] == 0, -1.0, 3.0))
    (tmp_path / "cube.yaml").write_text(CUBE.replace("MEDIUM", medium) + more)
    assert main(["run", str(tmp_path / "cube.yaml"), "--out", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr()
    assert re.search(message, printed.err), printed.err
    assert printed.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_chart_is_of_simple_cases_only(load: Load) -> None:
    for case in (load("{material: marble}"), load(more=ball())):
        with pytest.raises(RunError, match="a chart needs one channel and one uniform medium"):
            prepare_benchmark(case, quick=True)


def test_repairs_of_a_region_bear_its_name(load: Load, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    inner = box((2.0, 2.0, 2.0))
    soup = trimesh.Trimesh(inner.points[inner.faces].reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False)
    soup.faces[0] = soup.faces[0][::-1]
    soup.export(tmp_path / "inner.ply")
    case = load("{material: marble}", f"regions: [{{name: stone, surface: {{file: inner.ply}}, medium: {MARBLE}}}]\n")
    assert case.surface.repairs == ()
    assert len(case.repairs) > 0
    assert all(note.startswith("stone: ") for note in case.repairs)
    assert main(["check", str(tmp_path / "cube.yaml")]) == 0
    printed = capsys.readouterr().out
    assert "ok: channels red, green, blue; 12 triangles, 8 x 8 x 8 mm" in printed
    assert f"  {case.repairs[0]}" in printed


def test_a_list_is_swept_by_the_number_of_its_item(tmp_path: Path) -> None:
    text = CUBE.replace("MEDIUM", "{sigma_a: [0.1, 0.2], sigma_s_prime: 1, eta: 1.4}")
    (tmp_path / "cube.yaml").write_text(text + "sweep: {medium.sigma_a.1: [0.3, 0.4]}\n")
    cases = load_cases(tmp_path / "cube.yaml")
    assert [case.channels[1].medium for case in cases] == [
        Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4) for sigma_a in (0.3, 0.4)
    ]


def test_a_volume_of_another_array_says_which_there_are(load: Load, tmp_path: Path) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    meshio.Mesh(points, [("tetra", [[0, 1, 2, 3]])], point_data={"mu": np.ones(4)}).write(tmp_path / "one.vtu")
    with pytest.raises(InputError, match=r'medium\.sigma_a: .*holds no array "nu"; the arrays there are: mu'):
        load("{sigma_a: {volume: {file: one.vtu, name: nu}}, sigma_s_prime: 1, eta: 1.4}")
