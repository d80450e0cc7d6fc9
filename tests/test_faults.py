"""Faults: killed, interrupted, two at once, full disks, too little memory. Results are whole or not there."""

import fcntl
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing.context import ForkServerProcess
from pathlib import Path

import meshio
import pytest

from tests.conftest import block
from tests.elsewhere import start_elsewhere
from tetlux.cases.chart import files as chart
from tetlux.cases.cli import main
from tetlux.cases.run import ALL_FILES
from tetlux.cases.write.publish import claim_folder, publish
from tetlux.meshing import RunError, sphere, tetrahedralize
from tetlux.meshing.host.scratch import scratch
from tetlux.meshing.mesher import api as mesher
from tetlux.meshing.mesher import child as child_mesher
from tetlux.meshing.mesher.cache import load_cached_mesh, store_cached_mesh

CASE = """\
name: ball
surface: {{sphere: {{radius: 10}}}}
medium: {{sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}}
lights: [{{point: {{position: [0, 0, 9], power: {power}}}}}]
tolerance: 0.1
outputs: [{outputs}]
"""
# Of the power, whatever the mesh: between runs of the mesher it differs by .1 %.
EXITED = 0.7899
linux = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


@pytest.fixture
def case(tmp_path: Path) -> Path:
    return written(tmp_path)


def written(folder: Path, power: float = 2.0, outputs: str = "surface, volume") -> Path:
    path = folder / "ball.yaml"
    path.write_text(CASE.format(power=power, outputs=outputs))
    return path


def finished(folder: Path) -> float | None:
    """The power of the run whose results are there, all of them and of that run; None if there is no summary."""
    if not (folder / "summary.json").exists():
        return None
    summary = json.loads((folder / "summary.json").read_text())
    (channel,) = summary["channels"]
    power = float(channel["power"]["incident"])
    assert channel["power"]["exited"] == pytest.approx(EXITED * power, rel=0.01)
    surface, volume = meshio.read(folder / "surface.ply"), meshio.read(folder / "volume.vtu")
    assert surface.point_data["exitance"].max() == pytest.approx(channel["exitance"]["max"], rel=1e-9)
    assert volume.point_data["fluence"].max() == pytest.approx(channel["fluence"]["max"], rel=1e-9)
    assert len(volume.points) == summary["mesh"]["nodes"]
    return power


def left(folder: Path) -> list[str]:
    """What is in a folder of results beside those of the ball, tables, and logs."""
    known = ("ball", "results.csv", "results.parquet", "index.html", "logs")
    return sorted(path.name for path in folder.iterdir() if path.name not in known)


def processes_in(folder: Path) -> list[int]:
    """The processes, without zombies, whose working directory is in a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            inside = (process / "cwd").readlink().is_relative_to(folder)
            alive = (process / "stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
        except OSError:
            continue
        if inside and alive:
            found.append(int(process.name))
    return found


def wait_until(true: Callable[[], bool], seconds: float = 20.0) -> bool:
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        time.sleep(0.02)
    return true()


@linux
@pytest.mark.slow
@pytest.mark.parametrize("notes", [False, True], ids=["alone", "beside notes"])
def test_killed_at_twenty_moments(notes: bool, tmp_path: Path) -> None:
    """Every run has a power of its own, by which its files are known, and makes its own mesh."""
    out, temporary = tmp_path / "out", tmp_path / "tmp"
    temporary.mkdir()
    environment = {"TMPDIR": str(temporary), "TETLUX_CACHE_DIR": str(tmp_path / "cache")}
    options = [str(tmp_path / "ball.yaml"), "--out", str(out)]

    def start(power: float) -> ForkServerProcess:
        written(tmp_path, power)
        return start_elsewhere(["run", *options, "--no-cache"], tmp_path, environment)

    def run_to_the_end(power: float) -> float:
        started, process = time.monotonic(), start(power)
        process.join()
        assert process.exitcode == 0
        return time.monotonic() - started

    # The first waits for imports too.
    run_to_the_end(1.0)
    whole, power, killed = run_to_the_end(2.0), 2.0, 0
    if notes:
        (out / "ball" / "notes.txt").write_text("mine")
    # Two tests of ten each.
    for moment in range(10):
        power += 1.0
        process = start(power)
        time.sleep(whole * (moment + (0.25 if notes else 0.75)) / 10.0)
        process.kill()
        process.join()
        killed += process.exitcode == -signal.SIGKILL
        assert finished(out / "ball") in (power - 1.0, power)
        assert wait_until(lambda: not processes_in(temporary))
        # The next run, here, where everything is imported.
        power += 1.0
        written(tmp_path, power)
        assert main(["run", *options]) == 0
        assert finished(out / "ball") == power
        assert left(out) == []
        assert (out / "ball" / "notes.txt").exists() == notes
    assert killed >= 5


# Runs a function in a process of its own for each n, which is killed as it makes the n-th change to a folder.
KILLER = """\
import os, pathlib, signal, sys
from pathlib import Path
from tetlux.cases.write.publish import claim_folder, publish

