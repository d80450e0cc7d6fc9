"""Runs: what they write, whole or not at all."""

import json
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from PIL import Image

from tetlux.cases import run
from tetlux.cases.batch import grouping, workshop
from tetlux.cases.cli import main
from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.cases.run import run_case
from tetlux.cases.shipped import find_case_file
from tetlux.fem.exact import slab
from tetlux.fem.solve_scenes import solve_each
from tetlux.meshing import RunError
from tetlux.meshing.files.meshes import read_mesh

QUICK = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 2.0}
tolerance: 0.1
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of one finished run, in a folder with a space in its name."""
    folder = tmp_path_factory.mktemp("a run")
    (folder / "ball.yaml").write_text(QUICK)
    assert main(["run", str(folder / "ball.yaml"), "--out", str(folder / "the results")]) == 0
    return folder / "the results" / "ball"


@pytest.fixture
def case(tmp_path: Path) -> Case:
    (tmp_path / "ball.yaml").write_text(QUICK)
    return load_cases(tmp_path / "ball.yaml")[0]


def test_a_run_writes_its_files_and_no_others(finished: Path) -> None:
    names = ["picture.png", "summary.json", "surface.ply", "surface.vtp", "volume.vtu"]
    assert sorted(p.name for p in finished.iterdir()) == names


def test_the_summary_holds_what_it_promises(finished: Path) -> None:
    summary = json.loads((finished / "summary.json").read_text())
    assert {k: summary[k] for k in ("case", "unit", "model", "tolerance")} == {
        "case": "ball", "unit": "mm", "model": "fem", "tolerance": 0.1,
    }  # fmt: skip
    assert set(summary["mesh"]) == {"nodes", "tetrahedra", "volume", "area", "surface_deviation", "min_quality"}
    assert summary["mesh"]["volume"] == pytest.approx(4 / 3 * np.pi * 1000, rel=0.05)
    assert 0 < summary["mesh"]["surface_deviation"] < 0.4
    (channel,) = summary["channels"]
    assert channel["name"] == "all"
    assert channel["sigma_tr"] == pytest.approx(0.174069, rel=1e-5)
    assert channel["albedo"] == pytest.approx(1 / 1.01)
    (medium,) = channel["media"]
    assert medium.pop("name") == "body"
    expected_medium = {"sigma_a": 0.01, "sigma_s_prime": 1.0, "sigma_tr": 0.174069, "albedo": 1 / 1.01}
    assert {name: medium[name] for name in expected_medium} == pytest.approx(expected_medium, rel=1e-5)
    assert (medium["eta"], medium["boundary"]) == (1.4, "exact")
    power = channel["power"]
    assert power["incident"] == 2.0
    assert abs(power["balance_error"]) < 1e-9
    # 2 W, less the specular share, times the reduced albedo, times the series' total.
    expected = 2 * (1 - (0.4 / 2.4) ** 2) / 1.01 * 0.79095
    assert power["exited"] == pytest.approx(expected, rel=0.01)
    assert channel["exitance"]["mean"] * summary["mesh"]["area"] == pytest.approx(power["exited"], rel=1e-9)
    assert 0 < channel["exitance"]["min"] < channel["exitance"]["mean"] < channel["exitance"]["max"]
    # At nodes, none of which need lie where the exitance is largest.
    assert channel["fluence"]["max"] > 2 * 2.948 * channel["exitance"]["mean"]
    assert 0 < channel["error_estimate"] <= 0.1
    *stages, total = summary["seconds"]
    assert (*stages, total) == ("start", "surface", "mesh", "assemble", "solve", "write", "total")
    assert sum(summary["seconds"][stage] for stage in stages) == pytest.approx(summary["seconds"]["total"], abs=1e-3)
    (near,) = summary["warnings"]
    assert near.startswith("within 2 mean free paths of where light enters")
    validity = channel["validity"]
    assert validity["albedo"] == pytest.approx(channel["albedo"])
    assert validity["least_thickness_in_mean_free_paths"] == pytest.approx(20 * 1.01, rel=0.03)
    assert validity["share_thin"] == 0.0
    # A cap of a height of 2 by 20 mean free paths, on a mesh that has some twenty facets there.
    assert validity["share_near_light"] == pytest.approx((2 / 10.1) ** 2 / 4, rel=0.3)
    assert 0.2 < validity["least_valid"] < 0.8
    assert 0.9 < validity["mean_valid"] < 0.99
    assert summary["versions"]["tetlux"]


def test_the_surface_and_volume_files_hold_the_solution(finished: Path) -> None:
    summary = json.loads((finished / "summary.json").read_text())
    surface = meshio.read(finished / "surface.ply")
    exitance = surface.point_data["exitance"]
    assert exitance.max() == pytest.approx(summary["channels"][0]["exitance"]["max"])
    assert surface.points[exitance.argmax()] == pytest.approx([0, 0, 10], abs=0.5)
    valid = surface.point_data["valid"]
    assert surface.points[valid.argmin()] == pytest.approx([0, 0, 10], abs=0.5)
    assert 0.2 < valid.min() < 0.4
    assert valid.max() > 0.95
    volume = meshio.read(finished / "volume.vtu")
    assert volume.point_data["fluence"].max() == pytest.approx(summary["channels"][0]["fluence"]["max"])
    assert len(read_mesh(finished / "volume.vtu").tetrahedra) == summary["mesh"]["tetrahedra"]


def test_warnings_are_printed_and_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "dark.yaml").write_text(
        QUICK.replace("sigma_a: 0.01", "sigma_a: 0.15").replace("0.1\n", "0.9\n") + "outputs: []\n"
    )
    assert main(["run", str(tmp_path / "dark.yaml"), "--out", str(tmp_path / "out")]) == 0
    assert "note: the reduced albedo is 0.87" in capsys.readouterr().out
    summary = json.loads((tmp_path / "out" / "dark" / "summary.json").read_text())
    assert "the reduced albedo is 0.87" in summary["warnings"][0]


def test_what_holds_for_a_sweep_is_said_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ball.yaml").write_text(QUICK + "outputs: []\nsweep: {medium.sigma_a: [0.01, 0.02, 0.03, 0.04]}\n")
    (tmp_path / "alone.yaml").write_text(QUICK + "outputs: []\n")

    def pretend(case: Case, out: Path, *_: object, **__: object) -> run.FinishedCase:
        if "0.03" in case.name:
            raise RunError("no luck")
        return run.FinishedCase(out, {}, ["of every run", *(["of one run"] if "0.02" in case.name else [])], [])

    monkeypatch.setattr(workshop, "finish_case", pretend)
    monkeypatch.setattr(grouping, "FEWEST_TO_SHARE", 99)
    here = ["--jobs", "1", "--out", str(tmp_path / "o")]
    assert main(["run", str(tmp_path / "ball.yaml"), str(tmp_path / "alone.yaml"), *here]) == 1
    lines = capsys.readouterr().out.splitlines()
    notes = [line for line in lines if "of every run" in line or "of one run" in line]
    assert notes[0].startswith("note, in 3 of 4 runs (ball/")
    assert notes[1] == "note, in 1 of 4 runs (ball/medium.sigma_a=0.02): of one run"
    assert notes[2].endswith("s  note: of every run")
    assert len(notes) == 3
    monkeypatch.setattr(
        workshop, "finish_case", lambda case, out, *_, **__: run.FinishedCase(out, {}, ["of every run"], [])
    )
    assert main(["run", str(tmp_path / "ball.yaml"), *here]) == 0
    (said,) = [line for line in capsys.readouterr().out.splitlines() if "of every run" in line]
    assert said == "note, in all 4 runs: of every run"


def test_progress_is_printed_for_each_stage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "ball.yaml").write_text(QUICK + "outputs: []\n")
    assert main(["run", str(tmp_path / "ball.yaml"), "--out", str(tmp_path / "out")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "[1/1] ball"
    for word in ("tetrahedralized", "solved on", "estimated error", "written to"):
        assert any(word in line for line in lines)
    assert [p.name for p in (tmp_path / "out" / "ball").iterdir()] == ["summary.json"]


def test_a_run_replaces_the_files_of_an_earlier_one(case: Case, tmp_path: Path) -> None:
    target = tmp_path / "out" / "ball"
    target.mkdir(parents=True)
    for name in ("picture.png", "volume.vtu", "summary.json"):
        (target / name).write_text("old")
    (target / "notes.txt").write_text("mine")
    run_case(replace(case, outputs=("surface",)), tmp_path / "out")
    assert sorted(p.name for p in target.iterdir()) == ["notes.txt", "summary.json", "surface.ply", "surface.vtp"]


def test_a_fault_while_writing_leaves_no_half_result(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(run, "write_mesh", full)
    with pytest.raises(RunError, match="No space left on device; make room, or choose another folder"):
        run_case(case, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


def test_a_failing_case_does_not_stop_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def failing(surface: object, *rest: object, **options: object) -> object:
        if surface.name == "box":  # type: ignore[attr-defined]
            raise RunError("the mesher failed.")
        return solve_each(surface, *rest, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("tetlux.cases.solve.solve_each", failing)
    (tmp_path / "a.yaml").write_text(QUICK.replace("sphere: {radius: 10}", "box: {size: [9, 9, 9]}"))
    (tmp_path / "b.yaml").write_text(QUICK + "outputs: [surface]\n")
    assert main(["run", str(tmp_path / "a.yaml"), str(tmp_path / "b.yaml"), "--out", str(tmp_path / "out")]) == 1
    printed = capsys.readouterr()
    assert "a failed: the mesher failed." in printed.err
    assert "1 of 2 cases failed" in printed.err
    assert (tmp_path / "out" / "b" / "summary.json").exists()
    assert not (tmp_path / "out" / "a").exists()


def test_a_working_directory_without_write_permission_is_enough(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    locked = tmp_path / "locked"
    locked.mkdir()
    locked.chmod(0o555)
    monkeypatch.chdir(locked)
    run_case(replace(case, outputs=()), tmp_path / "out")
    assert list(locked.iterdir()) == []


def test_an_output_folder_that_cannot_be_made(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("in the way")
    assert main(["run", str(case.source), "--out", str(tmp_path / "file" / "out")]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "choose another folder with --out" in printed.err
    with pytest.raises(RunError, match="results cannot be written to"):
        run_case(replace(case, outputs=()), tmp_path / "file")


def test_a_warning_of_some_channels_names_them(tmp_path: Path) -> None:
    (tmp_path / "two.yaml").write_text(
        "surface: {box: {size: [9, 9, 9]}}\nmedium: {sigma_a: [0.01, 0.3], sigma_s_prime: 1, eta: 1.4}\n"
        "channels: [clear, dark]\nlights: [{point: {position: [0, 0, 0]}}]\ntolerance: 0.5\noutputs: []\n"
    )
    folder = run_case(load_cases(tmp_path / "two.yaml")[0], tmp_path / "out")
    warnings = json.loads((folder / "summary.json").read_text())["warnings"]
    assert [w for w in warnings if "albedo" in w] == [
        w for w in warnings if w.startswith("in dark: the reduced albedo")
    ]
    assert len([w for w in warnings if "albedo" in w]) == 1


def test_regions_fields_and_surroundings_run(tmp_path: Path) -> None:
    """A region and a field of the same coefficients as the body change nothing, and even surroundings are diffuse."""
    np.save(tmp_path / "even.npy", np.full((2, 2, 2), 0.02))
    Image.new("L", (128, 64), 255).save(tmp_path / "sky.png")
    field = "{array: {file: even.npy, origin: [-4, -4, -4], spacing: 8}}"
    medium = "{sigma_a: 0.02, sigma_s_prime: 1, eta: 1.4}"
    text = (
        f"surface: {{box: {{size: [8, 8, 8]}}}}\nmedium: {medium}\ntolerance: 0.1\noutputs: [volume]\n"
        "lights: [{diffuse: {irradiance: 0.5}}]\n"
    )
    region = f"regions: [{{surface: {{sphere: {{radius: 2}}}}, medium: {medium}}}]\n"
    sky = "environment: {file: sky.png, brightest: 0.15915494}"
    others = {
        "plain": text,
        "region": text + region,
        "field": text.replace("sigma_a: 0.02", f"sigma_a: {field}"),
        "sky": text.replace("diffuse: {irradiance: 0.5}", sky),
    }
    exited, regions = {}, {}
    for name, content in others.items():
        (tmp_path / f"{name}.yaml").write_text(content)
        folder = run_case(load_cases(tmp_path / f"{name}.yaml")[0], tmp_path / "out")
        (channel,) = json.loads((folder / "summary.json").read_text())["channels"]
        exited[name] = channel["power"]["exited"]
        regions[name] = meshio.read(folder / "volume.vtu").cell_data.get("region")
    for name in ("region", "field", "sky"):
        assert exited[name] == pytest.approx(exited["plain"], rel=0.02), name
    assert regions["plain"] is None
    assert set(np.unique(regions["region"])) == {0, 1}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["slab", "torus", "hare"])
def test_the_cases_that_ship_run(name: str, tmp_path: Path) -> None:
    (case,) = load_cases(find_case_file(name))
    folder = run_case(replace(case, outputs=()), tmp_path)
    summary = json.loads((folder / "summary.json").read_text())
    (channel,) = summary["channels"]
    assert abs(channel["power"]["balance_error"]) < 1e-9
    assert channel["error_estimate"] <= 0.02
    # But for where the beam enters, and the hare's ears, all of it is well within what diffusion is good for.
    *thin, near = summary["warnings"]
    assert near.startswith("within 2 mean free paths of where light enters")
    assert ["bounds parts thinner than 4" in warning for warning in thin] == [True] * (name == "hare")
    if name == "slab":
        thickness, depth = 10.0, case.medium.mean_free_path
        front = slab.point_total(case.medium, thickness=thickness, depth=depth)
        back = slab.point_total(case.medium, thickness=thickness, depth=depth, face="back")
        scattered = case.medium.albedo * (1 - channel["power"]["specular"])
        # The plate ends 30 mm from the beam, five decay lengths: its rim takes less than 0.1 %.
        assert channel["power"]["exited"] == pytest.approx(scattered * (front + back), rel=0.004)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["marble", "laser", "inclusion", "candle"])
def test_the_cases_of_new_lights_and_media_run(name: str, tmp_path: Path) -> None:
    (case,) = load_cases(find_case_file(name))
    folder = run_case(replace(case, outputs=("surface",)), tmp_path)
    summary = json.loads((folder / "summary.json").read_text())
    for channel in summary["channels"]:
        assert abs(channel["power"]["balance_error"]) < 1e-9
        assert channel["error_estimate"] <= case.tolerance
    # The ball in the plate absorbs more than diffusion likes, and a laser's spot is small: the run says so.
    said = {"inclusion": ["ball: the reduced albedo is 0.8, be"], "laser": ["within 2 mean free paths of where l"]}
    assert [warning[:35] for warning in summary["warnings"]] == said.get(name, [])
    power = [channel["power"] for channel in summary["channels"]]
    values = meshio.read(folder / "surface.ply").point_data
    if name == "marble":
        # Marble absorbs blue light most and red light least, and little of any.
        lost = [one["absorbed"] / (one["incident"] - one["specular"]) for one in power]
        assert 0.02 < lost[0] < lost[1] < lost[2] < 0.2
        assert (values["exitance_sun"] < 0.3 * values["exitance_sky"]).any()
    if name == "laser":
        assert power[0]["incident"] == pytest.approx(0.01, rel=2e-3)
        # At 45 degrees 3.66 % are reflected at an index of 1.4.
        assert power[0]["specular"] == pytest.approx(0.0366 * 0.01, rel=0.02)
        read = [one["power"] for one in summary["detectors"]]
        assert len(read) == 10
        # Far from the light r² M falls like exp(-sigma_tr r): here from 8 to 10 mm.
        decay = np.log((read[6] * 8**2) / (read[8] * 10**2)) / 2
        # Single places in the dark depend on where nodes come to lie: measured .34 to .45 for .42.
        assert decay == pytest.approx(summary["channels"][0]["sigma_tr"], rel=0.35)
    if name == "inclusion":
        above, opposite = (one["exitance"] for one in summary["detectors"])
        assert above == pytest.approx(0.83 * opposite, rel=0.03)
    if name == "candle":
        emitted = 4 / 3 * np.pi * 4**3 * np.array([0.004, 0.0026, 0.0012])
        lights = [channel["lights"][0]["power"]["incident"] for channel in summary["channels"]]
        # Of the drop as it is given, whose 5,120 facets lie 0.2 % inside the ball, and not of its coarse mesh.
        assert lights == pytest.approx(emitted, rel=3e-3)
        glow = [values[f"exitance_emission_1_{channel}"] for channel in ("red", "green", "blue")]
        assert glow[0].max() > glow[1].max() > glow[2].max()


def test_no_cache_means_no_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TETLUX_CACHE_DIR", str(tmp_path / "cache"))
    case = tmp_path / "ball.yaml"
    case.write_text(
        "surface: {sphere: {radius: 5}}\nmedium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}\n"
        "lights: [{point: {position: [0, 0, 0]}}]\ntolerance: 0.3\noutputs: [surface]\n"
    )
    assert main(["run", str(case), "--out", str(tmp_path / "out"), "--no-cache"]) == 0
    assert not list(tmp_path.glob("cache/**/*.npz"))
    assert main(["run", str(case), "--out", str(tmp_path / "out")]) == 0
    assert len(list(tmp_path.glob("cache/**/*.npz"))) == 1
