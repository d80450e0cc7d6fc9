"""``tetlux compare A B``: two finished runs side by side."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tetlux.cases import load_result
from tetlux.cases.cli import main
from tetlux.cases.results.compare import SIZE, difference

CASE = """\
surface: {{sphere: {{radius: {radius}}}}}
unit: {unit}
medium: {{sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}}
lights: [{{point: {{position: [0, 0, 3], power: {power}}}}}]
detectors: [{{name: top, point: [0, 0, {radius}]}}]
model: closed-form
outputs: [surface]
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("compared")
    for name, radius, unit, power in (
        ("a", 10, "mm", 1.0),
        ("b", 10, "mm", 1.5),
        ("c", 8, "mm", 1.0),
        ("d", 10, "cm", 1.0),
    ):
        (folder / f"{name}.yaml").write_text(CASE.format(radius=radius, unit=unit, power=power))
    cases = [str(folder / f"{name}.yaml") for name in "abcd"]
    assert main(["run", *cases, "--out", str(folder), "--quiet", "--jobs", "1"]) == 0
    return folder


def test_figures_and_picture_say_that_b_is_half_as_bright_again(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", str(runs / "a"), str(runs / "b"), "--out", str(tmp_path / "ab.png")]) == 0
    lines = capsys.readouterr().out.splitlines()
    for name in ("exited power, W", "largest exitance", "top"):
        (line,) = (each for each in lines if each.startswith(name))
        assert line.endswith("+50.00 %")
        a, b = (float(number) for number in line.removeprefix(name).split()[:2])
        assert b == pytest.approx(1.5 * a, rel=1e-4)
    assert "exitance: B - A is 50 % of A in the L2 norm" in lines
    assert "exitance: vertex by vertex 50 % in the median, 50 % at the 95th percentile" in lines
    with Image.open(tmp_path / "ab.png") as image:
        assert image.size == (3 * SIZE[0], SIZE[1])
        shown = np.asarray(image, dtype=float)
    bodies = [shown[SIZE[1] // 2 + 15, SIZE[0] * panel + 355] for panel in range(3)]
    # On one scale B is brighter; where B is above A the difference is red.
    assert bodies[1].sum() > bodies[0].sum() + 10
    assert bodies[2][0] > 2 * bodies[2][2]


def test_a_difference_takes_the_value_at_the_same_place(runs: Path) -> None:
    a, b = load_result(runs / "a"), load_result(runs / "b")
    assert a.points is not None
    assert b.points is not None
    found = difference(a, b, a.points[:, 2] + 20, b.points[:, 2] + 23)
    assert found is not None
    np.testing.assert_allclose(found.relative, 3 / (a.points[:, 2] + 20), atol=1e-3)
    # Of z + 20 over a ball of radius 10: sqrt(400 + 100/3).
    assert found.l2 == pytest.approx(3 / np.sqrt(400 + 100 / 3), rel=5e-3)


def test_other_bodies_have_no_difference(runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(runs / "a"), str(runs / "c"), "--out", str(tmp_path / "ac.png")]) == 0
    assert "the bodies differ: there is no difference of their surfaces." in capsys.readouterr().out
    with Image.open(tmp_path / "ac.png") as image:
        assert image.size == (2 * SIZE[0], SIZE[1])


def test_what_cannot_be_compared_is_refused(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, sentence in (
        (["a", "d"], r"a is in mm, .*d is in cm|a is in mm, .*d in cm; run both in one unit\."),
        (["a", "none"], r"none holds no summary.json; give the folder of a finished run\."),
        (["a", "b", "--field", "red"], r'a has no field "red"; its fields are exitance\.'),
    ):
        assert main(["compare", *(str(runs / each) for each in arguments[:2]), *arguments[2:]]) == 2
        assert re.search(sentence, capsys.readouterr().err)
