"""What commands import, and whether the seconds of a run are those of its process."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.conftest import needs
from tetlux.cases.batch import launch
from tetlux.meshing.host import blocks

# Each takes a tenth of a second or more to import, alone or with what it needs.
PICTURES = ("matplotlib", "pyvista", "vtkmodules")
READERS = ("trimesh", "meshio", "PIL", "networkx", "lxml")
SOLVERS = ("skfem", "pyamg", "pytetwild", "numba", "scipy.interpolate", "scipy.optimize")
CASE = """\
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights: [{pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 1}}]
tolerance: 0.5
"""


def imported(code: str, names: tuple[str, ...], *arguments: str) -> list[str]:
    """The modules of these names that a new process has imported after running some code."""
    code = f"import sys\n{code}\nprint('IMPORTED', *(name for name in {names!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("IMPORTED")]
    return line.split()[1:]


def test_help_imports_nothing() -> None:
    code = "from tetlux.cases.cli import main\ntry:\n    main(['--help'])\nexcept SystemExit:\n    pass"
    assert imported(code, ("numpy", "yaml", "pydantic", *PICTURES, *READERS, *SOLVERS)) == []


def test_a_worker_starts_before_libraries_are_imported() -> None:
    assert imported("import tetlux.cases.batch.launch", ("numpy", "tetlux.meshing")) == []
    assert (launch.CORES, launch.THREADS_VARIABLE) == (blocks.CORES, blocks.THREADS_VARIABLE)


def test_garbage_is_collected_after_a_run(tmp_path: Path) -> None:
    (tmp_path / "ball.yaml").write_text(CASE + "outputs: []\n")
    code = "import gc\nfrom tetlux.cases.cli import main\nmain(['run', *sys.argv[1:]])\nassert gc.isenabled()"
    assert imported(code, ("numpy",), str(tmp_path / "ball.yaml"), "--out", str(tmp_path / "out")) == ["numpy"]


def test_a_command_imports_no_translator_of_fortran(tmp_path: Path) -> None:
    (tmp_path / "ball.yaml").write_text(CASE + "outputs: []\n")
    code = "from tetlux.cases.cli import main\nmain(['run', *sys.argv[1:]])"
    arguments = str(tmp_path / "ball.yaml"), "--out", str(tmp_path / "out")
    assert imported(code, ("scipy", "numpy.f2py"), *arguments) == ["scipy"]
    asked = f"{code}\nimport numpy\nassert callable(numpy.f2py.run_main)"
    assert imported(asked, ("numpy.f2py",), *arguments) == ["numpy.f2py"]


def test_the_solver_imports_no_pictures_and_no_readers() -> None:
    assert imported("import tetlux.fem", (*PICTURES, *READERS, *SOLVERS, "pydantic")) == []


@needs("pyarrow")
def test_a_table_needs_no_pandas() -> None:
    code = "from tetlux.cases.results.parquet import parquet_of\nassert parquet_of([{'x': 1.0}], ['x'])"
    assert imported(code, ("pandas", "pyarrow")) == ["pyarrow"]


def test_closed_forms_are_imported_when_they_are_asked_for() -> None:
    names = ("tetlux.fem.exact.monte_carlo",)
    assert imported("import tetlux.fem.exact", names) == []
    assert imported("from tetlux.fem import exact\nassert exact.monte_carlo.__doc__", names) == [*names]


@needs("embreex")
def test_a_run_imports_what_it_uses(tmp_path: Path) -> None:
    code = (
        "from pathlib import Path\nfrom tetlux.cases.file.load import load_cases\n"
        "from tetlux.cases.run import run_case\n"
        "run_case(load_cases(Path(sys.argv[1]))[0], Path(sys.argv[2]))"
    )
    unused = (
        *PICTURES,
        *READERS,
        "pytetwild",
        "numba",
        "scipy.interpolate",
        "scipy.optimize",
        "urllib.request",
        "tetlux.cases.picture.draw",
    )
    for outputs, names in (("[]", unused), ("[picture]", tuple(set(unused) - {"PIL", "tetlux.cases.picture.draw"}))):
        (tmp_path / "case.yaml").write_text(CASE + f"outputs: {outputs}\n")
        assert imported(code, names, str(tmp_path / "case.yaml"), str(tmp_path / "out")) == []


@pytest.mark.parametrize("outputs", ["[]", "[surface, picture]"])
def test_seconds_add_up_to_those_of_the_process(outputs: str, tmp_path: Path) -> None:
    (tmp_path / "case.yaml").write_text(CASE + f"outputs: {outputs}\n")
    command = [sys.executable, "-m", "tetlux", "run", str(tmp_path / "case.yaml"), "--out", str(tmp_path / "out")]
    started = time.perf_counter()
    lines, whole = [], 0.0
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if " s  " in line:
                lines.append(line.split(" s  ", 1)[1])
            if "written in" in line:
                whole = time.perf_counter() - started
    assert process.returncode == 0
    seconds = json.loads((tmp_path / "out" / "case" / "summary.json").read_text())["seconds"]
    total = seconds.pop("total")
    assert sum(seconds.values()) == pytest.approx(total, abs=1e-3)
    # Not counted is the start of Python itself: measured 1 to 4 % of 3 to 6 s.
    assert 0.6 * whole < total < whole
    assert seconds["start"] > 0
    for beginning in ("read in", "meshed in", "written in"):
        assert len([line for line in lines if line.startswith(beginning)]) == 1
