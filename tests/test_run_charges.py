"""Cases solved by charges: what they write, beside the same by finite elements, and what is refused."""

import csv
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.cases.shipped import library_folder
from tetlux.fem import Medium, Region, solve
from tetlux.meshing import sphere
from tetlux.meshing.arrays import FloatArray

BALL = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 2.0}
  - {name: inner, point: {position: [5, 0, 0], power: 0.5}}
detectors:
  - {name: side, point: [0, 10, 0]}
  - {name: top, fibre: {center: [0, 0, 10], radius: 0.5, numerical_aperture: 0.4}}
outputs: [surface]
sweep: {model: [full, charges]}
"""
LAYERED = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: [0.01, 0.03], sigma_s_prime: 1.0, eta: 1.4}
regions:
  - {name: core, surface: {sphere: {radius: 4}}, medium: {sigma_a: [0.05, 0.1], sigma_s_prime: 1.5, eta: 1.4}}
lights:
  - {name: beam, pencil: {origin: [1, 0, 19], direction: [0, 0, -1], power: [2, 0]}}
  - {name: inner, point: {position: [-1, -1, 6], power: 0.5}}
camera: {position: [20, 10, 30]}
model: charges
outputs: [surface]
"""
POINT = "{point: {position: [0, 0, 6]}}"
EVEN = "{sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}"
REGION = f"regions: [{{surface: {{sphere: {{radius: 5}}}}, medium: {EVEN}}}]\n"


@dataclass(frozen=True)
class Finished:
    summary: dict[str, Any]
    surface: meshio.Mesh
    rows: list[dict[str, str]]


def finish(folder: Path) -> Finished:
    rows = []
    if (folder / "detectors.csv").exists():
        with (folder / "detectors.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    summary = json.loads((folder / "summary.json").read_text())
    return Finished(summary, meshio.read(folder / "surface.ply"), rows)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Finished, Finished]:
    """One case by finite elements, and by charges."""
    folder = tmp_path_factory.mktemp("both")
    (folder / "ball.yaml").write_text(BALL)
    assert main(["run", str(folder / "ball.yaml"), "--out", str(folder / "out")]) == 0
    full, charges = (finish(folder / "out" / "ball" / f"model={model}") for model in ("full", "charges"))
    return full, charges


def at_given_vertices(finished: Finished) -> FloatArray:
    """Exitance at the vertices of the ball itself, which come first."""
    given = sphere(10.0).points
    np.testing.assert_allclose(finished.surface.points[: len(given)], given, rtol=0, atol=1e-12)
    return np.asarray(finished.surface.point_data["exitance"][: len(given)])


def test_exitance_is_that_of_finite_elements_within_both_estimates(both: tuple[Finished, Finished]) -> None:
    full, charges = (at_given_vertices(one) for one in both)
    estimates = [one.summary["channels"][0]["error_estimate"] for one in both]
    assert 0 < min(estimates) <= max(estimates) <= 0.02
    # The ball's vertices lie evenly: their sum of squares is the integral.
    assert np.linalg.norm(charges - full) <= sum(estimates) * np.linalg.norm(full)


def test_detectors_have_the_same_rows_and_read_the_same(both: tuple[Finished, Finished]) -> None:
    full, charges = (one.rows for one in both)
    assert len(full) == 6
    for one, other in zip(full, charges, strict=True):
        assert list(one) == list(other)
        for name in ("name", "kind", "channel", "light", "x [mm]", "y [mm]", "z [mm]"):
            assert one[name] == other[name]
        # Finite elements are off most where a single light is dim. Measured: up to .035.
        for name in ("exitance [W/mm²]", "power [W]"):
            assert (one[name] == "") == (other[name] == "")
            assert float(other[name] or 1) == pytest.approx(float(one[name] or 1), rel=0.07)


def test_the_summary_has_charges_in_place_of_a_mesh(both: tuple[Finished, Finished]) -> None:
    full, charges = (one.summary for one in both)
    assert set(full) - set(charges) == {"mesh"}
    assert charges["model"] == "charges"
    assert charges["as_ran"]["scene"]["model"] == "charges"
    (mine,), (other,) = charges["channels"], full["channels"]
    assert set(other) - set(mine) == {"fluence", "validity"}
    assert mine["charges"]["count"] > 50
    assert mine["error_estimate"] < mine["charges"]["bound"] < 0.05
    assert mine["media"] == other["media"]
    assert abs(mine["power"]["balance_error"]) < 1e-3
    assert mine["power"]["exited"] == pytest.approx(other["power"]["exited"], rel=0.01)
    # The smooth surface that its triangles stand for is .07 % larger than the ball.
    assert mine["exitance"]["mean"] == pytest.approx(mine["power"]["exited"] / (400 * np.pi), rel=2e-3)
    assert mine["exitance"]["max"] == both[1].surface.point_data["exitance"].max()
    assert charges["seconds"]["solve"] > 0
    assert sorted(both[1].surface.point_data) == sorted(set(both[0].surface.point_data) - {"valid"})


