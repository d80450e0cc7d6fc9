"""The package as it is installed."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections import Counter
from graphlib import TopologicalSorter
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from tetlux import cases, fem, meshing
from tetlux.cases.cli import main
from tetlux.cases.shipped import library_folder

ROOT = Path(__file__).parents[1]
SETUPTOOLS: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, str]:
    """The environment of a Python that finds the package as `package-dir` lays it out, however it runs here."""
    for name, folder in sorted(SETUPTOOLS["package-dir"].items()):
        target = tmp_path.joinpath(*name.split("."))
        if name == "tetlux":
            target.mkdir()
            for file in (ROOT / folder).glob("*.py"):
                (target / file.name).symlink_to(file)
        else:
            target.symlink_to(ROOT / folder)
    return {**os.environ, "PYTHONPATH": str(tmp_path)}


def python(*arguments: str, env: dict[str, str] | None = None) -> str:
    """What a Python prints that is run with these arguments and must find nothing wrong."""
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False, env=env)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_the_package_can_be_imported_by_its_name_alone(installed: dict[str, str]) -> None:
    code = "import sys, tetlux; print(tetlux.__version__, 'numpy' in sys.modules, tetlux.fem.solve.__name__)"
    assert python("-c", code, env=installed) == f"{version('tetlux')} False solve\n"


def test_what_is_not_in_the_package_is_said_as_usual(installed: dict[str, str]) -> None:
    code = "import tetlux; print(hasattr(tetlux, 'sphere'), hasattr(tetlux, 'meshing'), dir(tetlux))"
    assert python("-c", code, env=installed) == "False True ['__version__', 'cases', 'fem', 'meshing']\n"


@pytest.mark.parametrize("module", ["tetlux", "tetlux.cases"])
def test_the_package_is_the_command(module: str, installed: dict[str, str]) -> None:
    assert python("-m", module, "--version", env=installed) == f"tetlux {version('tetlux')}\n"


@pytest.mark.parametrize("arguments", ["--help", "run --help", "list", "show hare"])
def test_what_needs_no_numbers_imports_none(arguments: str) -> None:
    """Numpy and what needs it take half a second, which is long for a word of help."""
    code = (
        "import sys\nfrom tetlux.cases.cli import main\n"
        "try: main(sys.argv[1:])\nexcept SystemExit: pass\n"
        "print(*sorted({'numpy', 'scipy', 'pydantic', 'yaml', 'tetlux.meshing'} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments.split()], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "\n")
    assert len(done.stdout) > 100


def test_every_folder_of_code_is_in_the_package() -> None:
    """A subpackage that is not listed runs from a checkout and is missing from the wheel."""
    folders = {path.parent for top in ("meshing", "fem", "cases") for path in (ROOT / top).rglob("*.py")}
    found = {f"tetlux.{'.'.join(folder.relative_to(ROOT).parts)}" for folder in folders}
    # The package itself lies within a subpackage, of which it is no part.
    assert SETUPTOOLS["package-dir"]["tetlux"] == "cases/package"
    assert found - {"tetlux.cases.package"} | {"tetlux"} == set(SETUPTOOLS["packages"])


def test_the_types_and_the_cases_ship() -> None:
    for package in (meshing, fem, cases):
        assert package.__file__ is not None
        assert Path(package.__file__).with_name("py.typed").is_file()
    shipped = {path.name for path in library_folder().iterdir()}
    assert {"finger-fit.csv", "hare.stl", "hare.yaml", "slab.yaml", "sphere.yaml", "torus.yaml"} <= shipped


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


def test_arrows_between_rooms_form_no_cycle() -> None:
    """A room is a folder; a module that is in none, such as fem/solve.py, is a room of its own."""
    modules = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts): path
        for top in ("meshing", "fem", "cases")
        for path in (ROOT / top).rglob("*.py")
        if path.name != "__init__.py"
    }

    def room_of(module: str) -> str:
        return module.rsplit(".", 1)[0] if module.count(".") > 1 else module

    arrows: dict[str, set[str]] = {}
    for module, path in modules.items():
        named = {name.removeprefix("tetlux.") for name in imports_of(path)}
        rooms = {room_of(name) for name in named if name in modules}
        arrows.setdefault(room_of(module), set()).update(rooms - {room_of(module)})
    # Raises a CycleError that names them.
    assert set(TopologicalSorter(arrows).static_order()) >= {"meshing.surface", "fem.solve", "cases.file"}


def test_rooms_that_measure_lead_nowhere_back() -> None:
    """Comparisons know no case file, the stress map the chart's samples only, numerical models no closed forms."""
    compare, stress, chart = (
        imports_of(*(ROOT / "cases" / room).rglob("*.py")) for room in ("compare", "stress", "chart")
    )
    assert {name for name in compare if name.startswith("tetlux.cases")} <= {
        f"tetlux.cases.compare.{name}" for name in ("comparison", "differences", "picture")
    }
    assert {name for name in stress if name.startswith("tetlux.cases.chart")} == {"tetlux.cases.chart.samples"}
    assert not any(name.startswith(("tetlux.cases.stress", "tetlux.cases.compare")) for name in chart)
    by_closed_form = {"exact", "planner", "truncated", "closed_form.py", "exact_field.py"}
    solver = [path for path in (ROOT / "fem").rglob("*.py") if not by_closed_form & set(path.relative_to(ROOT).parts)]
    assert not any(name.startswith("tetlux.fem.exact") for name in imports_of(*solver))