names, out, n = sys.argv[3:], Path(sys.argv[1]), 0
while True:
    target = out / "ball"
    target.mkdir(parents=True, exist_ok=True)
    for path in target.iterdir():
        path.unlink()
    for name in names[1:]:
        (target / name).write_text("old")
    if sys.argv[2]:
        (target / sys.argv[2]).write_text("mine")
    child = os.fork()
    if child == 0:
        def counted(function):
            def call(*arguments, **options):
                global n
                n -= 1
                if n < 0:
                    os.kill(os.getpid(), signal.SIGKILL)
                return function(*arguments, **options)
            return call
        with claim_folder(out, "ball") as folder:
            for name in names[:-2] + names[-1:]:
                (folder / name).write_text("new")
            for name in ("unlink", "mkdir", "rename", "replace", "rmdir"):
                setattr(pathlib.Path, name, counted(getattr(pathlib.Path, name)))
            publish(folder, target, names)
        os._exit(0)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    print(n, code, {path.name: path.read_text() for path in target.iterdir()}, flush=True)
    with claim_folder(out, "ball"):
        pass
    if code == 0:
        break
    n += 1
print([path.name for path in out.iterdir()])
"""


@pytest.mark.parametrize("notes", ["", "notes.txt"])
def test_killed_between_any_two_changes(notes: str, tmp_path: Path) -> None:
    """An earlier run wrote all files but the first, this one all but the last but one."""
    done = subprocess.run(
        [sys.executable, "-c", KILLER, str(tmp_path), notes, *ALL_FILES], capture_output=True, text=True, check=True
    )
    *lines, names = done.stdout.splitlines()
    # All files go, and another folder is put in the place of theirs; or all of its files, and it is removed.
    assert len(lines) == len(ALL_FILES) + 2 + bool(notes) * len(ALL_FILES)
    old, new = set(ALL_FILES[1:]), set(ALL_FILES) - {ALL_FILES[-2]}
    for line in lines:
        _, code, text = line.split(" ", 2)
        found: dict[str, str] = eval(text)
        assert found.pop(notes, "mine") == "mine"
        # Never a mixture, and with a summary everything.
        assert len(set(found.values())) <= 1
        if "summary.json" in found:
            assert set(found) == (old if set(found.values()) == {"old"} else new)
        assert code == ("0" if line == lines[-1] else "-9")
    assert set(found) == new
    assert eval(names) == ["ball"]


def test_the_second_of_two_runs_is_refused(case: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    with claim_folder(out, "ball") as folder:
        (folder / "surface.ply").write_text("half")
        assert main(["run", str(case), "--out", str(out)]) == 1
        printed = capsys.readouterr()
        assert f"another run is at work on {out / 'ball'}; wait for its end" in printed.err
        assert (folder / "surface.ply").read_text() == "half"
    assert main(["run", str(case), "--out", str(out)]) == 0
    assert finished(out / "ball") == 2.0
    assert left(out) == []


# Processes that all want the same folder at once; each is alone while it has it.
RACER = """\
import os, sys, time
from pathlib import Path
from tetlux.cases.write.publish import claim_folder, publish
from tetlux.meshing import RunError

