"""Case files: what they mean, and what is said of a wrong one."""

import json
import os
import re
from pathlib import Path

import pytest

from tetlux.cases.cli import main
from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.cases.shipped import library_folder
from tetlux.fem import PencilBeam, PointSource
from tetlux.meshing import InputError, box

GOOD = """\
name: plate
unit: cm
surface: {slab: {width: 6, depth: 1}}
medium:
  sigma_a: 1e-1
  sigma_s_prime: 10
  eta: 1.4
lights:
  - pencil: {origin: [0, 0, 2], direction: [0, 0, -1], power: 0.5}
  - point:
      position: [0, 0, -0.5]
tolerance: 0.05
outputs: [surface]
"""


def load(tmp_path: Path, text: str, name: str = "plate.yaml") -> list[Case]:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return load_cases(path)


def test_a_case_file_means_what_it_says(tmp_path: Path) -> None:
    (case,) = load(tmp_path, GOOD)
    assert case.name == "plate"
    assert case.surface.unit == "cm"
    assert case.surface.diagonal == pytest.approx(73**0.5)
    assert case.medium.sigma_a == 0.1
    assert case.lights == (
        PencilBeam((0.0, 0.0, 2.0), (0.0, 0.0, -1.0), power=0.5),
        PointSource((0.0, 0.0, -0.5)),
    )
    assert (case.tolerance, case.outputs) == (0.05, ("surface",))


def test_what_is_left_out_has_a_default(tmp_path: Path) -> None:
    text = "\n".join(line for line in GOOD.splitlines() if not re.match("name|unit|tol|out", line))
    (case,) = load(tmp_path, text.replace("6,", "60,").replace("h: 1}", "h: 10}"), "my plate.yaml")
    assert (case.name, case.surface.unit, case.tolerance) == ("my plate", "mm", 0.02)
    assert case.outputs == ("surface", "volume", "picture")


def test_a_surface_file_lies_beside_its_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import trimesh  # noqa: PLC0415

    cube = box((6.0, 6.0, 1.0))
    trimesh.Trimesh(cube.points, cube.faces).export(tmp_path / "cube.stl")
    monkeypatch.chdir("/")
    (case,) = load(tmp_path, GOOD.replace("{slab: {width: 6, depth: 1}}", "{file: cube.stl, scale: 2}"))
    assert case.surface.volume == pytest.approx(8 * 36)


def test_a_sweep_makes_a_grid(tmp_path: Path) -> None:
    text = GOOD + "sweep:\n  medium.sigma_a: [0.1, 0.2]\n  lights.0.pencil.power: [1, 2, 3]\n"
    cases = load(tmp_path, text)
    assert len(cases) == 6
    assert cases[4].name == "plate/medium.sigma_a=0.2,lights.0.pencil.power=2"
    assert cases[4].medium.sigma_a == 0.2
    assert isinstance(cases[4].lights[0], PencilBeam)
    assert cases[4].lights[0].power == 2.0
    assert cases[0].surface is cases[5].surface


