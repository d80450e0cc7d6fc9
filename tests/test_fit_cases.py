"""Fits and sensitivities in case files: what is found and written, and what is refused."""

import csv
import json
from pathlib import Path

import meshio
import numpy as np
import pytest

from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.cases.file.measured.table import Names, read_table
from tetlux.cases.results.rows import result_rows
from tetlux.fem import Medium, PencilBeam, PointDetector, solve
from tetlux.meshing import InputError, sphere

PLACES = {"near": (6.0, 0.0, 8.0), "side": (10.0, 0.0, 0.0), "far": (8.0, 0.0, -6.0)}
TRUTH = Medium(sigma_a=0.02, sigma_s_prime=1.1, eta=1.4)
CASE = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.015, sigma_s_prime: 1.3, eta: 1.4}
lights: [{pencil: {origin: [0, 0, 20], direction: [0, 0, -1]}}]
detectors:
  - {name: near, point: [6, 0, 8]}
  - {name: side, point: [10, 0, 0]}
  - {name: far, point: [8, 0, -6]}
tolerance: {detectors: 0.05}
"""
FIT = "fit: {unknowns: [sigma_a, sigma_s_prime], readings: {values: [1e-3, 8e-5, 4e-5]}, noise: 0.02}\n"
NAMES = Names(("all",), ("front", "back"), ("near", "side"))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fit to what charges read of other coefficients, with sensitivities."""
    folder = tmp_path_factory.mktemp("fit")
    beam, there = PencilBeam((0, 0, 20), (0, 0, -1)), [PointDetector(place) for place in PLACES.values()]
    read = solve(sphere(10.0), TRUTH, [beam], model="charges", detectors=there, detector_tolerance=0.005).readings
    rows = [f"{name},{reading.exitance}" for name, reading in zip(PLACES, read, strict=True)]
    (folder / "measured.csv").write_text("\n".join(["Name,Exitance [W/mm^2]", *rows]) + "\n")
    fit = FIT.replace("{values: [1e-3, 8e-5, 4e-5]}", "{file: measured.csv}")
    (folder / "ball.yaml").write_text(CASE + fit + "outputs: [volume, sensitivity]\n")
    assert main(["run", str(folder / "ball.yaml"), "--out", str(folder / "out"), "--quiet", "--jobs", "1"]) == 0
    return folder / "out" / "ball"


@pytest.mark.slow
def test_coefficients_are_found(finished: Path) -> None:
    data = json.loads((finished / "fit.json").read_text())
    for name, truth in (("sigma_a", 0.02), ("sigma_s_prime", 1.1)):
        row = data["values"][name]
        assert row["value"] == pytest.approx(truth, rel=0.02)
        # Two unknowns and three readings: errors are a few times the noise.
        assert 0.02 < row["error"] / truth < 0.2
    assert data["values"]["sigma_a"]["start"] == 0.015
    assert np.diag(data["correlation"]) == pytest.approx([1.0, 1.0])
    assert -1.0 < data["correlation"][0][1] < -0.5
    assert data["undetermined"] == []
    assert data["misfit"] < 0.5


