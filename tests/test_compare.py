"""Runs held against closed forms."""

import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from PIL import Image

from tests.conftest import TISSUE
from tetlux.cases.compare.comparison import NAMES, describe_source_model
from tetlux.cases.compare.differences import MEANINGS, compare
from tetlux.cases.file.case import Case
from tetlux.cases.file.load import load_cases
from tetlux.cases.file.schema.case import ClosedForm
from tetlux.cases.run import run_case
from tetlux.fem import CollimatedBeam, DiffuseLight, Emission, Light, Medium, PointSource, Solution, solve
from tetlux.fem.body.body import Body
from tetlux.fem.exact import slab as exact_slab
from tetlux.fem.exact.checks import Face
from tetlux.fem.exact.registry import closed_forms
from tetlux.meshing import InputError, RunError, slab, sphere

SLAB = """\
surface: {slab: {width: 60, depth: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - pencil: {origin: [3, 0, 10], direction: [0, 0, -1], power: 2.0}
tolerance: 0.1
outputs: []
compare: [robin, images, dipole]
"""
CYLINDER = """\
surface: {cylinder: {radius: 5, height: 40, center: [1, 2, 3]}}
medium: {sigma_a: 0.05, sigma_s_prime: 1.0, eta: 1.3}
lights:
  - point: {position: [4, 4, 3]}
  - pencil: {origin: [20, 2, 5], direction: [-1, 0, 0]}
tolerance: 0.05
outputs: []
compare: [series]
"""


def load(tmp_path: Path, text: str) -> Case:
    (tmp_path / "body.yaml").write_text(text)
    return load_cases(tmp_path / "body.yaml")[0]


def test_a_slab_meets_the_robin_solution_and_not_the_dipole(tmp_path: Path) -> None:
    folder = run_case(load(tmp_path, SLAB), tmp_path / "out")
    assert sorted(p.name for p in folder.iterdir()) == ["compare.json", "compare.png", "summary.json"]
    data = json.loads((folder / "compare.json").read_text())
    differences = data["differences"]
    # Five runs: 0.0127 to 0.0136.
    assert differences["robin"]["l2"] < 0.02
    assert "discretisation" in differences["robin"]["meaning"]
    assert differences["images"]["l2"] > 0.25
    assert differences["dipole"]["l2"] > 0.25
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["compare"]["robin"] == {k: differences["robin"][k] for k in ("l2", "largest", "at")}
    lengths = {len(data["along"]), len(data["fem"]), *(len(v) for v in data["closed_forms"].values())}
    assert len(lengths) == 1
    assert (np.diff(data["along"]) >= 0).all()
    # Near the entry, at a distance of one and of five, as the half-space has it (the slab is thick enough there).
    scale = 2 * (1 - (0.4 / 2.4) ** 2) / 1.01
    for distance, robin, dipole in ((1.0, 2.37356e-2, 3.0013e-2), (5.0, 1.42241e-3, 1.2099e-3)):
        for name, value in (("robin", robin), ("dipole", dipole)):
            drawn = np.exp(np.interp(distance, data["along"], np.log(data["closed_forms"][name])))
            assert drawn == pytest.approx(scale * value, rel=0.04)
    with Image.open(folder / "compare.png") as image:
        assert image.size == (1400, 1200)


def test_a_cylinder_meets_its_series(tmp_path: Path) -> None:
    case = load(tmp_path, CYLINDER)
    assert case.comparison is not None
    solution = solve(case.surface, case.medium, case.lights, tolerance=0.05)
    found = compare(case.comparison, solution)
    # Five runs: 0.0072 to 0.0099.
    assert found.differences["series"]["l2"] < 0.02


def test_a_wrong_exitance_is_seen(ball_solution: Solution, tmp_path: Path) -> None:
    text = SLAB.replace("slab: {width: 60, depth: 10}", "sphere: {radius: 10}").replace(
        "robin, images, dipole", "series"
    )
    text = text.replace(
        "pencil: {origin: [3, 0, 10], direction: [0, 0, -1], power: 2.0}", "point: {position: [0, 0, 9.0099]}"
    )
    comparison = load(tmp_path, text).comparison
    assert comparison is not None
    right = compare(comparison, ball_solution).differences["series"]
    wrong = compare(comparison, replace(ball_solution, fluence=1.1 * ball_solution.fluence)).differences["series"]
    assert right["l2"] < 0.02
    assert wrong["l2"] == pytest.approx(0.1, abs=0.02)
    assert wrong["largest"] > 0.1