out, me, done = Path(sys.argv[1]), sys.argv[2], 0
while done < 40:
    try:
        with claim_folder(out, "ball") as folder:
            (folder / "alone").mkdir()
            for name in ("a", "b", "c"):
                (folder / name).write_text(me)
            publish(folder, out / "ball", ("a", "b", "c"))
            done += 1
    except RunError:
        time.sleep(0.0005)
"""


def test_many_may_want_one_folder(tmp_path: Path) -> None:
    racers = [
        subprocess.Popen([sys.executable, "-c", RACER, str(tmp_path), str(number)], stderr=subprocess.PIPE, text=True)
        for number in range(3)
    ]
    for racer in racers:
        assert racer.communicate()[1] == ""
        assert racer.returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ["ball"]
    assert len({(tmp_path / "ball" / name).read_text() for name in ("a", "b", "c")}) == 1


def test_a_run_that_ends_leaves_the_next_one_its_folder(tmp_path: Path) -> None:
    """What it wrote into is the final folder by then, and the next one's has the name that it had."""
    with ExitStack() as first:
        folder = first.enter_context(claim_folder(tmp_path, "ball"))
        (folder / "summary.json").write_text("{}")
        publish(folder, tmp_path / "ball", ["summary.json"])
        with claim_folder(tmp_path, "ball") as again:
            first.close()
            assert again.is_dir()
    assert [path.name for path in tmp_path.iterdir()] == ["ball"]


def test_what_a_killed_run_left_is_not_published(tmp_path: Path) -> None:
    with claim_folder(tmp_path, "ball") as folder:
        pass
    (folder / "results").mkdir(parents=True)
    (folder / "surface.ply").write_text("half")
    with claim_folder(tmp_path, "ball") as folder:
        (folder / "summary.json").write_text("{}")
        publish(folder, tmp_path / "ball", ["surface.ply", "summary.json"])
    assert [path.name for path in (tmp_path / "ball").iterdir()] == ["summary.json"]


def test_the_lock_is_on_the_folder_that_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The process that had it before may remove its folder, and another one make it, just before it is locked."""
    usual, calls = fcntl.flock, []

    def meanwhile(descriptor: int, operation: int) -> None:
        calls.append(0)
        (place,) = tmp_path.iterdir()
        if len(calls) < 3:
            place.rename(tmp_path.with_name(f"gone-{len(calls)}"))
        if len(calls) == 1:
            place.mkdir()
        usual(descriptor, operation)

    monkeypatch.setattr(fcntl, "flock", meanwhile)
    with claim_folder(tmp_path, "ball"), pytest.raises(RunError, match="another run"), claim_folder(tmp_path, "ball"):
        pass
    assert len(calls) == 4
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def signals() -> Iterator[None]:
    """Handlers as they were before."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


# What interrupts the process that started it, and would then go on for a minute.
INTERRUPTS = (sys.executable, "-c", "import os, time; os.kill(os.getppid(), 2); time.sleep(60)")


@linux
@pytest.mark.usefixtures("signals")
@pytest.mark.parametrize("stage", ["reading", "meshing", "solving", "writing", "drawing", "publishing"])
def test_interrupted_at_any_stage(
    stage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, temporary = tmp_path / "out", tmp_path / "tmp"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))

    def interrupted(*_: object, **__: object) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(60)

    if stage == "meshing":
        monkeypatch.setattr(child_mesher, "MESHER", INTERRUPTS)
    else:
        where = {
            "reading": "tetlux.cases.batch.requests.load_cases",
            "solving": "tetlux.fem.error.by_operator.estimate_error",
            "writing": "tetlux.cases.run.write_mesh",
            "drawing": "tetlux.cases.picture.draw.draw_frame",
            "publishing": "tetlux.cases.run.publish",
        }[stage]
        monkeypatch.setattr(where, interrupted)
    started = time.monotonic()
    case = written(tmp_path, outputs="surface, volume, picture" if stage == "drawing" else "surface, volume")
    assert main(["run", str(case), "--out", str(out), "--no-cache"]) == 130
    assert time.monotonic() - started < 30
    assert capsys.readouterr().err == "tetlux: interrupted; finished cases are kept.\n"
    assert not out.exists() or list(out.iterdir()) == []
    assert list(temporary.iterdir()) == []
    assert processes_in(temporary) == []


