"""Platforms on which a library has no wheel: what pip installs there, and what tetlux does without it."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

from tests.conftest import TISSUE, block, needs
from tetlux.cases.cli import main
from tetlux.fem import CollimatedBeam, PencilBeam, PointSource, solve
from tetlux.fem.lights import Light
from tetlux.meshing import RunError, sphere, tetrahedralize
from tetlux.meshing.host.libraries import installed_versions

LIGHTS: list[Light] = [
    PencilBeam((0.3, 0.2, 5.0), (0.1, 0.0, -1.0), deposit="line"),
    CollimatedBeam((0.4, 0.1, -1.0), irradiance=0.01),
    PointSource((1.0, 2.0, -3.0)),
]


@pytest.mark.parametrize(
    ("sys_platform", "platform_machine", "missing"),
    [
        ("linux", "x86_64", set()),
        ("linux", "aarch64", {"embreex", "pyamg"}),
        ("darwin", "arm64", set()),
        ("darwin", "x86_64", {"pytetwild"}),
        ("win32", "AMD64", set()),
    ],
)
def test_pip_leaves_out_what_has_no_wheel(sys_platform: str, platform_machine: str, missing: set[str]) -> None:
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [Requirement(each) for each in project["dependencies"]]
    machine = {"sys_platform": sys_platform, "platform_machine": platform_machine}
    assert {each.name for each in needed if each.marker and not each.marker.evaluate(machine)} == missing


def figures() -> dict[str, Any]:
    """A body lit in three ways, on 15,625 nodes: multigrid's, where it is there."""
    solution = solve(block((24, 24, 24), (20.0, 20.0, 20.0)), TISSUE, LIGHTS)
    power, exitance = solution.power, solution.exitance
    return {
        "loaded": [name for name in ("embreex", "pyamg.aggregation") if sys.modules.get(name)],
        "figures": [power.exited, power.absorbed, power.ballistic, *exitance[::200].tolist()],
        "balance_error": power.balance_error,
    }


@pytest.mark.slow
@needs("embreex", "pyamg")
def test_a_given_mesh_is_solved_without_them() -> None:
    hide = "import sys; sys.modules.update(dict.fromkeys(['embreex', 'pyamg', 'pytetwild']))"
    code = f"{hide}; import json; from tests.test_wheels import figures; print(json.dumps(figures()))"
    root = Path(__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=root)
    assert done.returncode == 0, done.stderr
    without, usual = json.loads(done.stdout), figures()
    assert without["loaded"] == []
    assert usual["loaded"] == ["embreex", "pyamg.aggregation"]
    assert without["figures"] == pytest.approx(usual["figures"], rel=1e-7, abs=1e-12)
    assert abs(without["balance_error"]) < 1e-9


def test_without_pytetwild_a_surface_is_not_meshed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pytetwild", None)
    for cache in (False, True):
        with pytest.raises(RunError, match=r"^sphere: pytetwild, .* is not installed, .*; give tetrahedra in place"):
            tetrahedralize(sphere(3.0), cache=cache)
    assert main(["run", "sphere", "--out", str(tmp_path)]) == 1
    said = capsys.readouterr()
    assert said.err.count("pytetwild, which fills surfaces with tetrahedra, is not installed") == 1
    assert "Traceback" not in said.err
    assert not (tmp_path / "sphere" / "summary.json").exists()


def test_versions_are_told_of_what_is_installed() -> None:
    found = installed_versions(("numpy", "a-library-that-nobody-has"))
    assert list(found) == ["numpy"]


@pytest.mark.parametrize(("in_ci", "skipped"), [("", True), ("true", False)])
def test_tests_of_a_missing_library_are_skipped_but_in_ci(
    in_ci: str, skipped: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CI", in_ci)
    assert needs("numpy", "a_library_that_nobody_has").args == (skipped,)
    assert needs("numpy").args == (False,)