def test_the_source_model_is_given_a_figure() -> None:
    assert "would change the exitance" in describe_source_model(Medium(sigma_a=0.01, sigma_s=5.0, g=0.8, eta=1.4))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "[robin, images, dipole]",
            "[series]",
            r'line 7: compare: there is no closed form "series"',
        ),
        ("slab: {width: 60, depth: 10}", "torus: {major: 9, minor: 4}", "compare: .*a torus has none"),
        ("power: 2.0", 'deposit: "line", radius: 1', "compare: closed forms exist for point sources only"),
        (
            "origin: [3, 0, 10]",
            "origin: [29, 0, 10]",
            "compare: the light is deposited less than 7.01 from the body's rim",
        ),
        ("[robin, images, dipole]", "[guess]", r"compare\[0\]: .*'guess'"),
    ],
)
def test_what_has_no_closed_form_is_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    text = SLAB.replace(old, new)
    if "torus" in new:
        text = text.replace("origin: [3, 0, 10]", "origin: [9, 0, 10]")
    with pytest.raises(InputError, match=message):
        load(tmp_path, text)


def test_where_no_light_arrives_there_is_nothing_to_compare(ball_solution: Solution, tmp_path: Path) -> None:
    text = SLAB.replace("slab: {width: 60, depth: 10}", "sphere: {radius: 10}").replace(
        "[robin, images, dipole]", "[series]"
    )
    text = text.replace(
        "pencil: {origin: [3, 0, 10], direction: [0, 0, -1], power: 2.0}", "point: {position: [0, 0, 0]}"
    )
    comparison = load(tmp_path, text.replace("sigma_a: 0.01", "sigma_a: 500")).comparison
    assert comparison is not None
    with pytest.raises(RunError, match="has no light at the nodes"):
        compare(comparison, ball_solution)
    assert comparison.note == "All use the same sources, isotropic points."


def test_names_of_closed_forms_are_those_of_the_case_file() -> None:
    """A name that is known in one place only would be refused, or have no meaning in `compare.json`."""
    for surface, place in ((slab(60.0, 10.0), (0.0, 0.0, -1.0)), (sphere(10.0), (0.0, 0.0, 9.0))):
        deposit = PointSource(place).deposit_in(Body(surface, (TISSUE,)))
        assert tuple(closed_forms(surface.shape, TISSUE, [deposit])) == NAMES[type(surface.shape)]
    assert set(get_args(ClosedForm)) == set(MEANINGS) == {name for names in NAMES.values() for name in names}


def test_closed_forms_of_the_registry_add_up() -> None:
    """Two points and uniform diffuse light on a ball are the sum of each alone."""
    ball = sphere(10.0, center=(1.0, 2.0, 3.0))
    points: list[Light] = [PointSource((1.0, 2.0, 12.0), 2.0), PointSource((4.0, 2.0, 3.0))]
    lights = [*points, DiffuseLight(0.5), Emission(0.1)]
    deposits = [light.deposit_in(Body(ball, (TISSUE,))) for light in lights]
    places = ball.points[::100]
    each = [closed_forms(ball.shape, TISSUE, [one])["series"].exitance(places) for one in deposits]
    together = closed_forms(ball.shape, TISSUE, deposits)["series"]
    assert together.exitance(places) == pytest.approx(np.sum(each, axis=0), rel=1e-12)
    assert np.ptp(each[2]) == np.ptp(each[3]) == 0
    assert closed_forms(ball.shape, TISSUE, [CollimatedBeam((0.0, 0.0, -1.0)).deposit_in(Body(ball, (TISSUE,)))]) == {}
    assert closed_forms(None, TISSUE, deposits) == {}


def test_the_registry_has_both_faces_of_a_slab() -> None:
    """Away from the rim, power that leaves a plate through each face is that of the closed form."""
    plate = slab(60.0, 2.0)
    deposit = PointSource((1.0, 2.0, -0.5)).deposit_in(Body(plate, (TISSUE,)))
    form = closed_forms(plate.shape, TISSUE, [deposit])["robin"]
    radius, weight = np.polynomial.legendre.leggauss(400)
    rho, weight = 10.0 * (radius + 1.0), 10.0 * weight
    sides: tuple[tuple[float, Face], ...] = ((0.0, "front"), (-2.0, "back"))
    for z, face in sides:
        places = np.column_stack([1.0 + rho, np.full(400, 2.0), np.full(400, z)])
        total = 2.0 * np.pi * (weight * rho) @ form.exitance(places)
        assert total == pytest.approx(exact_slab.point_total(TISSUE, thickness=2.0, depth=0.5, face=face), rel=1e-4)
        assert form.holds_at(places[:200]).all()
    assert not form.holds_at(np.array([[29.9, 0.0, 0.0]]))[0]