def test_channels_lights_and_regions_by_charges(tmp_path: Path) -> None:
    (tmp_path / "layered.yaml").write_text(LAYERED)
    assert main(["run", str(tmp_path / "layered.yaml"), "--out", str(tmp_path)]) == 0
    found = finish(tmp_path / "layered")
    values, points = found.surface.point_data, found.surface.points
    assert not values["exitance_beam_2"].any()
    np.testing.assert_allclose(values["exitance_1"] + values["exitance_2"], values["exitance"], rtol=1e-9)
    np.testing.assert_allclose(
        values["exitance_beam_1"] + values["exitance_inner_1"], values["exitance_1"], rtol=1e-6, atol=1e-12
    )
    (case,) = load_cases(tmp_path / "layered.yaml")
    core = Region(case.regions[0].surface, Medium(sigma_a=0.1, sigma_s_prime=1.5, eta=1.4))
    dim = Medium(sigma_a=0.03, sigma_s_prime=1.0, eta=1.4)
    alone = solve(case.surface, dim, list(case.channels[1].lights.values()), regions=[core], model="charges")
    np.testing.assert_allclose(values["exitance_2"], alone.exitance_on(points), rtol=1e-6)
    bright, dark = found.summary["channels"]
    assert [[row["name"], row["sigma_a"]] for row in dark["media"]] == [["body", 0.03], ["core", 0.1]]
    assert dark["charges"] == {"count": alone.charges, "bound": None}
    for name in ("incident", "absorbed", "exited"):
        assert sum(light["power"][name] for light in bright["lights"]) == pytest.approx(bright["power"][name])


def test_outputs_are_those_that_need_no_mesh(tmp_path: Path) -> None:
    (tmp_path / "ball.yaml").write_text(BALL.replace("outputs: [surface]\n", ""))
    assert [case.outputs for case in load_cases(tmp_path / "ball.yaml")] == [
        ("surface", "volume", "picture"),
        ("surface", "picture"),
    ]


@pytest.mark.parametrize(
    ("body", "light", "message"),
    [
        ("outputs: [surface, volume]\n", POINT, "line 5: outputs: volume needs finite elements"),
        ("compare: [series]\n", POINT, "line 5: compare: compare needs finite elements"),
        ("", "{pencil: {origin: [0, 0, 20], direction: [0, 0, -1], deposit: line}}", "lights[0]: PencilBeam leaves"),
        ("", "{collimated: {direction: [0, 0, -1], irradiance: 1}}", "lights[0]: CollimatedBeam leaves light along"),
        ("", "{emission: {density: 1}}", "lights[0]: Emission "),
        (REGION, "{diffuse: {irradiance: 1}}", "lights[0]: DiffuseLight on a body with regions"),
        (REGION, "{point: {position: [0, 0, 5]}}", "lights[0]: a source at (0, 0, 5) lies on the surface of region 1"),
    ],
)
def test_what_needs_finite_elements_is_refused_in_one_sentence(
    body: str, light: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f"surface: {{sphere: {{radius: 10}}}}\nmedium: {EVEN}\nlights: [{light}]\nmodel: charges\n{body}"
    (tmp_path / "ball.yaml").write_text(text)
    assert main(["check", str(tmp_path / "ball.yaml")]) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.count("\n") == 1
    assert re.search(r'write model: full\.$|with model "full"\.$', printed.err)
    if "volume" not in body and "compare" not in body:
        # Finite elements can do it.
        (tmp_path / "ball.yaml").write_text(text.replace("charges", "full"))
        assert main(["check", str(tmp_path / "ball.yaml")]) == 0


def test_a_mesh_and_media_that_vary_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.save(tmp_path / "field.npy", np.full((3, 3, 3), 0.02))
    varying = "{array: {file: field.npy, origin: [-10, -10, -10], spacing: 10}}"
    head = f"lights: [{POINT}]\nmodel: charges\n"
    for name, body, message in (
        ("mesh", f"mesh: {{file: head.msh, labels: {{1: {EVEN}}}}}\n", "mesh: a mesh needs finite elements"),
        (
            "field",
            f"surface: {{sphere: {{radius: 9}}}}\nmedium: {EVEN.replace('0.01', varying)}\n",
            "medium: the medium varies within the body",
        ),
        (
            "inner",
            f"surface: {{sphere: {{radius: 9}}}}\nmedium: {EVEN}\n{REGION.replace('0.01', varying)}",
            "regions[0].medium: the medium varies",
        ),
    ):
        (tmp_path / f"{name}.yaml").write_text(head + body)
        assert main(["check", str(tmp_path / f"{name}.yaml")]) == 2
        assert message in capsys.readouterr().err


def test_exitance_below_zero_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Behind the hare's thin parts there is less light than few charges are off by."""
    monkeypatch.setattr("tetlux.fem.charges.faint.MOST_FOR_FAINT", 0)
    text = (library_folder() / "hare.yaml").read_text().replace("hare.stl", str(library_folder() / "hare.stl"))
    (tmp_path / "hare.yaml").write_text(text + "model: charges\noutputs: [surface]\n")
    assert main(["run", str(tmp_path / "hare.yaml"), "--out", str(tmp_path)]) == 0
    summary = finish(tmp_path / "hare").summary
    assert summary["channels"][0]["exitance"]["min"] < 0
    assert "the exitance is below zero on" in summary["warnings"][0]
    assert "note: the exitance is below zero on" in capsys.readouterr().out