def modules() -> list[Path]:
    """Every module of the package, tests aside."""
    return [path for top in ("meshing", "fem", "cases") for path in sorted((ROOT / top).rglob("*.py"))]


def lines_of_body(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines between the docstring, or the signature, and the end of a function."""
    first, *rest = function.body
    is_docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    before = first.end_lineno if is_docstring and rest else first.lineno - 1
    assert function.end_lineno is not None
    assert before is not None
    return function.end_lineno - before


def test_files_functions_and_folders_stay_small() -> None:
    """At most 300 lines in a file, 45 in the body of a function, and 15 modules in a folder."""
    texts = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in modules()}
    assert {name: size for name, text in texts.items() if (size := len(text.splitlines())) > 300} == {}
    functions = {
        f"{name}: {node.name}": lines_of_body(node)
        for name, text in texts.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }
    assert {name: size for name, size in functions.items() if size > 45} == {}
    folders = Counter(path.parent for path in modules() if path.name != "__init__.py")
    assert {folder.relative_to(ROOT).as_posix(): count for folder, count in folders.items() if count > 15} == {}


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


def test_the_cases_that_ship_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == sorted(path.stem for path in library_folder().glob("*.yaml"))
    assert "hare       A figure with thick and thin parts: the beam enters at the root of an ear." in lines


def test_a_case_that_is_shown_can_be_run_from_elsewhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "hare"]) == 0
    mine = tmp_path / "mine.yaml"
    mine.write_text(capsys.readouterr().out, encoding="utf-8")
    assert main(["check", str(mine)]) == 0
    assert "9,600 triangles" in capsys.readouterr().out
    # A file of one's own is shown as it is.
    mine.write_text("surface: {file: a.stl}  # µ\n", encoding="utf-8")
    assert main(["show", str(mine)]) == 0
    assert capsys.readouterr().out == "surface: {file: a.stl}  # µ\n"


def test_what_cannot_be_shown_gets_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    for request, words in (
        ("hair", 'hair: did you mean "hare"? it is neither a file nor one of the shipped cases: candle,'),
        (str(tmp_path), "Is a directory"),
        (str(tmp_path / "binary.yaml"), "is not UTF-8 text"),
        ("no/such.yaml", "No such file"),
        ("bunny.stl", "surface: {file: bunny.stl}"),
    ):
        assert main(["show", request]) == 2
        shown = capsys.readouterr()
        assert shown.out == ""
        assert words in shown.err
        assert shown.err.count("\n") == 1


def test_a_command_that_does_not_exist_gets_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["runn", "hare"])
    assert stop.value.code == 2
    assert 'there is no command "runn"; did you mean "run"? the commands are run, check' in capsys.readouterr().err


def test_the_exit_code_is_that_of_the_command(installed: dict[str, str]) -> None:
    for module in ("tetlux", "tetlux.cases"):
        command = [sys.executable, "-m", module, "check", "missing.yaml"]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=installed)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith("tetlux: missing.yaml")


def test_the_module_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tetlux.cases", "check", "sphere"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("sphere: ok: 5,120 triangles, 20 x 20 x 20 mm")


def test_the_reference_has_all_that_loads_results() -> None:
    """These are imported when they are asked for, so that the page has to name each of them."""
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    for name in cases.__all__:
        assert f"tetlux.cases.{name}\n" in page