def test_what_is_written_is_of_the_fitted_body(finished: Path) -> None:
    summary = json.loads((finished / "summary.json").read_text())
    value = summary["fit"]["values"]["sigma_a"]["value"]
    assert summary["channels"][0]["media"][0]["sigma_a"] == value
    assert summary["as_ran"]["scene"]["medium"]["sigma_a"] == 0.015
    with (finished / "fit.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == list(PLACES)
    read = [row["exitance"] for row in summary["detectors"]]
    assert [float(row["fitted [W/mm²]"]) for row in rows] == pytest.approx(read, rel=0.01)
    assert (finished / "fit.png").stat().st_size > 10_000
    (row,) = result_rows(summary)
    assert row["found.sigma_a"] == value
    assert row["found.sigma_a.error"] == summary["fit"]["values"]["sigma_a"]["error"]


def test_sensitivities_are_written(finished: Path) -> None:
    """Rows by node in one file, the same by volume on the mesh, and path lengths at detectors."""
    rows = np.load(finished / "sensitivity.npz")
    assert list(rows["detectors"]) == list(PLACES)
    mesh = meshio.read(finished / "volume.vtu")
    assert rows["sigma_a"].shape == (1, 3, len(mesh.points))
    corners = mesh.points[mesh.cells_dict["tetra"]]
    sizes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
    volumes = np.bincount(mesh.cells_dict["tetra"].ravel(), np.repeat(sizes / 4.0, 4))
    for number, name in enumerate(PLACES):
        for coefficient in ("sigma_a", "sigma_s_prime"):
            field = mesh.point_data[f"sensitivity_{coefficient}_{name}"]
            assert field * volumes == pytest.approx(rows[coefficient][0, number], rel=1e-5, abs=1e-12)
    summary = json.loads((finished / "summary.json").read_text())
    side = next(row for row in summary["detectors"] if row["name"] == "side")
    slopes = rows["sigma_a"][0, 1].sum() / rows["readings"][0, 1]
    # Absorption changes the depth and power of the light too, by a mean free path or two of 50.
    assert side["path_lengths"]["body"] == pytest.approx(-slopes, rel=0.05)


def check_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "case.yaml").write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        load_cases(tmp_path / "case.yaml")
    assert "\n" not in str(caught.value)
    assert "line " in str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ("[sigma_a, sigma_s_prime]", "[hbo2]"),
            'fit.unknowns: "hbo2" is no unknown of this fit; give some of sigma_a',
        ),
        (("[sigma_a, sigma_s_prime]", "[bone.sigma_a]"), 'fit.unknowns: "bone.sigma_a" is no unknown'),
        (("[sigma_a, sigma_s_prime]", "[gain, gain]"), 'fit.unknowns: the unknown "gain" is given twice'),
        (("[sigma_a, sigma_s_prime]", "[]"), "fit.unknowns: give at least one"),
        (("[1e-3, 8e-5, 4e-5]", "[1e-3, .nan, ]"), "fit.readings: there are 2 readings in lists of shape"),
        (("[1e-3, 8e-5, 4e-5]", "[1e-3, .nan, ~]"), "fit.unknowns: there are 2 unknowns and 1 readings"),
        (("[1e-3, 8e-5, 4e-5]", "[1e-3, [2], 1]"), "fit.readings: there are 0 readings in lists"),
        (("[1e-3, 8e-5, 4e-5]", "[1e-3, a, 1]"), "fit.readings.values: give a list of numbers, one for each detector"),
        (("[1e-3, 8e-5, 4e-5]", "0.3"), "fit.readings.values: give a list of numbers, one for each detector"),
        (
            ("[1e-3, 8e-5, 4e-5]", "[1e-3, 8e-5, 0]"),
            "fit.readings: a reading is 0 or below: that detector is in the dark",
        ),
        (("{values: [1e-3, 8e-5, 4e-5]}", "{}"), "fit.readings: give readings either by file or by values"),
        (("4e-5]}", "4e-5], phases: [1, 2, 3]}"), "fit.readings: the light is steady; leave phases out"),
        (("{values: [1e-3, 8e-5, 4e-5]}", "{file: none.csv}"), "none.csv is not a file; give a CSV file of readings"),
        (("noise: 0.02", "noise: 0"), "fit.noise: expected a number greater than 0"),
        (("noise: 0.02", "bounds: {sigma_a: [0.1, 0.01]}"), "fit.bounds: bounds of sigma_a are 0.1 and 0.01"),
        (
            ("noise: 0.02", "bounds: {sigma_a: [0.1, 0.2]}"),
            "sigma_a begins at 0.015, outside of its bounds 0.1 and 0.2",
        ),
        (("noise: 0.02", "bounds: {gain: [0.1, 0.2]}"), 'bounds of "gain", which is no unknown; give those of sigma_a'),
        (("noise: 0.02", "bounds: {sigma_a: [0.1]}"), "fit.bounds.sigma_a"),
        (("sigma_s_prime], ", "pencil_2.x], "), 'fit.unknowns: "pencil_2.x" is no unknown of this fit; give some of'),
        (
            ("sigma_s_prime], ", "pencil_1.x], bounds: {pencil_1.x: [1, -1]}, "),
            "fit.bounds: bounds of pencil_1.x are 1 and -1; give two coordinates, the lower one first",
        ),
        (("noise: 0.02", "noises: 0.02"), 'fit.noises: unknown key; did you mean "noise"'),
        (("noise: 0.02}", "noise: 0.02}\nmodel: charges"), "fit: a fit is made by model full"),
        (("noise: 0.02}", "noise: 0.02}\npulse: {times: [1e-9]}"), "fit: a fit does not go with pulse"),
        (("sigma_a: 0.015", "sigma_a: 0"), "fit: sigma_a begins at 0; begin with a value greater than 0"),
        (("sigma_a: 0.015", "sigma_a: [0.01, 0.02]"), "fit: several channels are fitted by chromophores alone"),
        (("noise: 0.02}", "noise: 0.02}\nmodulation: {frequency: 1e8}"), "the light is modulated; give their phases"),
    ],
)
def test_what_is_no_fit_is_refused(change: tuple[str, str], words: str, tmp_path: Path) -> None:
    text = CASE + FIT
    assert change[0] in text
    check_refused(tmp_path, text.replace(*change), words)


