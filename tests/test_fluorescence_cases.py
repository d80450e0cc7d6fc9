"""Dyes in case files: channels, readings and ledgers in all files, and what is refused."""

import csv
import json
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.fem import Medium, PointDetector, PointSource, Region, fluorescence
from tetlux.fem.media.coefficients import base_of
from tetlux.fem.media.fluorophore import Fluorophore
from tetlux.meshing import InputError, sphere

CASE = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.015, sigma_s_prime: 1.2, eta: 1.4}
regions:
  - name: tumour
    surface: {sphere: {radius: 3, center: [0, 0, 4]}}
    medium: {sigma_a: 0.03, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - {name: one, point: {position: [0, 0, -5]}}
  - {name: two, point: {position: [5, 0, 0]}}
fluorescence:
  emission: {sigma_a: 0.01, sigma_s_prime: 0.9, eta: 1.4}
  regions: {tumour: {sigma_a: 0.02, sigma_s_prime: 0.9, eta: 1.4}}
  dyes:
    - {region: tumour, absorption: 0.02, quantum_yield: 0.3, lifetime: 0.56e-9}
    - {absorption: 0.0005, quantum_yield: 0.5}
tolerance: 0.2
detectors: [{name: top, point: [0, 6, 8]}]
outputs: [surface, volume]
"""


def summary_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "summary.json").read_text())
    return found


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dyes")
    (folder / "ball.yaml").write_text(CASE)
    assert main(["run", str(folder / "ball.yaml"), "--out", str(folder / "out"), "--quiet", "--jobs", "1"]) == 0
    return folder / "out" / "ball"


def test_emission_is_a_channel(finished: Path) -> None:
    lit, emitted = summary_of(finished)["channels"]
    assert (lit["name"], emitted["name"]) == ("excitation", "emission")
    assert [row["sigma_a"] for row in lit["media"]] == [0.015, 0.03]
    assert [row["sigma_a"] for row in emitted["media"]] == [0.01, 0.02]
    first, second = emitted["dyes"]
    assert first["emitted"] == pytest.approx(0.3 * first["absorbed"], rel=1e-9)
    assert second["lost"] == pytest.approx(0.5 * second["absorbed"], rel=1e-9)
    assert first["emitted"] + second["emitted"] == pytest.approx(emitted["power"]["incident"], rel=1e-9)
    assert "dyes" not in lit


def test_all_files_have_both_wavelengths(finished: Path) -> None:
    with (finished / "detectors.csv").open() as file:
        rows = list(csv.DictReader(file))
    read = {(row["channel"], row["light"]): float(row["exitance [W/mm²]"]) for row in rows}
    assert set(read) == {(c, light) for c in ("excitation", "emission") for light in ("all", "one", "two")}
    assert read["emission", "one"] + read["emission", "two"] == pytest.approx(read["emission", "all"], rel=1e-6)
    assert read["emission", "all"] < 0.1 * read["excitation", "all"]
    surface, volume = meshio.read(finished / "surface.ply"), meshio.read(finished / "volume.vtu")
    assert {"exitance_emission", "exitance_excitation", "exitance_one_emission"} <= set(surface.point_data)
    assert {"fluence_emission", "fluence_excitation"} <= set(volume.point_data)


def test_the_case_is_what_python_solves(finished: Path) -> None:
    media = [Medium(sigma_a=a, sigma_s_prime=s, eta=1.4) for a, s in ((0.03, 1.0), (0.02, 0.9))]
    body, emitted = (Medium(sigma_a=a, sigma_s_prime=s, eta=1.4) for a, s in ((0.015, 1.2), (0.01, 0.9)))
    _, glowing = fluorescence(
        sphere(10.0),
        body,
        emitted,
        [PointSource((0.0, 0.0, -5.0)), PointSource((5.0, 0.0, 0.0))],
        [Fluorophore(0.02, 0.3, 0.56e-9, region=1), Fluorophore(0.0005, 0.5)],
        regions=[Region(sphere(3.0, center=(0.0, 0.0, 4.0)), media)],
        tolerance=0.2,
        detectors=[PointDetector((0.0, 6.0, 8.0))],
    )
    channel = summary_of(finished)["channels"][1]
    assert channel["power"]["exited"] == pytest.approx(glowing.power.exited, rel=0.02)
    with (finished / "detectors.csv").open() as file:
        whole = [row for row in csv.DictReader(file) if (row["channel"], row["light"]) == ("emission", "all")]
    assert float(whole[0]["exitance [W/mm²]"]) == pytest.approx(glowing.readings[0].exitance, rel=0.01)


def test_a_run_can_be_repeated_from_its_record(finished: Path, tmp_path: Path) -> None:
    scene = summary_of(finished)["as_ran"]["scene"]
    (tmp_path / "again.yaml").write_text(json.dumps(scene))
    (case,) = load_cases(tmp_path / "again.yaml")
    assert case.channel_names == ("excitation", "emission")
    assert case.fluorophores[0].region == 1


def test_channels_with_dyes(tmp_path: Path) -> None:
    """A channel for each of several media and frequencies, of excitation first; a region keeps its medium."""
    text = CASE.replace("sigma_a: 0.015", "sigma_a: [0.015, 0.02]")
    text = text.replace("  regions: {tumour: {sigma_a: 0.02, sigma_s_prime: 0.9, eta: 1.4}}\n", "")
    (tmp_path / "ball.yaml").write_text(text + "modulation: {frequency: [0, 1e8]}\n")
    (case,) = load_cases(tmp_path / "ball.yaml")
    assert case.channel_names == (
        "0MHz_excitation",
        "100MHz_excitation",
        "0MHz_emission",
        "100MHz_emission",
    )
    assert case.frequencies == (0.0, 1e8, 0.0, 1e8)
    inner: Any = case.regions[0].medium
    assert [medium.sigma_a for medium in inner] == [0.03] * 4
    assert [base_of(channel.medium).sigma_a for channel in case.channels] == [0.015, 0.02, 0.01, 0.01]


def test_a_sweep_over_dyes(tmp_path: Path) -> None:
    (tmp_path / "ball.yaml").write_text(CASE + "sweep: {fluorescence.dyes.0.absorption: [0.01, 0.02]}\n")
    assert [case.fluorophores[0].absorption for case in load_cases(tmp_path / "ball.yaml")] == [0.01, 0.02]


def test_pictures_show_what_is_emitted(tmp_path: Path) -> None:
    from tetlux.cases.solve import solve_case  # noqa: PLC0415
    from tetlux.cases.write.results import collect_results  # noqa: PLC0415

    (tmp_path / "ball.yaml").write_text(CASE)
    (case,) = load_cases(tmp_path / "ball.yaml")
    results = collect_results(case, solve_case(case, lambda _: None, cache=True))
    assert results.shown() == pytest.approx(results.exitance("emission"))
    assert results.exitance().max() > 10.0 * np.max(results.shown())


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("quantum_yield: 0.3", "quantum_yield: 1.3", ("line 14", "dyes[0].quantum_yield", "quantum_yield is 1.3")),
        ("absorption: 0.02", "absorption: -0.02", ("dyes[0].absorption", "greater than 0")),
        ("0.56e-9", "-1e-9", ("dyes[0].lifetime", "give seconds")),
        (
            "{region: tumour",
            "{region: void",
            ("dyes[0].region", 'no region "void"; the regions here are body'),
        ),
        ("  emission: {sigma_a: 0.01, sigma_s_prime: 0.9, eta: 1.4}\n", "", ("fluorescence.emission", "is missing")),
        ("regions: {tumour: {sigma_a", "regions: {bone: {sigma_a", ("fluorescence.regions.bone", "no region")),
        ("regions: {tumour: {sigma_a", "regions: {body: {sigma_a", ("give it as fluorescence.emission",)),
        ("sigma_s_prime: 0.9, eta: 1.4}\n  regions", "sigma_s_prime: 0.9, eta: 1.3}\n  regions", ("emission", "ind")),
        ("tolerance: 0.2", "model: truncated", ("fluorescence", "dyes are solved for by model full")),
        (
            "tolerance: 0.2",
            "pulse: {times: [1.0e-10]}",
            ("a pulse does not go with fluorescence; leave one of the two out.",),
        ),
        ("tolerance: 0.2", "compare: [series]", ("leave compare or fluorescence out",)),
        ("quantum_yield: 0.5", "quantum_efficiency: 0.5", ("unknown key", 'did you mean "quantum_yield"')),
    ],
)
def test_what_is_refused(old: str, new: str, words: tuple[str, ...], tmp_path: Path) -> None:
    assert old in CASE
    (tmp_path / "ball.yaml").write_text(CASE.replace(old, new, 1))
    with pytest.raises(InputError) as error:
        load_cases(tmp_path / "ball.yaml")
    for part in words:
        assert part in str(error.value), str(error.value)
