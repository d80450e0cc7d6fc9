"""The code in README and on the pages of docs."""

import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tests.meshes_made import cube_of_cubes
from tetlux.cases.cli import _parser, main
from tetlux.cases.file.load import load_cases
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.shipped import case_text
from tetlux.meshing import TetMesh
from tetlux.meshing.files.meshes import write_mesh

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", *(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md"))), "CONTRIBUTING.md")


def text_of(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text_of(page), flags=re.DOTALL)


@pytest.mark.slow
def test_the_python_lines_run_and_say_what_they_promise(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    first, second, third = blocks("docs/python.md", "python")
    names: dict[str, Any] = {}
    exec(first, names)
    solution = names["solution"]
    assert solution.exitance.shape == solution.mesh.boundary_nodes.shape
    # The series at 90 degrees, times the share of the power that is scattered; far from the light the mesh is
    # coarse, and over ten runs single points there were up to 3.6 % off.
    share = (1 - (0.4 / 2.4) ** 2) / 1.01
    assert solution.exitance_at([[0, 10, 0]])[0] == pytest.approx(8.764252e-5 * share, rel=0.06)
    assert solution.fluence_at([[0, 0, 5]])[0] > 0
    assert solution.error_estimate <= 0.02
    assert names["same"].mesh is names["mesh"]
    assert 0 < names["same"].error_estimate < 1
    exec(second, names)
    lit = names["lit"]
    assert len(lit.of_lights) == 2
    assert lit.power.exited == pytest.approx(sum(each.power.exited for each in lit.of_lights))
    assert names["halves"].power.balance_error == pytest.approx(0.0, abs=1e-9)
    # Marble is whiter in red than in blue.
    assert names["red"].power.exited > names["green"].power.exited > names["blue"].power.exited
    assert names["red"].mesh is names["blue"].mesh
    # Without drawing, for which the machine may have no OpenGL.
    exec(re.sub(r'screenshot="\w+.png"', "show=False", third), names)
    assert Path("ball.vtu").exists()


def test_the_case_file_is_right(tmp_path: Path) -> None:
    text, _, marble, head = blocks("docs/case-files.md", "yaml")
    (tmp_path / "plate.yaml").write_text(text)
    assert [case.name for case in load_cases(tmp_path / "plate.yaml")] == [
        f"plate/medium.sigma_a={value}" for value in (0.001, 0.01, 0.1)
    ]

    # The example of channels needs a surface only.
    (tmp_path / "marble.yaml").write_text("surface: {sphere: {radius: 5}}\n" + marble)
    (case,) = load_cases(tmp_path / "marble.yaml")
    assert case.channel_names == ("red", "green", "blue")

    # That of a mesh needs a light, and the mesh.
    points, tetrahedra, places = cube_of_cubes(2, 10.0)
    layers = np.where(places[:, 2] > 0, 1, 2)
    write_mesh(TetMesh(points, tetrahedra, regions=layers, labels={1: "scalp"}), tmp_path / "head.msh")
    (tmp_path / "head.yaml").write_text(head + "lights: [{diffuse: {irradiance: 1}}]\n")
    (case,) = load_cases(tmp_path / "head.yaml")
    assert case.mesh is not None
    assert case.mesh.region_volumes == pytest.approx({1: 4000.0, 2: 4000.0})


def test_a_sweep_ends_in_a_plot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas")
    _, sweep, *_ = blocks("docs/case-files.md", "yaml")
    monkeypatch.chdir(tmp_path)
    Path("probe.yaml").write_text(sweep)
    assert main(["run", "probe.yaml", "--quiet", "--jobs", "1"]) == 0
    names: dict[str, Any] = {}
    exec(blocks("docs/case-files.md", "python")[0], names)
    weak, strong = (line.get_ydata() for line in names["axes"].get_lines())
    # More absorption, less light; 5 mm away least where both are strong.
    assert (np.diff(weak) < 0).all()
    assert (np.diff(strong) < 0).all()
    assert strong[-1] < weak[-1]
    assert len(weak) == 4
    assert names["axes"].get_xlabel() == "absorption [1/mm]"
    assert {"results.csv", "readings.csv", "index.html", "logs", "probe"} <= {
        path.name for path in Path("results").iterdir()
    }


def test_every_key_of_the_case_file_is_explained() -> None:
    keys = set(re.findall(r"`([a-z0-9_.\[\]]+)`", text_of("docs/case-files.md")))
    for name in CaseSpec.model_fields:
        assert any(key == name or key.startswith((f"{name}.", f"{name}[")) for key in keys), name
    for section, prefixes in (
        ("SurfaceSpec", ["surface."]),
        ("MediumSpec", ["medium."]),
        ("MaterialSpec", ["medium."]),
        ("TissueSpec", ["medium."]),
        ("ChromophoresSpec", ["medium.chromophores."]),
        ("SubstanceSpec", ["medium.chromophores.others.name."]),
        ("ScatteringSpec", ["medium.scattering."]),
        ("PhaseSpec", ["medium.phase."]),
        ("TwoTermSpec", ["medium.phase.two_term."]),
        ("TableSpec", ["medium.phase.table."]),
        ("VolumeSpec", ["medium.sigma_a.volume."]),
        ("ImagesSpec", ["medium.sigma_a.images."]),
        ("ArraySpec", ["medium.sigma_a.array."]),
        ("MeshSpec", ["mesh."]),
        ("RegionSpec", ["regions[]."]),
        ("PencilSpec", ["lights[].pencil."]),
        ("PointSpec", ["lights[].point."]),
        ("DiffuseSpec", ["lights[].diffuse."]),
        ("CollimatedSpec", ["lights[].collimated."]),
        ("SpotSpec", ["lights[].collimated.spot."]),
        ("DiscSpec", ["lights[].collimated.spot.disc.", "detectors[].disc."]),
        ("RectangleSpec", ["lights[].collimated.spot.rectangle."]),
        ("ImageSpec", ["lights[].collimated.spot.image."]),
        ("EnvironmentSpec", ["lights[].environment."]),
        ("EmissionSpec", ["lights[].emission."]),
        ("DetectorSpec", ["detectors[]."]),
        ("FibreSpec", ["detectors[].fibre."]),
        ("CameraSpec", ["camera."]),
        ("ModulationSpec", ["modulation."]),
        ("PictureSpec", ["picture."]),
        ("CutSpec", ["picture.cut."]),
        ("FluorescenceSpec", ["fluorescence."]),
        ("DyeSpec", ["fluorescence.dyes[]."]),
        ("FitSpec", ["fit."]),
        ("FitReadingsSpec", ["fit.readings."]),
    ):
        for name in CaseSpec.model_json_schema()["$defs"][section]["properties"]:
            for prefix in prefixes:
                assert f"{prefix}{name}" in keys or any(k.startswith(f"{prefix}{name}.") for k in keys), prefix + name


def test_the_two_commands_are_there() -> None:
    install, check = blocks("README.md", "sh")
    assert install.strip().endswith("tetlux run hare")
    assert check.strip().endswith("python -m pytest")


def test_the_readme_is_short_and_its_code_runs(tmp_path: Path) -> None:
    assert len(text_of("README.md").encode()) <= 9_000
    (python,), (case,) = blocks("README.md", "python"), blocks("README.md", "yaml")
    names: dict[str, Any] = {}
    exec(python, names)
    assert names["solution"].readings[0].relative_error < 0.01
    (tmp_path / "plate.yaml").write_text(case)
    assert len(load_cases(tmp_path / "plate.yaml")) == 3


def test_the_start_and_the_recipes_run(tmp_path: Path) -> None:
    (python,) = blocks("docs/start.md", "python")
    exec(python, {})
    trimesh.creation.box((20.0, 30.0, 25.0)).export(tmp_path / "scan.stl")
    (tmp_path / "mine.yaml").write_text(blocks("docs/start.md", "yaml")[0])
    assert load_cases(tmp_path / "mine.yaml")[0].surface.volume == pytest.approx(15_000)
    fibres, fitted, tissue = blocks("docs/how-to.md", "yaml")
    (tmp_path / "fitted.yaml").write_text(fitted)
    assert load_cases(tmp_path / "fitted.yaml")[0].fit is not None
    (tmp_path / "fibres.yaml").write_text(fibres)
    assert load_cases(tmp_path / "fibres.yaml")[0].detector_tolerance == 0.01
    ball = "surface: {sphere: {radius: 20}}\nlights: [{diffuse: {irradiance: 1}}]\n"
    (tmp_path / "tissue.yaml").write_text(ball + tissue)
    assert len(load_cases(tmp_path / "tissue.yaml")[0].channels) == 2
    names: dict[str, Any] = {}
    exec(blocks("docs/how-to.md", "python")[0], names)
    assert names["found"].values == pytest.approx({"sigma_a": 0.02, "sigma_s_prime": 1.2}, rel=0.02)
    assert names["found"].undetermined == ()


def test_the_cases_of_the_how_to_pages_are_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("hare", "marble"):
        Path(f"{name}.yaml").write_text(case_text(name))
    for page, words in (("pictures", {"picture": 3}), ("rendering", {"outputs": 2})):
        text, *others = blocks(f"docs/{page}.md", "yaml")
        Path(f"{page}.yaml").write_text(text)
        (case,) = load_cases(Path(f"{page}.yaml"))
        assert {key: len(case.spec.model_dump()[key]) for key in words} == words
        for other in others:
            Path("other.yaml").write_text(other)
            assert load_cases(Path("other.yaml"))
    layers, head = blocks("docs/layers.md", "yaml")
    Path("layers.yaml").write_text(layers)
    assert [len(case.regions) for case in load_cases(Path("layers.yaml"))] == [2, 2]
    points, tetrahedra, places = cube_of_cubes(2, 10.0)
    write_mesh(TetMesh(points, tetrahedra, regions=np.where(places[:, 2] > 0, 1, 2)), Path("head.msh"))
    Path("head.yaml").write_text(head + "lights: [{diffuse: {irradiance: 1}}]\n")
    (case,) = load_cases(Path("head.yaml"))
    assert case.mesh is not None
    (text,) = blocks("docs/cluster.md", "yaml")
    Path("probe.yaml").write_text(text)
    assert len(load_cases(Path("probe.yaml"))) == 30
    (text,) = blocks("docs/scan.md", "yaml")
    Path("scan.yaml").write_text(text.replace("{file: scan.obj, scale: 1000, holes: close}", "{sphere: {radius: 80}}"))
    (case,) = load_cases(Path("scan.yaml"))
    assert case.up == (0.0, 1.0, 0.0)
    for key in ("file: scan.obj", "scale: 1000", "holes: close"):
        assert key in text


def test_the_line_of_exitance_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names: dict[str, Any] = {}
    exec(blocks("docs/pictures.md", "python")[0], names)
    weak, strong = (line.get_ydata() for line in names["axes"].get_lines())
    assert (strong < weak).all()
    assert Path("line.svg").exists()


# Blocks of each page that tests of this file run or read; a new one needs a test.
BLOCKS = {
    "README.md": {"python": 1, "yaml": 1},
    "docs/case-files.md": {"python": 1, "yaml": 4},
    "docs/cluster.md": {"yaml": 1},
    "docs/how-to.md": {"python": 1, "yaml": 3},
    "docs/layers.md": {"yaml": 2},
    "docs/pictures.md": {"python": 1, "yaml": 4},
    "docs/python.md": {"python": 3},
    "docs/rendering.md": {"yaml": 1},
    "docs/scan.md": {"yaml": 1},
    "docs/start.md": {"python": 1, "yaml": 1},
}


@pytest.mark.parametrize("page", PAGES)
def test_no_block_is_left_untested(page: str) -> None:
    found = {language: len(blocks(page, language)) for language in ("python", "yaml")}
    assert {language: count for language, count in found.items() if count} == BLOCKS.get(page, {})


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_pages_are_understood(page: str) -> None:
    commands = re.findall(r"(?:^|&& |bin/)tetlux ([^\n#&]+)", "\n".join(blocks(page, "sh")), flags=re.MULTILINE)
    for command in commands:
        assert _parser().parse_args(shlex.split(command)).command, command
    for name in re.findall(r"`tetlux ([a-z]+)", text_of(page)):
        with pytest.raises(SystemExit) as ended:
            _parser().parse_args([name, "--help"])
        assert ended.value.code == 0, name


@pytest.mark.parametrize("page", PAGES)
def test_pictures_of_pages_exist(page: str) -> None:
    for words, target in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", text_of(page)):
        assert ((ROOT / page).parent / target).is_file(), target
        assert len(words) > 15, f"say what {target} shows"


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_pages_and_headings_that_exist(page: str) -> None:
    for target in re.findall(r"\]\((?!https?:)([^)]+)\)", text_of(page)):
        path, _, heading = target.partition("#")
        place = (ROOT / page).parent / path if path else ROOT / page
        assert place.exists(), target
        if heading:
            headings = re.findall(r"^#+ (.+)$", place.read_text(encoding="utf-8"), flags=re.MULTILINE)
            assert heading in {re.sub(r"[^a-z0-9 -]", "", each.lower()).replace(" ", "-") for each in headings}, target