def test_fits_and_sensitivities_need_detectors(tmp_path: Path) -> None:
    bare = "".join(line for line in CASE.splitlines(keepends=True) if "name:" not in line and "tector" not in line)
    check_refused(tmp_path, bare + FIT, "fit: a fit is to what detectors have read, and there is none")
    check_refused(tmp_path, bare + "outputs: [sensitivity]\n", "outputs: sensitivities are of what detectors read")
    text = CASE + "outputs: [sensitivity]\nmodel: closed-form\n"
    check_refused(tmp_path, text.replace("{detectors: 0.05}", "0.05"), "outputs: sensitivities are of model full")
    check_refused(tmp_path, CASE + "outputs: [sensitivity]\npulse: {times: [1e-9]}\n", "no sensitivities beside pulse")


def test_other_words_are_understood(tmp_path: Path) -> None:
    check_refused(tmp_path, CASE + FIT.replace("fit:", "inversion:"), 'inversion: unknown key; did you mean "fit"')
    check_refused(tmp_path, CASE + FIT.replace("readings:", "measurements:"), 'did you mean "readings"')
    check_refused(tmp_path, CASE + "outputs: [jacobian]\n", 'did you mean "sensitivity"')


def test_what_is_no_light_or_tissue_is_refused(tmp_path: Path) -> None:
    """What other tests refuse in Python."""
    tissue = (
        "{chromophores: {hbo2: 4e-5, water: %s, fat: 0.5}, scattering: {a: 1.2, b: 1.3}, wavelengths: [%s], eta: 1.4}"
    )
    medium = "{sigma_a: 0.015, sigma_s_prime: 1.3, eta: 1.4}"
    words = "medium.wavelengths: hbo2: the wavelength 500 nm is outside the spectrum, 600 to 1000 nm"
    check_refused(tmp_path, CASE.replace(medium, tissue % (0.2, 500)), words)
    words = "medium: the fractions of water, fat add up to 1.2; they can be 1 together"
    check_refused(tmp_path, CASE.replace(medium, tissue % (0.7, 690)), words)
    check_refused(tmp_path, CASE + "modulation: {frequency: -1e8}\n", "modulation.frequency: frequency is -1e.08")
    words = "modulation.frequency: frequency is 2e.13 Hz, at which light does not diffuse"
    check_refused(tmp_path, CASE + "modulation: {frequency: 2e13}\n", words)
    void = (
        "regions: [{name: core, surface: {sphere: {radius: 4}}, medium: {sigma_a: 0.01, sigma_s_prime: 0, eta: 1.4}}]\n"
    )
    dye = f"fluorescence: {{emission: {medium}, dyes: [{{region: core, absorption: 0.005, quantum_yield: 0.5}}]}}\n"
    words = "regions.0..medium: the medium does not scatter, and light does not diffuse through a void"
    check_refused(tmp_path, CASE + void + dye, words)


