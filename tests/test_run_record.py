"""The record of a run in its summary is a case file of that run."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import block
from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.cases.shipped import library_folder
from tetlux.cases.write.media_rows import coefficients, media_rows
from tetlux.cases.write.run_record import describe_run

SWEPT = """\
unit: cm
surface: {sphere: {radius: 1}}
medium: {sigma_a: 0.1, sigma_s: 100.0, g: 0.9, eta: 1.4}
regions:
  - {surface: {sphere: {radius: 0.3}}, medium: {sigma_a: 1.0, sigma_s_prime: 12.0, eta: 1.4}}
lights: [{point: {position: [0, 0, 0.8]}}]
sweep: {medium.sigma_a: [0.1, 1.0e-3], lights.0.point.power: [1, 2]}
"""


def again(case: Case, folder: Path) -> Case:
    """The case that is read from what was written of one."""
    (folder / "elsewhere").mkdir(exist_ok=True)
    file = folder / "elsewhere" / "again.json"
    file.write_text(json.dumps(describe_run(case)["scene"], allow_nan=False), encoding="utf-8")
    (one,) = load_cases(file)
    return one


@pytest.mark.parametrize("name", sorted(path.stem for path in library_folder().glob("*.yaml")))
def test_what_is_written_of_a_case_makes_the_same_case(name: str, tmp_path: Path) -> None:
    (case,) = load_cases(library_folder() / f"{name}.yaml")
    repeated = again(case, tmp_path)
    assert repeated.name == case.name
    assert describe_run(repeated)["scene"] == describe_run(case)["scene"]
    assert [coefficients(channel.medium) for channel in repeated.channels] == [
        coefficients(channel.medium) for channel in case.channels
    ]
    assert [channel.lights for channel in repeated.channels] == [channel.lights for channel in case.channels]
    np.testing.assert_array_equal(repeated.surface.points, case.surface.points)


def test_a_run_of_a_sweep_has_its_values_put_in(tmp_path: Path) -> None:
    (tmp_path / "swept.yaml").write_text(SWEPT)
    cases = load_cases(tmp_path / "swept.yaml")
    record = describe_run(cases[3])
    assert record["source"] == str(tmp_path / "swept.yaml")
    assert record["sweep"] == {"medium.sigma_a": 1e-3, "lights.0.point.power": 2}
    assert "sweep" not in record["scene"]
    assert record["scene"]["medium"]["sigma_a"] == 1e-3
    assert record["scene"]["lights"] == [{"name": "point_1", "point": {"position": [0, 0, 0.8], "power": 2}}]
    assert record["scene"]["regions"][0]["name"] == "region_1"
    cube = block((2, 2, 2), (1.0, 1.0, 1.0))
    ((body, inner),) = media_rows(cases[3], replace(cube, regions=np.arange(len(cube.tetrahedra)) % 2))
    assert body["name"] == "body"
    assert (body["sigma_s"], body["g"]) == (100.0, 0.9)
    assert body["sigma_s_prime"] == pytest.approx(10.0)
    assert body["mean_free_path"] == pytest.approx(1 / 10.001)
    assert inner["name"] == "region_1"
    assert inner["albedo"] == pytest.approx(12 / 13)
    assert "g" not in inner
    repeated = again(cases[3], tmp_path)
    assert repeated.medium == cases[3].medium
    assert repeated.lights == cases[3].lights


def test_a_medium_of_a_file_is_told_by_its_path_and_its_means(tmp_path: Path) -> None:
    np.save(tmp_path / "field.npy", np.broadcast_to([0.01, 0.03], (2, 2, 2)))
    (tmp_path / "varying.yaml").write_text(
        "surface: {sphere: {radius: 5}}\nlights: [{diffuse: {irradiance: 1}}]\nmedium:\n"
        "  sigma_a: {array: {file: field.npy, origin: [-9, -9, -9], spacing: 18}}\n  sigma_s_prime: 1.0\n  eta: 1.4\n"
    )
    (case,) = load_cases(tmp_path / "varying.yaml")
    record = describe_run(case)
    assert record["scene"]["medium"]["sigma_a"]["array"]["file"] == str(tmp_path / "field.npy")
    ((body,),) = media_rows(case, block((2, 2, 2), (1.0, 1.0, 1.0)))
    # It is .02 in the middle, and the block lies between z = -1 and 0.
    assert body["sigma_a"] == pytest.approx(0.02 - 0.01 * 0.5 / 9.0)
    assert body["varies"] == ["sigma_a"]
    again(case, tmp_path)
