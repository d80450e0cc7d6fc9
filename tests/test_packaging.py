"""The package as it is installed."""

import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

from tetlux import cases, fem, meshing
from tetlux.cases.case import library_folder
from tetlux.cases.cli import main

ROOT = Path(__file__).parents[1]


def test_every_folder_of_code_is_in_the_package() -> None:
    """A subpackage that is not listed runs from a checkout and is missing from the wheel."""
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    found = {
        f"tetlux.{'.'.join(path.parent.relative_to(ROOT).parts)}"
        for top in ("meshing", "fem", "cases")
        for path in (ROOT / top).rglob("*.py")
    }
    assert found == set(listed)


def test_the_types_and_the_cases_ship() -> None:
    for package in (meshing, fem, cases):
        assert package.__file__ is not None
        assert Path(package.__file__).with_name("py.typed").is_file()
    shipped = {path.name for path in library_folder().iterdir()}
    assert {"hare.stl", "hare.yaml", "slab.yaml", "sphere.yaml", "torus.yaml"} <= shipped


def test_dependencies_run_one_way() -> None:
    """cases -> fem -> meshing."""
    for folder, forbidden in (("meshing", ("tetlux.fem", "tetlux.cases")), ("fem", ("tetlux.cases",))):
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            assert not any(f"import {name}" in text or f"from {name}" in text for name in forbidden), path


def imports_of(*paths: Path) -> set[str]:
    """Modules of the package that modules import."""
    pattern = re.compile(r"^\s*(?:from|import) (tetlux[\w.]*)", re.MULTILINE)
    return {name for path in paths for name in pattern.findall(path.read_text(encoding="utf-8"))}


def test_rooms_that_measure_lead_nowhere_back() -> None:
    """Comparisons know no case file, the stress map knows the chart's samples only, the solver no closed forms."""
    compare, stress, chart = (
        imports_of(*(ROOT / "cases" / room).rglob("*.py")) for room in ("compare", "stress", "chart")
    )
    assert {name for name in compare if name.startswith("tetlux.cases")} <= {
        f"tetlux.cases.compare.{name}" for name in ("comparison", "differences", "picture")
    }
    assert {name for name in stress if name.startswith("tetlux.cases.chart")} == {"tetlux.cases.chart.samples"}
    assert not any(name.startswith(("tetlux.cases.stress", "tetlux.cases.compare")) for name in chart)
    solver = [path for path in (ROOT / "fem").rglob("*.py") if "exact" not in path.relative_to(ROOT).parts]
    assert not any(name.startswith("tetlux.fem.exact") for name in imports_of(*solver))


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--version"])
    assert stop.value.code == 0
    assert capsys.readouterr().out == f"tetlux {version('tetlux')}\n"


@pytest.mark.parametrize("arguments", [[], ["fly"], ["run"], ["run", "sphere", "--fast"]])
def test_a_wrong_command_line_ends_with_two(arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2


def test_the_module_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tetlux.cases", "check", "sphere"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("sphere: right; 5,120 triangles, 20 x 20 x 20 mm")