def test_chromophores_of_regions_are_unknowns(tmp_path: Path) -> None:
    """Fractions of the volume stay below 1 however far a fit goes, and modulated readings are complex."""
    tissue = "{chromophores: {hbo2: 4e-5, water: 0.7}, scattering: {a: 1.2, b: 1.3}, wavelengths: [690, 830], eta: 1.4}"
    lines = CASE.splitlines()
    lines[1] = f"medium: {tissue}\nregions: [{{name: core, surface: {{sphere: {{radius: 4}}}}, medium: {tissue}}}]"
    lines += [
        "modulation: {frequency: 1e8}",
        "fit:",
        "  unknowns: [hbo2, core.hbo2, core.water, a]",
        "  readings: {values: [[1, 2, 3], [4, 5, 6]], phases: [[0, 90, 180], [0, 0, 0]]}",
    ]
    (tmp_path / "case.yaml").write_text("\n".join(lines))
    (case,) = load_cases(tmp_path / "case.yaml")
    assert case.fit is not None
    assert case.fit.readings.shape == (2, 1, 3)
    assert case.fit.readings[0, 0] == pytest.approx([1.0, -2.0j, -3.0])
    unknowns = case.fit.unknowns
    before, after = unknowns.media(unknowns.start), unknowns.media(unknowns.start * [1.0, 2.0, 1.0, 1.0])
    assert before[0][0] == after[0][0]
    assert before[0][1].sigma_a < after[0][1].sigma_a
    assert unknowns.media(case.fit.bounds[:, 1])[1][1].sigma_a > 0
    assert case.fit.bounds[2, 1] < 1.0


@pytest.mark.slow
def test_a_case_has_the_light_that_was_found(tmp_path: Path) -> None:
    beam, there = PencilBeam((1, 0, 20), (0, 0, -1)), [PointDetector(place) for place in PLACES.values()]
    medium = Medium(sigma_a=0.015, sigma_s_prime=1.3, eta=1.4)
    read = solve(sphere(10.0), medium, [beam], model="charges", detectors=there, detector_tolerance=0.005).readings
    values = ", ".join(str(reading.exitance) for reading in read)
    fit = FIT.replace("[1e-3, 8e-5, 4e-5]", f"[{values}]").replace("[sigma_a, sigma_s_prime]", "[probe.x, sigma_a]")
    text = CASE.replace("pencil:", "name: probe, pencil:").replace("0.05", "0.1") + fit + "outputs: [surface]\n"
    (tmp_path / "case.yaml").write_text(text)
    assert main(["run", str(tmp_path / "case.yaml"), "--out", str(tmp_path), "--quiet", "--jobs", "1"]) == 0
    data = json.loads((tmp_path / "case" / "fit.json").read_text())
    assert data["values"]["probe.x"]["value"] == pytest.approx(1.0, abs=0.05)
    assert data["values"]["probe.x"]["start"] == 0.0
    surface = meshio.read(tmp_path / "case" / "surface.ply")
    brightest = surface.points[np.argmax(surface.point_data["exitance"])]
    assert brightest[0] == pytest.approx(1.0, abs=0.4)


def test_a_table_of_readings_is_read(tmp_path: Path) -> None:
    """In the form of detectors.csv, where rows of all lights together are passed over."""
    path = tmp_path / "detectors.csv"
    path.write_text(
        "name,kind,light,exitance [W/mm²],phase [degrees],noise\n"
        "near,point,all,9,0,\nnear,point,front,1,90,0.1\nside,point,back,2,0,0.2\n\n"
    )
    readings, noise = read_table(path, NAMES, "mm", modulated=True)
    assert readings[0, 0, 0] == pytest.approx(-1j)
    assert readings[0, 1, 1] == pytest.approx(2.0)
    assert np.isnan(readings[0, 0, 1])
    assert noise is not None
    assert noise[0, 1, 1] == 0.2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name,light,exitance\n", "has no rows"),
        ("name,exitance\nnear,1\n", "has no column light; its heading needs name, exitance, light"),
        ("name,light\nnear,front\n", "has no column exitance"),
        ("name,light,exitance\nnear,top,1\n", 'line 2: "top" is no light of the case, which has front, back'),
        ("name,light,exitance\nfar,back,1\n", 'line 2: "far" is no detector of the case, which has near, side'),
        ("name,light,exitance\nnear,back,1\nnear,back,2\n", "line 3: this reading is given twice"),
        ("name,light,exitance\nnear,back,bright\n", 'line 2: "bright" is no number; give the exitance as one'),
        ("name,light,exitance [W/cm²]\nnear,back,1\n", "its exitance is in W/cm², and the case in mm; give W/mm²"),
    ],
)
def test_what_is_no_table_is_refused(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        read_table(tmp_path / "table.csv", NAMES, "mm", modulated=False)
