"""What helps to write cases and to report trouble: ``tetlux new``, ``tetlux doctor``, the schema of shipped cases."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh
import yaml

from tests.conftest import needs
from tetlux.cases import doctor
from tetlux.cases.batch.display.displays import PlainDisplay, choose_display
from tetlux.cases.batch.display.lines import Lines
from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.cases.file.schema.case import CaseSpec
from tetlux.cases.shipped import SCHEMA, library_folder, schema_line
from tetlux.fem import PencilBeam


def test_a_new_case_runs_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "plate"]) == 0
    assert capsys.readouterr().out == "wrote plate.yaml; change it, then: tetlux run plate.yaml\n"
    assert main(["run", "plate.yaml", "--quiet"]) == 0
    assert {"surface.ply", "volume.vtu", "picture.png", "viewer.html"} < {
        path.name for path in Path("results/plate").iterdir()
    }


def test_what_a_new_case_has_in_comments_is_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    main(["new", "full.yaml"])
    text = Path("full.yaml").read_text()
    # Comments of more than words, other than those that replace a key that is there.
    wanted = ("regions", "  - name", "    surface", "    medium", "detectors", "  - {", "sweep")
    lines = [line[2:] if line.startswith("# ") and line[2:].startswith(wanted) else line for line in text.splitlines()]
    text = "\n".join(re.sub(r"^  # - ", "  - ", line) for line in lines)
    Path("full.yaml").write_text(text)
    assert {"regions", "detectors", "sweep"} <= yaml.safe_load(text).keys()
    cases = load_cases(Path("full.yaml"))
    assert len(cases) == 3
    assert len(cases[0].channels[0].lights) == 4
    for replaced in ("surface: {file", "up: [", "medium: {material", "tolerance: {"):
        assert f"# {replaced}" in text


@pytest.mark.parametrize("suffix", [".stl", ".obj"])
def test_a_new_case_of_a_surface_is_lit_from_above(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ring = trimesh.creation.torus(20.0, 4.0, major_sections=24, minor_sections=12)
    # A ring far from the origin: a beam through its middle misses it.
    ring.apply_translation([1000.0, -50.0, 7.0])
    if suffix == ".obj":
        ring.apply_scale(0.001)
    Path("of scans").mkdir()
    ring.export(f"of scans/ring{suffix}")
    assert main(["new", "mine", f"of scans/ring{suffix}"]) == 0
    (case,) = load_cases(Path("mine.yaml"))
    # A small one is taken to be in metres.
    assert case.surface.volume == pytest.approx(ring.volume * (1e9 if suffix == ".obj" else 1), rel=1e-3)
    assert "# The body is 48 x 48 x 8 mm" in Path("mine.yaml").read_text()
    # OBJ files mostly have y up.
    axis = 1 if suffix == ".obj" else 2
    assert case.up == tuple(float(each == axis) for each in range(3))
    (light,) = case.channels[0].lights.values()
    assert isinstance(light, PencilBeam)
    assert light.direction[axis] == -1


def test_a_new_case_of_an_open_scan_closes_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=10.0)
    ball.update_faces(ball.triangles_center[:, 2] > -6)
    ball.export("open.ply")
    assert main(["new", "mine", "open.ply"]) == 0
    (case,) = load_cases(Path("mine.yaml"))
    assert 3000 < case.surface.volume < 4200
    assert main(["new", "other", "missing.ply"]) == 2
    assert not Path("other.yaml").exists()


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("taken", "taken.yaml exists; take another name."),
        ("hare", '"hare" is a shipped case; take another name, or copy it: tetlux show hare > mine.yaml'),
        ("a?b", '"a?b" is no name of a case; use letters, digits, spaces and . + = , - _ in it.'),
        ("none/here", "none/here.yaml cannot be written: No such file or directory; take another name."),
    ],
)
def test_names_that_cannot_be_are_refused(
    name: str, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("taken.yaml").write_text("mine")
    assert main(["new", name]) == 2
    assert capsys.readouterr().err == f"tetlux: {sentence}\n"
    assert Path("taken.yaml").read_text() == "mine"


def test_shipped_cases_name_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    for path in library_folder().glob("*.yaml"):
        assert path.read_text().splitlines()[1] == f"# yaml-language-server: $schema={SCHEMA}", path
    shipped = json.loads((library_folder() / SCHEMA).read_text())
    now = CaseSpec.model_json_schema()
    assert shipped["properties"] == now["properties"], "run: tetlux schema > cases/library/case.schema.json"
    assert shipped["$defs"].keys() == now["$defs"].keys()
    main(["show", "hare"])
    assert capsys.readouterr().out.splitlines()[1] == schema_line()


def test_doctor_says_what_is_here_and_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TETLUX_CACHE_DIR", str(tmp_path))
    (tmp_path / "a.npz").write_bytes(bytes(2_000_000))
    monkeypatch.setitem(doctor.LIBRARIES, "no-such-library", "it is not there")
    monkeypatch.setattr(doctor, "ASK_OPENGL", "print('a card, OpenGL 4.5')")
    assert main(["doctor"]) == 0
    said = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.replace("mesh cache", "cache").splitlines())
    assert f"Python {sys.version.split()[0]}" in said["tetlux"]
    assert re.fullmatch(r"[\d.]+ GB are available", said["memory"])
    assert said["cache"] == f"{tmp_path}: 1 files, 2 of 1,000 MB"
    assert said["no-such-library"] == "missing: it is not there"
    assert said["OpenGL"] == "a card, OpenGL 4.5"
    monkeypatch.setattr(doctor, "ASK_OPENGL", "import os; os.abort()")
    main(["doctor"])
    assert "only solution.plot() does" in capsys.readouterr().out


def test_many_runs_are_printed_line_by_line_if_asked() -> None:
    assert type(choose_display(1000)) is PlainDisplay
    assert type(choose_display(1000, verbose=True)) is Lines


@needs("argcomplete")
def test_commands_are_completed(tmp_path: Path) -> None:
    words = tmp_path / "words"
    asked = {
        "_ARGCOMPLETE": "1",
        "COMP_LINE": "tetlux do",
        "COMP_POINT": "9",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(words),
    }
    subprocess.run([sys.executable, "-m", "tetlux"], env={**os.environ, **asked}, check=False, timeout=60)
    assert words.read_text().split() == ["doctor"]