def at(line: int) -> str:
    return rf"plate\.yaml, line {line}: "


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("  eta: 1.4", "  etta: 1.4", at(7) + r'medium\.etta: unknown key; did you mean "eta" \(refractive'),
        ("tolerance: 0.05", "speed: 3", at(12) + "speed: unknown key"),
        ("  sigma_a: 1e-1", "  sigma_a: -0.1", at(5) + r"medium\.sigma_a: sigma_a is -0\.1"),
        (
            "  sigma_a: 1e-1",
            "  sigma_a: lots",
            at(5) + r"medium\.sigma_a: expected a number, but found 'lots'",
        ),
        ("  sigma_a: 1e-1", "  sigma_a: yes", at(5) + r"medium\.sigma_a: expected a number, but found true"),
        ("  sigma_a: 1e-1", "  sigma_a: .nan", at(5) + r"medium\.sigma_a: .*finite"),
        ("  sigma_a: 1e-1\n", "", at(4) + r"medium\.sigma_a: this key is missing"),
        ("  eta: 1.4", "  eta: 1.4\n  sigma_s: 3", at(8) + r"medium\.sigma_s: .*given together"),
        ("  sigma_s_prime: 10", "  sigma_s: 10\n  g: 1.5", at(7) + r"medium\.g: g is 1\.5; .* less than 1"),
        (
            "slab: {width: 6, depth: 1}",
            "slab: {width: 6}",
            at(3) + r"surface\.slab\.depth: this key is missing",
        ),
        ("{slab: {width: 6, depth: 1}}", "{}", at(3) + "surface: give exactly one of file, .*not none"),
        ("depth: 1}}", "depth: 1}, sphere: {radius: 1}}", at(3) + "surface: .* not sphere and slab"),
        ("slab: {width: 6, depth: 1}", "file: none.stl", at(3) + r"surface: .*none\.stl does not exist"),
        ("unit: cm", "unit: furlong", at(2) + "unit: .*'furlong'"),
        ("unit: cm", "unit: cm\nunit: mm", at(3) + "unit: this key is given twice"),
        (
            "[0, 0, 2], direction",
            "[0, 2], direction",
            at(9) + r"lights\[0\]\.pencil\.origin\[2\]: expected a list of three",
        ),
        ("direction: [0, 0, -1]", "direction: [0, 0, 1]", at(9) + r"lights\[0\]: the beam .* misses the body"),
        (
            "position: [0, 0, -0.5]",
            "position: [0, 0, 7]",
            at(10) + r"lights\[1\]: the point source .* outside",
        ),
        ("power: 0.5", "power: 0", at(9) + r"lights\[0\]\.pencil\.power: power is 0"),
        ("depth: 1}", "depth: 1}, scale: 3", at(3) + "surface: scale applies to a surface file"),
        ("width: 6, depth: 1", "width: 0.02, depth: 0.01", "absurdly small for diffusion; check the unit"),
        ("width: 6, depth: 1", "width: 6e6, depth: 1e6", "absurdly large for diffusion; check the unit"),
        ("outputs: [surface]", "outputs: [movie]", at(13) + r"outputs\[0\]: .*'movie'"),
        ("tolerance: 0.05", "tolerance: 2", at(12) + "tolerance: expected a number less than 1, but found 2"),
        ("name: plate", "name: ../plate", at(1) + "name: "),
        ("outputs: [surface]", "outputs: [surface", "line 14: not valid YAML"),
        ("sigma_s_prime: 10", "sigma_s_prime: 0", at(4) + "medium: the medium does not scatter"),
        ("outputs: [surface]", "sweep: {medium.etta: [1]}", "unknown key"),
        (
            "outputs: [surface]",
            "sweep: {media.eta: [1]}",
            at(13) + r'sweep\.media\.eta: unknown key; did you mean "medium\.eta"\? write keys in full',
        ),
        ("outputs: [surface]", "sweep: {medium.eta: [1.4, 1.4]}", "a value is given twice"),
        (
            "outputs: [surface]",
            f"sweep: {{medium.eta: {list(range(1, 201))}, tolerance: {list(range(1, 201))}}}",
            "makes 40,000 runs",
        ),
        ("{slab: {width: 6, depth: 1}}", "3", r"surface: expected keys and values, but found 3"),
        ("outputs: [surface]", "sweep: {medium.eta: []}", at(13) + r"sweep\.medium\.eta"),
        ("outputs: [surface]", "sweep: {medium.eta: [-1]}", at(13) + r"medium\.eta: in the run .*=-1: eta is -1"),
        ("name: plate", "name: !!python/object/apply:os.system ['true']", "line 1: not valid YAML"),
    ],
)
def test_a_wrong_case_file_gets_one_sentence_with_line_and_key(
    old: str, new: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert old in GOOD
    (tmp_path / "plate.yaml").write_text(GOOD.replace(old, new), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["run", str(tmp_path / "plate.yaml"), "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert re.search(message, printed.err)
    assert printed.err.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"- a\n- b\n", "is not a mapping"),
        (b"\xff\xfe\x00", "not UTF-8"),
        (b"a: " + b"[" * 5000, "not valid YAML"),
        (b"a: &a [1]\nb: *c\n", "not valid YAML"),
        (b"a: \x00\n", "not valid YAML"),
        (b"a: " + b"x" * 2_000_000, "is 2 MB"),
        (
            b"a: &a [1,1,1,1,1,1,1,1]\nb: &b [*a,*a,*a,*a,*a,*a,*a,*a]\nc: &c [*b,*b,*b,*b,*b,*b,*b,*b]\n"
            b"d: &d [*c,*c,*c,*c,*c,*c,*c,*c]\ne: [*d,*d,*d,*d,*d,*d,*d,*d]\n",
            "10,000 keys",
        ),
        (b"? [a, b]\n: 1\n", "hashable|unknown key"),
        (b"a: 2001-99-99\n", "not valid YAML|unknown key"),
    ],
)
def test_files_that_are_no_case(content: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "case.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        load_cases(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_case_names_those_that_ship(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "unicorn"]) == 2
    assert (
        "unicorn is neither a file nor one of the shipped cases: candle, daylight, fibres, finger, finger-fit, hare, "
        "head, inclusion, laser, marble, slab, sphere, torus." in capsys.readouterr().err
    )
    assert main(["run", "no/such.yaml"]) == 2
    assert "no/such.yaml does not exist" in capsys.readouterr().err


def test_two_cases_of_one_name_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("a.yaml", "b.yaml"):
        (tmp_path / name).write_text(GOOD)
    assert main(["run", str(tmp_path / "a.yaml"), str(tmp_path / "b.yaml")]) == 2
    assert 'both make a case named "plate"' in capsys.readouterr().err


def test_check_says_which_case_files_can_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = tmp_path / "good.yaml", tmp_path / "bad.yaml"
    good.write_text(GOOD)
    bad.write_text(GOOD.replace("eta: 1.4", "eta: -1"))
    assert main(["check", str(good)]) == 0
    assert "good.yaml: ok: 12 triangles, 6 x 6 x 1 cm" in capsys.readouterr().out
    assert main(["check", str(bad), str(good)]) == 2
    printed = capsys.readouterr()
    assert "medium.eta: eta is -1" in printed.err
    assert "good.yaml: ok: 12 triangles" in printed.out


def test_every_case_that_ships_can_run() -> None:
    names = sorted(p.stem for p in library_folder().glob("*.yaml"))
    shipped = "candle daylight fibres finger finger-fit hare head inclusion laser marble slab sphere torus"
    assert names == shipped.split()
    assert main(["check", *names]) == 0


def test_the_schema_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert set(schema["required"]) == {"lights"}
    assert {"surface", "medium", "mesh"} <= set(schema["properties"])
    assert "sigma_s_prime" in schema["$defs"]["MediumSpec"]["properties"]


@pytest.mark.skipif(os.name != "posix", reason="needs a device file")
def test_a_device_is_no_case() -> None:
    with pytest.raises(InputError, match="is not a file"):
        load_cases(Path("/dev/zero"))


def test_a_crease_angle_of_nought_takes_triangles_as_they_are(tmp_path: Path) -> None:
    (round_,) = load(tmp_path, GOOD)
    (flat,) = load(tmp_path, GOOD.replace("depth: 1}}", "depth: 1}, crease_angle: 0}"))
    assert round_.surface.crease_angle == 30
    assert flat.surface.crease_angle == 0


@pytest.mark.parametrize("name", ["..yaml", "...yaml", "a\nb.yaml"])
def test_a_file_whose_name_makes_no_folder_needs_another(name: str, tmp_path: Path) -> None:
    """`...yaml` would be a case named `..`, and its results beside those of all others."""
    text = GOOD.replace("name: plate\n", "")
    assert load(tmp_path, GOOD, name)[0].name == "plate"
    with pytest.raises(InputError, match="name: this cannot be the name of a folder"):
        load(tmp_path, text, name)


def test_a_sweep_makes_folders_below_the_case_only(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    for file in (tmp_path / "b.off", tmp_path / "a" / "b.off"):
        cube = box((6.0, 6.0, 1.0))
        lines = ["OFF", "8 12 0", *(" ".join(map(str, p)) for p in cube.points)]
        file.write_text("\n".join([*lines, *("3 " + " ".join(map(str, f)) for f in cube.faces)]) + "\n")
    text = GOOD.replace("slab: {width: 6, depth: 1}", "file: b.off").replace("[0, 0, -0.5]", "[0, 0, 0]")
    cases = load(tmp_path, text + "sweep: {surface.file: [./b.off, ../" + tmp_path.name + "/b.off]}\n")
    assert [case.name for case in cases] == [
        "plate/surface.file=._b.off",
        f"plate/surface.file=.._{tmp_path.name}_b.off",
    ]
    cases = load(tmp_path, text + "sweep: {surface.file: [a/b.off, a//b.off, ./b.off]}\n")
    first, second, third = (case.name for case in cases)
    assert re.fullmatch(r"plate/surface\.file=a_b\.off", first)
    assert len({first, second, third}) == 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sweep: {lights.²: [1]}", r"sweep\.lights\.²: unknown key; lights is a list, whose items have numbers from 0"),
        ("sweep: {<<: {medium.eta: [1.4, -1]}}", r"line 13: medium\.eta: in the run medium\.eta=-1: eta is -1"),
        ("sweep: {medium.eta: [null]}", r"sweep\.medium\.eta: a value is missing"),
        ("outputs: !!set {surface}", r'line 13: not valid YAML: tags such as "!!set" are not allowed'),
        ("camera: 2001-01-01", r"camera: expected keys and values, but found '2001-01-01'"),
        ("camera: 0x" + "f" * 5000, "line 13: not valid YAML: this is no number, or too large; give one up to 1e308"),
        ("camera: " + "[" * 60 + "]" * 60, "nested more than 50 deep"),
        ("camera: &a {position: *a}", "an alias refers to a value that contains the alias"),
        ("? " + "x" * 2000 + "\n: 1", r"^.{,910}$"),
    ],
)
def test_odd_values_are_told_in_plain_words(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        load(tmp_path, GOOD.replace("outputs: [surface]\n", "") + text + "\n")
