"""Sweeps, shared defaults and patterns: what runs they make, and what is said of wrong ones."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tetlux.cases.cli import main
from tetlux.cases.file.case import Case
from tetlux.cases.file.documents.document import Document
from tetlux.cases.file.load import load_cases
from tetlux.cases.file.schema.sweep import SweepSpec
from tetlux.cases.file.sweeps.names import LONGEST_LABEL, RESERVED, folder_names, identity
from tetlux.cases.file.sweeps.points import sweep_points
from tetlux.cases.shipped import find_case_files
from tetlux.fem import PencilBeam
from tetlux.meshing import InputError

CASE = """\
surface: {box: {size: [20, 20, 20]}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights: [{pencil: {origin: [0, 0, 20], direction: [0, 0, -1]}}]
detectors: [{name: here, point: [10, 0, 0]}]
tolerance: 0.02
outputs: []
"""


def load(tmp_path: Path, sweep: str, case: str = CASE) -> list[Case]:
    path = tmp_path / "ball.yaml"
    path.write_text(f"{case}sweep: {sweep}\n", encoding="utf-8")
    return load_cases(path)


def swept(cases: list[Case], key: str) -> list[object]:
    return [case.sweep_values[key] for case in cases]


def test_a_range_has_both_ends_and_even_steps(tmp_path: Path) -> None:
    cases = load(tmp_path, "{medium.sigma_a: {start: 0.1, stop: 0.4, num: 4}}")
    assert swept(cases, "medium.sigma_a") == [0.1, 0.2, 0.3, 0.4]
    assert [case.name for case in cases] == [f"ball/medium.sigma_a={v}" for v in (0.1, 0.2, 0.3, 0.4)]
    cases = load(tmp_path, "{medium.sigma_a: {start: 1, stop: 0.001, num: 4, scale: log}}")
    assert swept(cases, "medium.sigma_a") == [1.0, 0.1, 0.01, 0.001]
    assert [case.medium.sigma_a for case in cases] == [1.0, 0.1, 0.01, 0.001]


def test_zipped_lists_go_together_and_make_a_grid_with_the_rest(tmp_path: Path) -> None:
    cases = load(
        tmp_path,
        "{medium.eta: [1.3, 1.4], zip: {medium.sigma_a: [0.1, 0.2], "
        "lights.0.pencil.power: {start: 1, stop: 3, num: 2}}}",
    )
    values = [tuple(case.sweep_values.values()) for case in cases]
    assert values == [(1.3, 0.1, 1.0), (1.3, 0.2, 3.0), (1.4, 0.1, 1.0), (1.4, 0.2, 3.0)]
    assert [case.lights[0] for case in cases][1] == PencilBeam((0, 0, 20), (0, 0, -1), power=3.0)


def test_lists_and_sections_are_values_too(tmp_path: Path) -> None:
    cases = load(
        tmp_path,
        "{lights.0.pencil.origin: [[0, 0, 20], [1, 0, 20]], "
        "surface: [{sphere: {radius: 10}}, {box: {size: [20, 19, 18]}}], "
        "medium: [{material: marble}, {sigma_a: [0.1, 0.2], sigma_s_prime: 2, eta: 1.3}]}",
    )
    assert len(cases) == 8
    assert re.fullmatch(
        r"ball/lights\.0\.pencil\.origin=0_0_20,surface=sphere-[0-9a-f]{12},medium=material_marble-[0-9a-f]{12}",
        cases[0].name,
    )
    assert isinstance(cases[4].lights[0], PencilBeam)
    assert cases[4].lights[0].origin == (1.0, 0.0, 20.0)
    assert {len(case.channels) for case in cases} == {2, 3}
    assert len({case.surface.volume for case in cases}) == 2
    # A key within a section that is swept as a whole.
    inner = load(tmp_path, "{medium.eta: [1.3, 1.5], medium: [{sigma_a: 0.1, sigma_s_prime: 2, eta: 1}]}")
    assert [case.medium.eta for case in inner] == [1.3, 1.5]


def test_a_latin_hypercube_has_one_point_in_each_part_of_each_range(tmp_path: Path) -> None:
    text = (
        "{sample: {method: lhs, size: 20, seed: SEED, medium.sigma_a: {start: 0.001, stop: 0.1, scale: log}, "
        "medium.sigma_s_prime: {start: 0.5, stop: 2.5}, medium.eta: [1.3, 1.4]}}"
    )
    cases = load(tmp_path, text.replace("SEED", "1"))
    assert [case.name for case in cases] == [f"ball/sample={i:02d}" for i in range(1, 21)]
    absorption = np.array([case.medium.sigma_a for case in cases])
    scattering = np.array([case.medium.sigma_s_prime for case in cases])
    assert sorted(np.floor(20 * np.log(absorption / 0.001) / np.log(100)).astype(int)) == list(range(20))
    assert sorted(np.floor(20 * (scattering - 0.5) / 2).astype(int)) == list(range(20))
    # The two values of a list are drawn ten times each.
    assert sorted(case.medium.eta for case in cases) == [1.3] * 10 + [1.4] * 10
    again = load(tmp_path, text.replace("SEED", "1"))
    assert [case.sweep_values for case in again] == [case.sweep_values for case in cases]
    other = load(tmp_path, text.replace("SEED", "2"))
    assert [case.sweep_values for case in other] != [case.sweep_values for case in cases]
    random = load(tmp_path, text.replace("SEED", "1").replace("lhs", "random"))
    parts = np.floor(20 * (np.array([case.medium.sigma_s_prime for case in random]) - 0.5) / 2)
    assert parts.min() >= 0
    assert parts.max() < 20
    assert len(set(parts)) < 20


def test_what_is_left_out_of_a_case_can_be_swept(tmp_path: Path) -> None:
    cases = load(tmp_path, "{tolerance.detectors: [0.1, 0.05]}")
    assert [(case.tolerance, case.detector_tolerance) for case in cases] == [(0.02, 0.1), (0.02, 0.05)]
    cases = load(tmp_path, "{tolerance.detectors: [0.1]}", CASE.replace("tolerance: 0.02\n", ""))
    assert [(case.tolerance, case.detector_tolerance) for case in cases] == [(0.02, 0.1)]
    cases = load(tmp_path, "{camera.azimuth: [0, 90], up.2: [0.5], surface.box.center.0: [-1]}")
    assert [case.spec.camera and case.spec.camera.azimuth for case in cases] == [0.0, 90.0]
    assert cases[0].spec.up == (0.0, 0.0, 0.5)
    assert cases[0].spec.surface is not None
    assert cases[0].spec.surface.box is not None
    assert cases[0].spec.surface.box.center == (-1.0, 0.0, 0.0)


def test_a_surface_is_read_once_for_all_runs(tmp_path: Path) -> None:
    cases = load(tmp_path, "{medium.sigma_a: {start: 0.001, stop: 0.1, num: 10}, medium.eta: [1.3, 1.4]}")
    assert len(cases) == 20
    assert len({id(case.surface) for case in cases}) == 1


def test_a_region_is_one_object_for_all_runs(tmp_path: Path) -> None:
    region = "regions: [{surface: {sphere: {radius: 2}}, medium: {sigma_a: 0.1, sigma_s_prime: 1.0, eta: 1.4}}]\n"
    cases = load(tmp_path, "{regions.0.medium.sigma_a: [0.1, 0.2], medium.sigma_a: [0.01, 0.02]}", CASE + region)
    assert len({id(case.regions[0].surface) for case in cases}) == 1
    assert len({repr(case.regions[0].medium) for case in cases}) == 2


@pytest.mark.parametrize(
    ("sweep", "sentence"),
    [
        ("{lights.0.pencil.origin.0: [0, 0.5, 11]}", "misses the body"),
        ("{lights.0.pencil.origin.2: [20, 9]}", "starts inside the body"),
        ("{surface.box.size.0: [20, 30], lights.0.pencil.origin.0: [0, 12]}", "misses the body"),
        ("{surface.box.size.0: [20, 4], zip: {lights.0.pencil.origin.0: [5]}}", "misses the body"),
        ("{lights.0: [{diffuse: {irradiance: 1}}], medium.boundary: [exact, classic]}", 'needs the boundary "exact"'),
        ("{surface.box.size.0: [20, 3], regions: [[{surface: {sphere: {radius: 2}}, medium: {sigma_a: 0.1, "
         "sigma_s_prime: 1, eta: 1.4}}]]}", "region"),
    ],
)  # fmt: skip
def test_a_light_or_region_that_fits_the_first_run_only_is_refused(sweep: str, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=sentence):
        load(tmp_path, sweep, CASE.replace("detectors: [{name: here, point: [10, 0, 0]}]\n", ""))


@pytest.mark.parametrize(
    ("sweep", "sentence"),
    [
        ("{medium.sigma_aa: [1]}", 'sweep.medium.sigma_aa: unknown key; did you mean "medium.sigma_a"?'),
        ("{sigma_a: [1]}", 'sweep.sigma_a: unknown key; did you mean "medium.sigma_a"?'),
        ("{sample: {size: 2, sigma: {start: 1, stop: 2}}}",
         'sweep.sample.sigma: unknown key; did you mean "medium.sig'),
        ("{zip: {Medium.sigma_a: [1]}}", 'sweep.zip.Medium.sigma_a: unknown key; did you mean "medium.sigma_a"?'),
        ("{'lights[0].pencil.power': [1]}", 'unknown key; write "lights.0.pencil.power".'),
        ("{lights.pencil.power: [1]}",
         "unknown key; lights is a list, whose items have numbers from 0, as in lights.0."),
        ("{lights.1.pencil.power: [1]}", "unknown key; lights has one item, 0, here."),
        ("{regions.0.medium.sigma_a: [1]}", "unknown key; regions has no items here."),
        ("{lights.0.pencil.power.watts: [1]}", "unknown key; lights.0.pencil.power is a single value."),
        ("{medium.sigma_a.1: [1]}", "unknown key; medium.sigma_a is a single value, so it has no 1."),
        ("{sweep: [1]}", "sweep.sweep: unknown key;"),
        ("{base: [a.yaml]}", "sweep.base: unknown key;"),
        ("{medium.eta: []}", "sweep.medium.eta: give at least one, but found []."),
        ("{zip: {}}", "sweep.zip: give at least one, but found {}."),
        ("{medium: [{eta: 1}]}", "medium.sigma_a: in the run medium=eta-"),
        ("{medium.eta: 3}", "sweep.medium.eta: give a list of values, or a range as in {start: 1, stop: 100, num: 5,"),
        ("{medium.eta: {start: 1, stop: 2, num: 0}}", "sweep.medium.eta.num: expected a number greater than or equal"),
        ("{medium.eta: {start: 1, stop: 2, num: 1}}", "sweep.medium.eta.num: expected a number greater than or equal"),
        ("{medium.eta: {start: 1, stop: 2, num: 2.5}}",
         "sweep.medium.eta.num: expected a whole number, but found 2.5."),
        ("{medium.eta: {start: 1, stop: 2}}", "sweep.medium.eta.num: this key is missing"),
        ("{medium.eta: {start: 1, stop: 1, num: 3}}",
         "this range is empty, since start and stop are equal; give a list."),
        ("{medium.eta: {start: -1, stop: 1, num: 3, scale: log}}",
         "a range of scale log has no 0 and no negative numb"),
        ("{medium.eta: {start: 1, stop: 2, num: 3, scale: logg}}", 'scale: did you mean "log"?'),
        ("{medium.eta: {from: 1, stop: 2, num: 3}}", "sweep.medium.eta.from: unknown key; "),
        ("{zip: {medium.eta: [1, 2], medium.sigma_a: [1, 2, 3]}}",
         "sweep.zip.medium.sigma_a: this has 3 values, and medium.eta has 2; give lists of one length."),
        ("{zip: {medium.eta: [1, 1], medium.sigma_a: [2, 2]}}", "sweep.zip: the same values are given twice"),
        ("{medium.eta: [1, 1.0]}", "sweep.medium.eta: a value is given twice; give each once."),
        ("{medium.eta: [1, 2], zip: {medium.eta: [1]}}", "sweep.zip.medium.eta: medium.eta is swept twice"),
        ("{sample: {size: 0, medium.eta: {start: 1, stop: 2}}}",
         "sweep.sample.size: expected a number greater than or"),
        ("{sample: {medium.eta: {start: 1, stop: 2}}}", "sweep.sample.size: this key is missing"),
        ("{sample: {size: 2, seed: -1, medium.eta: {start: 1, stop: 2}}}",
         "sweep.sample.seed: expected a number great"),
        ("{sample: {size: 2, method: lsh, medium.eta: {start: 1, stop: 2}}}",
         'sweep.sample.method: did you mean "lhs"?'),
        ("{sample: {size: 2, medium.eta: [1, 2]}}", "sweep.sample: no key has a range to draw from; give one"),
        ("{sample: {size: 2, medium.eta: {start: 1, stop: 2, num: 3}}}", "sweep.sample.medium.eta.num: unknown key;"),
        ("{sample: {size: 300, medium.eta: {start: 1, stop: 2}}, medium.sigma_a: {start: 1, stop: 2, num: 100}}",
         "sweep: this sweep makes 30,000 runs; give at most 20,000 at once."),
        ("[1, 2]", "sweep: expected keys and values"),
        ("{zip: [1]}", "sweep.zip: expected keys and values"),
        ("{sample: 3}", "sweep.sample: expected keys and values"),
    ],
)  # fmt: skip
def test_a_wrong_sweep_is_refused_before_anything_starts(
    sweep: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "ball.yaml").write_text(f"{CASE}sweep: {sweep}\n", encoding="utf-8")
    out = tmp_path / "out"
    assert main(["run", str(tmp_path / "ball.yaml"), "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "ball.yaml, line 7: " in printed.err
    assert sentence in printed.err
    assert printed.err.count("\n") == 1
    assert not out.exists()


plain = st.recursive(
    st.integers() | st.floats() | st.text(max_size=50) | st.booleans(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=2),
    max_leaves=6,
)


@given(st.lists(st.dictionaries(st.text(min_size=1, max_size=30), plain, min_size=1, max_size=4), max_size=6))
@settings(max_examples=50, suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_names_of_folders_are_short_portable_and_different(points: list[dict[str, object]]) -> None:
    different = list({identity(point): point for point in points}.values())
    names = folder_names(different)
    for name in names:
        assert 0 < len(name.encode(errors="replace")) <= LONGEST_LABEL + 13
        assert name.isprintable()
        assert not set(RESERVED) & set(name)
        assert not name.endswith((" ", "."))
    assert len({name.casefold() for name in names}) == len(names)


def test_names_that_differ_in_case_only_get_hashes() -> None:
    names = folder_names([{"surface.file": name} for name in ("A.stl", "a.stl", "b/c.stl", "b_c.stl", "d.stl")])
    assert [re.sub(r"-[0-9a-f]{12}$", "-hash", name.partition("=")[2]) for name in names] == [
        "A.stl-hash", "a.stl-hash", "b_c.stl-hash", "b_c.stl-hash", "d.stl",
    ]  # fmt: skip
    assert len({name.casefold() for name in names}) == 5


@given(
    start=st.floats(1e-9, 1e9),
    ratio=st.floats(1.001, 1e6),
    num=st.integers(2, 60),
    scale=st.sampled_from(["linear", "log"]),
    down=st.booleans(),
)
@settings(max_examples=100, deadline=None)
def test_a_range_is_monotonous_and_within_its_ends(
    start: float, ratio: float, num: int, scale: str, down: bool
) -> None:
    ends = [start, start * ratio][:: -1 if down else 1]
    axis = {"start": ends[0], "stop": ends[1], "num": num, "scale": scale}
    points, _ = sweep_points(Document(Path("a.yaml"), {}, {}), SweepSpec.model_validate({"medium.eta": axis}))
    values = np.array([point["medium.eta"] for point in points])
    assert [values[0], values[-1]] == ends
    assert (np.diff(values) < 0).all() if down else (np.diff(values) > 0).all()
    steps = np.diff(np.log(values) if scale == "log" else values)
    assert steps == pytest.approx(np.full(num - 1, steps.mean()), rel=1e-4)


def test_a_base_gives_what_a_case_leaves_out(tmp_path: Path) -> None:
    (tmp_path / "shared").mkdir()
    cube = ["OFF", "4 4 0", "0 0 0", "9 0 0", "0 9 0", "0 0 9", "3 0 2 1", "3 0 1 3", "3 0 3 2", "3 1 2 3"]
    (tmp_path / "shared" / "body.off").write_text("\n".join(cube) + "\n")
    (tmp_path / "shared" / "common.yaml").write_text(
        "name: common\nunit: cm\nsurface: {file: body.off}\nmedium: {sigma_a: 0.01, sigma_s_prime: 9, eta: 1.4}\n"
        "lights: [{point: {position: [1, 1, 1]}}]\ntolerance: 0.3\n"
    )
    (tmp_path / "own.yaml").write_text("base: shared/common.yaml\nmedium: {sigma_a: 0.5}\n")
    (case,) = load_cases(tmp_path / "own.yaml")
    assert (case.name, case.surface.unit, case.tolerance) == ("own", "cm", 0.3)
    assert (case.medium.sigma_a, case.medium.sigma_s_prime) == (0.5, 9.0)
    assert case.surface.volume == pytest.approx(9**3 / 6)
    # A base of a base, another kind of surface and of medium, and a key that is dropped.
    (tmp_path / "more.yaml").write_text(
        "base: own.yaml\nsurface: {sphere: {radius: 3}}\nmedium: {sigma_s: 20, g: 0.5}\nunit:\n"
        "tolerance: {detectors: 0.1}\ndetectors: [{name: here, point: [3, 0, 0]}]\n"
    )
    (case,) = load_cases(tmp_path / "more.yaml")
    assert case.surface.unit == "mm"
    assert case.medium.sigma_s == 20.0
    assert (case.tolerance, case.detector_tolerance) == (0.3, 0.1)
    # Errors name the file in which the key stands.
    (tmp_path / "bad.yaml").write_text("base: shared/common.yaml\nmedium: {eta: -1}\n")
    with pytest.raises(InputError, match=r"bad\.yaml, line 2: medium\.eta: eta is -1"):
        load_cases(tmp_path / "bad.yaml")
    (tmp_path / "bad.yaml").write_text("base: shared/common.yaml\ndetectors: [{name: a, point: [0, 0, 0]}]\nmodel: x\n")
    with pytest.raises(InputError, match=r"bad\.yaml, line 3: model"):
        load_cases(tmp_path / "bad.yaml")
    with (tmp_path / "shared" / "common.yaml").open("a") as file:
        file.write("speed: 3\n")
    with pytest.raises(InputError, match=r"shared.common\.yaml, line 7: speed: unknown key"):
        load_cases(tmp_path / "own.yaml")


def test_a_sweep_in_a_base_is_of_files_beside_the_base(tmp_path: Path) -> None:
    test_a_base_gives_what_a_case_leaves_out(tmp_path)
    (tmp_path / "shared" / "common.yaml").write_text(
        CASE.replace("{box: {size: [20, 20, 20]}}", "{file: body.off}").replace("detectors", "#")
        + "sweep: {surface.file: [body.off]}\n"
    )
    (tmp_path / "own.yaml").write_text(
        "base: shared/common.yaml\nlights: [{point: {position: [1, 1, 1]}}]\nsweep: {medium.eta: [1.3, 1.4]}\n"
    )
    cases = load_cases(tmp_path / "own.yaml")
    assert [case.name for case in cases] == [f"own/medium.eta={n},surface.file=shared_body.off" for n in (1.3, 1.4)]


@pytest.mark.parametrize(
    ("files", "sentence"),
    [
        ({"a": "base: a.yaml\n"}, "a.yaml, line 1: base: a.yaml includes itself; name another file."),
        ({"a": "base: b.yaml\n", "b": "base: ./a.yaml\n"}, "base: ./a.yaml includes itself by way of other files;"),
        ({"a": "base: none.yaml\n"}, "none.yaml does not exist; check its path."),
        ({"a": "base: .\n"}, "is not a file; give a YAML case file."),
        ({"a": "base: b.yaml\n", "b": "- 1\n"}, "b.yaml is not a mapping; give keys and values."),
        ({"a": "base: 3\n"}, "a.yaml, line 1: base: expected the name of another case file."),
        ({"a": "base: [b.yaml]\n"}, "a.yaml, line 1: base: expected the name of another case file."),
        ({"a": "base: b.yaml\n", "b": "unit: mm\n"}, "lights: this key is missing; the case needs it."),
        ({"a": f"x: 1\nbase: {'y' * 300}\n"}, "a.yaml, line 2: base: "),
    ],
)  # fmt: skip
def test_a_wrong_base_is_refused(
    files: dict[str, str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in files.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    assert main(["check", str(tmp_path / "a.yaml")]) == 2
    printed = capsys.readouterr().err
    assert sentence in printed
    assert printed.count("\n") == 1


def test_patterns_name_many_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("one.yaml", "two.yml", "deep/three.yaml", "deep/er/four.json", "body.stl", "[x].yaml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(CASE if name != "deep/er/four.json" else "{}")
    monkeypatch.chdir(tmp_path)
    assert find_case_files("*.y*ml") == [Path("[x].yaml"), Path("one.yaml"), Path("two.yml")]
    assert find_case_files("o*") == [Path("one.yaml")]
    assert find_case_files("**/*.yaml") == [Path("[x].yaml"), Path("deep/three.yaml"), Path("one.yaml")]
    assert find_case_files(str(tmp_path / "deep" / "**" / "*")) == [
        tmp_path / "deep" / "er" / "four.json",
        tmp_path / "deep" / "three.yaml",
    ]
    # A file whose name looks like a pattern.
    assert find_case_files("[x].yaml") == [Path("[x].yaml")]
    assert find_case_files("sphere")[0].name == "sphere.yaml"
    for pattern in ("three*.yaml", "*.stl", "none/*"):
        assert main(["run", pattern]) == 2
        assert f"{pattern} matches no case file; " in capsys.readouterr().err
    assert main(["check", "o*.yaml"]) == 0
    # Through a pattern and by its name.
    assert main(["run", "one.yaml", "o*.yaml"]) == 2
    assert "one.yaml is given twice" in capsys.readouterr().err