def test_the_package_is_imported_where_an_interruption_is_caught() -> None:
    code = "import sys, tetlux.cases.cli; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@linux
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_scheduler_may_stop_it(number: signal.Signals, tmp_path: Path) -> None:
    if signal.getsignal(number) == signal.SIG_IGN:
        pytest.skip("the tests themselves were started so that they ignore it, as by nohup")
    temporary = tmp_path / "tmp"
    temporary.mkdir()
    # Its mesher would take for ever.
    hanging = "import sys; from tetlux.meshing.mesher import child; from tetlux.cases.cli import main;" + (
        "child.MESHER = (sys.executable, '-c', 'import time; time.sleep(60)'); sys.exit(main(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", hanging, "run", str(written(tmp_path)), "--out", str(tmp_path / "out")]
    environment = {**os.environ, "TMPDIR": str(temporary), "TETLUX_CACHE_DIR": str(tmp_path / "cache")}
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        assert wait_until(lambda: processes_in(temporary) != [], 60)
        process.send_signal(number)
        assert process.communicate()[1] == "tetlux: interrupted; finished cases are kept.\n"
    assert process.returncode == 130
    assert list(temporary.iterdir()) == []
    assert list((tmp_path / "out").iterdir()) == []
    assert processes_in(temporary) == []


@contextmanager
def no_file_larger_than(size: int) -> Iterator[None]:
    """Lets the system refuse to make a larger file, as a full disk would; what tests print may be in one too."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("outputs", ["surface", "volume", "picture", ""])
def test_a_full_disk_leaves_the_earlier_run(outputs: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["run", str(tmp_path / "ball.yaml"), "--out", str(tmp_path / "out")]
    written(tmp_path, 2.0)
    assert main(command) == 0
    written(tmp_path, 3.0, outputs)
    capsys.readouterr()
    # The mesh is remembered; not even a summary is as small as this.
    with no_file_larger_than(500):
        assert main(command) == 1
    first, second = capsys.readouterr().err.splitlines()
    assert first == (
        f"tetlux: ball failed: results cannot be written to {tmp_path / 'out' / 'ball'}: File too large; "
        "choose another folder with --out."
    )
    assert second == "tetlux: 1 of 1 cases failed."
    assert finished(tmp_path / "out" / "ball") == 2.0
    assert left(tmp_path / "out") == []


def test_a_full_disk_for_temporary_files(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    cache.mkdir()
    with (
        no_file_larger_than(1_000),
        pytest.raises(RunError, match=r"could not be run \(File too large\); make room in the system's folder"),
    ):
        tetrahedralize(sphere(10.0), cache=cache)
    # Enough for what the mesher is given, and not for what it returns.
    with (
        no_file_larger_than(40_000),
        pytest.raises(RunError, match=r"failed \(OSError: .*File too large\); make room in the system's folder"),
    ):
        tetrahedralize(sphere(10.0), cache=cache)
    assert list(cache.iterdir()) == []


def test_a_full_disk_for_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesher, "_mesh_body", lambda *_: block((9, 9, 9), (1.0, 1.0, 1.0)))
    with no_file_larger_than(10_000):
        assert len(tetrahedralize(sphere(10.0), cache=tmp_path).tetrahedra) == 6 * 9**3
    assert list(tmp_path.iterdir()) == []


def test_a_home_is_not_needed(case: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("TETLUX_CACHE_DIR")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    assert main(["run", str(case), "--out", str(tmp_path / "out")]) == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("command", [["schema"], ["run", "ball.yaml"]])
def test_nowhere_to_print_to(command: list[str], case: Path) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "tetlux.cases", *command],
            cwd=case.parent,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert done.stderr == "tetlux: stopped: [Errno 28] No space left on device; finished cases are kept.\n"


def test_what_is_in_the_way_is_told_before_anything_is_solved(
    case: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tetlux.cases.solve.solve_each", lambda *_, **__: pytest.fail("solved for nothing"))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "ball").write_text("a file")
    assert main(["run", str(case), "--out", str(tmp_path / "out")]) == 1
    assert "ball: Not a directory; choose another folder" in capsys.readouterr().err
    assert (tmp_path / "out" / "ball").read_text() == "a file"
    assert left(tmp_path / "out") == []
    if Path("/proc/self").exists():
        assert main(["run", str(case), "--out", "/proc/out"]) == 2
        assert "results cannot be written to /proc/out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import os; os.kill(os.getpid(), 9)", "signal 9); it was killed, as the system does when memory runs out"),
        ("import os; os.kill(os.getpid(), 11)", "signal 11); repair or simplify the surface"),
        ("raise SystemExit", "no message); repair or simplify the surface"),
    ],
)
def test_a_mesher_that_dies_fails_its_case_only(
    code: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    good = written(tmp_path)
    (tmp_path / "bad.yaml").write_text(good.read_text().replace("name: ball", "").replace("radius: 10", "radius: 11"))
    assert main(["run", str(good), "--out", str(tmp_path / "first")]) == 0
    # The ball's mesh is remembered.
    monkeypatch.setattr(child_mesher, "MESHER", (sys.executable, "-c", code))
    assert main(["run", str(tmp_path / "bad.yaml"), str(good), "--out", str(tmp_path / "out")]) == 1
    assert f"tetlux: bad failed: sphere: the mesher failed ({said}" in capsys.readouterr().err
    assert finished(tmp_path / "out" / "ball") == 2.0


def test_a_chart_is_replaced_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = chart.chart_files("chart")
    for name in names:
        (tmp_path / name).write_text("old")
    monkeypatch.setattr(chart, "draw_chart", lambda _, path: path.write_text("new"))
    monkeypatch.setattr(chart, "as_data", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        chart.write_chart([], tmp_path, "chart")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == dict.fromkeys(names, "old")
    monkeypatch.setattr(chart, "as_data", lambda _: {})
    chart.write_chart([], tmp_path, "chart")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert (tmp_path / "chart.json").read_text() == "{}\n"


# Writes meshes of two names for ever.
WRITER = """\
import sys
from pathlib import Path
from tests.conftest import block
from tests.elsewhere import start_elsewhere
from tetlux.meshing.mesher.cache import store_cached_mesh

