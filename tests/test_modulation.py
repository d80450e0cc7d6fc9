"""Modulated light in case files: channels, amplitudes and phases in all files, and what is refused."""

import csv
import json
from pathlib import Path

import meshio
import numpy as np
import pytest

from tetlux.cases import load_result
from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.meshing import InputError

CASE = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - point: {position: [0, 0, 9.00990099009901]}
modulation: {frequency: FREQUENCY}
tolerance: {exitance: 0.05, detectors: 0.01}
detectors:
  - {name: side, point: [10, 0, 0]}
  - {name: far, disc: {center: [0, 0, -10], radius: 0.1}}
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("modulated")
    (folder / "ball.yaml").write_text(CASE.replace("FREQUENCY", "[0, 500e6]"))
    assert main(["run", str(folder / "ball.yaml"), "--out", str(folder / "out"), "--quiet", "--jobs", "1"]) == 0
    return folder / "out" / "ball"


def test_frequencies_are_channels(finished: Path) -> None:
    summary = json.loads((finished / "summary.json").read_text())
    steady, fast = summary["channels"]
    assert (steady["name"], fast["name"]) == ("0MHz", "500MHz")
    assert "frequency" not in steady
    assert fast["frequency"] == 500e6
    assert set(fast["power"]) - set(steady["power"]) == {"stored"}
    assert fast["power"]["exited"] < steady["power"]["exited"]
    assert abs(fast["power"]["balance_error"]) < 1e-9
    # What is stored in the field lags a quarter turn less than what is absorbed.
    phases = fast["power_phase"]
    assert (phases["absorbed"] - phases["stored"]) % 360 == pytest.approx(90.0)


def test_detectors_have_amplitudes_and_phases(finished: Path) -> None:
    """By the series of the ball."""
    with (finished / "detectors.csv").open(encoding="utf-8") as file:
        rows = {(row["name"], row["channel"]): row for row in csv.DictReader(file)}
    expected = {("side", "0MHz"): (8.764252e-5, None), ("side", "500MHz"): (7.798646e-5, 53.91994)}
    expected |= {("far", "0MHz"): (2.427919e-5, None), ("far", "500MHz"): (2.076560e-5, 79.11970)}
    for key, (amplitude, phase) in expected.items():
        assert float(rows[key]["exitance [W/mm²]"]) == pytest.approx(amplitude, rel=0.005)
        if phase is None:
            assert rows[key]["phase [degrees]"] == ""
        else:
            assert float(rows[key]["phase [degrees]"]) == pytest.approx(phase, abs=0.1)
    power = float(rows["far", "500MHz"]["power [W]"])
    assert power == pytest.approx(np.pi * 0.01 * 2.076560e-5, rel=0.005)


def test_surface_and_volume_have_amplitudes_and_phases(finished: Path) -> None:
    result = load_result(finished)
    values = result.values
    assert values["exitance"] == pytest.approx(values["exitance_0MHz"] + values["exitance_500MHz"])
    assert "phase" not in values
    assert "phase_0MHz" not in values
    assert result.points is not None
    far = int(np.argmin(result.points[:, 2]))
    assert values["phase_500MHz"][far] == pytest.approx(79.1, abs=3.0)
    assert values["exitance_500MHz"][far] == pytest.approx(2.08e-5, rel=0.1)
    volume = meshio.read(finished / "volume.vtu").point_data
    assert set(volume) == {"fluence_0MHz", "fluence_500MHz", "phase_500MHz"}
    assert (volume["fluence_500MHz"] <= 1.001 * volume["fluence_0MHz"]).mean() > 0.99
    assert volume["phase_500MHz"].max() < 85.0


