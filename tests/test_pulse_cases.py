"""A pulse in case files: readings over time, arrays of the surface, the film, and what is refused."""

import csv
import json
from pathlib import Path

import meshio
import numpy as np
import pytest
from PIL import Image

from tests.viewer_made import data_of, unpack
from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.meshing import InputError

CASE = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - point: {position: [0, 0, 9.00990099009901], power: [1, 2]}
pulse: {times: [1e-10, 2e-10, 5e-10, 2e-9]}
outputs: [surface, film, viewer]
detectors:
  - {name: side, point: [10, 0, 0]}
  - {name: far, disc: {center: [0, 0, -10], radius: 0.1}}
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pulse")
    (folder / "ball.yaml").write_text(CASE)
    assert main(["run", str(folder / "ball.yaml"), "--out", str(folder / "out"), "--quiet", "--jobs", "1"]) == 0
    return folder / "out" / "ball"


@pytest.mark.slow
def test_readings_over_time_are_those_of_the_series(finished: Path) -> None:
    with (finished / "pulse.csv").open(encoding="utf-8") as file:
        rows = {(row["name"], row["channel"], float(row["time [s]"])): row for row in csv.DictReader(file)}
    assert len(rows) == 16
    expected = {("side", 2e-10): 3.010444e5, ("side", 5e-10): 6.717566e4, ("far", 2e-10): 2.150710e4}
    for (name, time), exitance in expected.items():
        for channel, power in (("1", 1.0), ("2", 2.0)):
            row = rows[name, channel, time]
            bar = float(row["relative_error"])
            assert float(row["exitance [W/mm² per J]"]) == pytest.approx(power * exitance, rel=min(0.01, 2.0 * bar))
            assert bar < 0.05
            if name == "side":
                assert row["power [W per J]"] == ""
            else:
                collected = float(row["exitance [W/mm² per J]"]) * np.pi * 0.1**2
                assert float(row["power [W per J]"]) == pytest.approx(collected)


def test_other_files_show_the_integral_over_time(finished: Path) -> None:
    """Which is the light that shines steadily."""
    summary = json.loads((finished / "summary.json").read_text())
    first, second = summary["channels"]
    assert second["power"]["exited"] == pytest.approx(2.0 * first["power"]["exited"], rel=1e-3)
    assert summary["detectors"][0]["exitance"] == pytest.approx(8.764252e-5, rel=0.005)
    assert summary["as_ran"]["scene"]["pulse"]["times"] == [1e-10, 2e-10, 5e-10, 2e-9]


def test_the_surface_has_an_array_for_each_time(finished: Path) -> None:
    text = (finished / "surface.ply").read_bytes().split(b"end_header")[0].decode()
    names = [line.split()[-1] for line in text.splitlines() if line.startswith("property double exitance_")]
    assert [name for name in names if name.endswith("ps")] == [
        "exitance_100ps",
        "exitance_200ps",
        "exitance_500ps",
        "exitance_2000ps",
    ]


def test_the_viewer_has_a_field_for_each_time_on_one_scale(finished: Path) -> None:
    moments = data_of(finished / "viewer.html")["inTime"]
    assert [moment["time"] for moment in moments] == [1e-10, 2e-10, 5e-10, 2e-9]
    surface = meshio.read(finished / "surface.ply")
    for moment, name in zip(moments, ("100ps", "200ps", "500ps", "2000ps"), strict=True):
        np.testing.assert_allclose(unpack(moment["values"]), surface.point_data[f"exitance_{name}"], rtol=1e-6)
        low, high = moment["ends"]
        assert high == pytest.approx(1e4 * low)
    assert high == pytest.approx(np.nanmax(surface.point_data["exitance_100ps"]))
    # And with what detectors read then, of both channels.
    with (finished / "pulse.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["light"] == "all"]
    for moment in moments:
        assert set(moment["readings"]) == {"side", "far"}
        for name, value in moment["readings"].items():
            parts = [row for row in rows if row["name"] == name and float(row["time [s]"]) == moment["time"]]
            known = [float(row["exitance [W/mm² per J]"] or "nan") for row in parts]
            assert len(known) == 2
            assert value == (None if np.isnan(known).all() else pytest.approx(np.nansum(known), rel=1e-8))
    assert moments[-1]["readings"]["side"] > 0


def test_the_film_has_a_frame_for_each_time(finished: Path) -> None:
    with Image.open(finished / "film.gif") as film:
        assert getattr(film, "n_frames", 1) == 4
        frames = []
        for number in range(4):
            film.seek(number)
            frames.append(np.asarray(film.convert("L"), dtype=float))
    # In one scale: light fades.
    assert frames[0].mean() > frames[2].mean() > frames[3].mean()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("pulse: {times: [0, 1e-9]}", "pulse.times: times are in s after the pulse, each greater than 0"),
        ("pulse: {times: [2e-9, 1e-9]}", "pulse.times: times do not rise; sort them"),
        ("pulse: {times: [1e-13]}", "pulse.times: the first time is 1e-13 s, when light has gone"),
        ("pulse: {times: 1e-9}", r"pulse.times: give a list of times in s, or a range as in \{start: 5e-11"),
        ("pulse: {times: []}", "pulse.times"),
        ("pulse: {times: {start: 0, stop: 1e-9, num: 3, scale: log}}", "pulse.times"),
        ("pulse: {times: [1e-9], outside_index: 0.5}", "pulse.outside_index: outside_index is 0.5"),
        ("pulse: {times: [1e-9]}\nmodulation: {frequency: 1e8}", "a pulse does not go with modulation"),
        ("pulse: {times: [1e-9]}\nmodel: charges", "a pulse is solved for by model full; leave pulse or model out"),
        ("pulse: {times: [1e-9]}\ntolerance: {everywhere: 0.1}", "a pulse does not go with tolerance.everywhere"),
        ("outputs: [film]", "a film shows a pulse; add pulse, or leave film out of outputs"),
    ],
)
def test_what_is_no_pulse_is_refused(line: str, words: str, tmp_path: Path) -> None:
    kept = [each for each in CASE.splitlines() if not each.startswith(("pulse", "outputs"))]
    (tmp_path / "case.yaml").write_text("\n".join([*kept, line]) + "\n")
    with pytest.raises(InputError, match=words):
        load_cases(tmp_path / "case.yaml")