while True:
    for number in (1, 2):
        store_cached_mesh(str(number), Path(sys.argv[1]), block((20, 20, number), (1.0, 1.0, 1.0)))
        print(number, flush=True)
"""


def test_a_cache_whose_writers_are_killed(tmp_path: Path) -> None:
    root = Path(__file__).parents[1]
    command = [sys.executable, "-c", WRITER, str(tmp_path)]
    sizes = {"1": 6 * 400, "2": 6 * 800}
    with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=root, text=True) as other:
        for moment in range(6):
            with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=root, text=True) as writer:
                assert writer.stdout is not None
                writer.stdout.readline()
                time.sleep(0.007 * moment)
                writer.kill()
            for key, size in sizes.items():
                mesh = load_cached_mesh(key, tmp_path, "mm")
                assert mesh is None or len(mesh.tetrahedra) == size
        other.kill()
    for path in tmp_path.glob("*.part"):
        os.utime(path, (time.time() - 90_000,) * 2)
    for key in sizes:
        store_cached_mesh(key, tmp_path, block((1, 1, 1), (1.0, 1.0, 1.0)))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["1.npz", "2.npz"]


def test_what_killed_processes_left_goes_after_a_day(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    for name, age in (("tetlux-mesher-a", 2), ("tetlux-mesher-b", 0), ("tetlux-picture-a", 2), ("mesher", 2)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "input.npz").write_text("")
        os.utime(tmp_path / name, (time.time() - age * 86_400 - 10,) * 2)
    with scratch("mesher") as folder:
        assert folder.is_dir()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mesher", "tetlux-mesher-b", "tetlux-picture-a"]