def test_the_terminal_and_the_tables_say_the_phase(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = CASE.replace("FREQUENCY", "1e8").replace("detectors: 0.01", "detectors: 0.05")
    text += "outputs: []\nsweep: {modulation.frequency: [0, 1.0e8]}\n"
    (tmp_path / "ball.yaml").write_text(text)
    assert main(["run", str(tmp_path / "ball.yaml"), "--out", str(tmp_path / "out"), "--jobs", "1"]) == 0
    with (tmp_path / "out" / "results.csv").open(encoding="utf-8") as file:
        steady, modulated = csv.DictReader(file)
    assert (steady["frequency"], steady["reading.side.phase"]) == ("", "")
    assert float(modulated["frequency"]) == 1e8
    assert float(modulated["reading.side.phase"]) == pytest.approx(11.118, abs=0.1)
    with (tmp_path / "out" / "readings.csv").open(encoding="utf-8") as file:
        phases = [row["phase"] for row in csv.DictReader(file) if row["detector"] == "side"]
    assert phases == ["", modulated["reading.side.phase"]]
    (tmp_path / "ball.yaml").write_text(text.replace("sweep: {modulation.frequency: [0, 1.0e8]}", ""))
    capsys.readouterr()
    assert main(["run", str(tmp_path / "ball.yaml"), "--out", str(tmp_path / "one")]) == 0
    assert "° behind" in capsys.readouterr().out


def test_the_outside_counts_for_the_speed_of_light(tmp_path: Path) -> None:
    (tmp_path / "ball.yaml").write_text(CASE.replace("{frequency: FREQUENCY}", "{frequency: 1e8, outside_index: 1.33}"))
    (case,) = load_cases(tmp_path / "ball.yaml")
    assert (case.frequencies, case.outside_index, case.channel_names) == ((1e8,), 1.33, ("all",))


@pytest.mark.parametrize(
    ("frequency", "more", "words"),
    [
        ("-1", "", r"line 5: modulation\.frequency: frequency is -1; give a frequency in Hz"),
        ("1e12", "", r"modulation\.frequency: frequency is 1e\+12 Hz, at which light does not diffuse"),
        ("[1e8, 1e8]", "", "a frequency is given twice; leave one of the two out"),
        ("[1e8, 2e8]", "channels: [a, b, c]\n", "this makes 2 channels, and channels makes 3 channels"),
        ("1e8, outside_index: 0.5", "", r"modulation\.outside_index: outside_index is 0\.5; give"),
        ("1e8", "compare: [series]\n", "compare: closed forms here are those of steady light"),
    ],
)
def test_what_does_not_go_together_is_refused(tmp_path: Path, frequency: str, more: str, words: str) -> None:
    (tmp_path / "ball.yaml").write_text(CASE.replace("FREQUENCY", frequency) + more)
    with pytest.raises(InputError, match=words):
        load_cases(tmp_path / "ball.yaml")


@pytest.mark.parametrize(("outputs", "model"), [("[]", "charges"), ("[volume]", "fem")])
def test_the_planner_takes_charges_unless_a_mesh_is_needed(tmp_path: Path, outputs: str, model: str) -> None:
    (tmp_path / "ball.yaml").write_text(CASE.replace("FREQUENCY", "1e8") + f"model: auto\noutputs: {outputs}\n")
    assert main(["run", str(tmp_path / "ball.yaml"), "--out", str(tmp_path), "--quiet", "--jobs", "1"]) == 0
    summary = json.loads((tmp_path / "ball" / "summary.json").read_text())
    assert summary["model"] == model
    assert summary["detectors"][0]["phase"] == pytest.approx(11.118, abs=0.1)


def test_charges_alone_read_modulated_light(tmp_path: Path) -> None:
    """And the closed form of steady light does not."""
    text = CASE.replace("FREQUENCY", "1e8").replace("exitance: 0.05, detectors: 0.01", "detectors: 0.005")
    path = tmp_path / "ball.yaml"
    path.write_text(text + "model: charges\noutputs: [surface]\n")
    assert main(["run", str(path), "--out", str(tmp_path), "--quiet", "--jobs", "1"]) == 0
    summary = json.loads((tmp_path / "ball" / "summary.json").read_text())
    assert summary["model"] == "charges"
    assert summary["detectors"][0]["phase"] == pytest.approx(11.118, abs=0.1)
    assert summary["channels"][0]["power"]["stored"] > 0.05
    path.write_text(text.replace("detectors: 0.005", "exitance: 0.01") + "model: closed-form\n")
    with pytest.raises(InputError, match='modulation needs finite elements, which model "closed-form" does not use'):
        load_cases(path)
