"""Batches on a Dask cluster: a real scheduler and real workers on loopback, of which one is killed."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from glob import glob
from pathlib import Path
from typing import Any

import pytest

from tetlux.cases.batch.cluster import solve_remotely
from tetlux.cases.batch.engine import run_batch
from tetlux.cases.batch.events import RunFinished
from tetlux.cases.batch.jobs import RunJob, SolveJob
from tetlux.cases.batch.requests import load_all
from tetlux.cases.batch.wire import pack
from tetlux.cases.cli import main

BALL = """
unit: mm
surface: {sphere: {radius: 10}}
medium: {sigma_a: 0.01, sigma_s_prime: 1.0, eta: 1.4}
lights:
  - pencil: {origin: [0, 0, 20], direction: [0, 0, -1], power: 1.0}
tolerance: 0.1
outputs: []
"""
SWEEP = "sweep: {medium.sigma_a: [0.01, 0.011, 0.012, 0.013, 0.014, 0.015, 0.016, 0.017]}\n"


def channels(out: Path) -> dict[str, Any]:
    paths = map(Path, glob(f"{out}/*/*/summary.json"))  # noqa: PTH207 - folders vanish
    return {path.parent.name: json.loads(path.read_text())["channels"] for path in paths}


def start(*arguments: str) -> "subprocess.Popen[bytes]":
    one_thread = dict.fromkeys(("TETLUX_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    return subprocess.Popen(
        [sys.executable, "-m", *arguments],
        env={**os.environ, **one_thread},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@contextmanager
def running(folder: Path, *, workers: int = 2, preload: str = "") -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """The scheduler file of a cluster, and its first worker. Workers run some code before all else."""
    file = str(folder / "scheduler.json")
    here = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file)
    processes = [start("distributed.cli.dask_scheduler", *here)]
    for _ in range(workers):
        own = ("--scheduler-file", file, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        processes.append(start("distributed.cli.dask_worker", *own, *(("--preload", preload) if preload else ())))
    while not Path(file).is_file():
        assert processes[0].poll() is None
        time.sleep(0.05)
    try:
        yield file, processes[1]
    finally:
        for process in processes:
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """The scheduler file of a cluster of two workers, and one of these."""
    with running(tmp_path_factory.mktemp("dask")) as found:
        yield found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("preload", "sentence"),
    [
        ("import tetlux; tetlux.__version__ = '0.0.1'", r"has tetlux 0\.0\.1 \(numerics \d+\) on Python"),
        ("import sys; sys.modules['tetlux'] = None", r"has Python [\d.]+ without tetlux, and here is tetlux"),
        (
            "import tetlux.cases.write.content as content; content.NUMERICS = 0",
            r"has tetlux [\d.]+\w* \(numerics 0\) on",
        ),
    ],
)
def test_workers_with_another_version_are_refused(
    preload: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "ball.yaml").write_text(BALL)
    (tmp_path / "preload.py").write_text(preload)
    with running(tmp_path, workers=1, preload=str(tmp_path / "preload.py")) as (file, _):
        request = [str(tmp_path / "ball.yaml"), "--scheduler", file, "--out", str(tmp_path / "out")]
        assert main(["run", *request]) == 2
    errors = capsys.readouterr().err
    assert re.search(sentence, errors)
    assert errors.count("\n") == 1
    assert "install the same on both" in errors
    assert not list((tmp_path / "out").glob("*/*"))


@pytest.mark.slow
def test_a_cluster_finds_what_one_process_finds_though_a_worker_is_killed(
    cluster: tuple[str, "subprocess.Popen[bytes]"], tmp_path: Path
) -> None:
    file, worker = cluster
    (tmp_path / "ball.yaml").write_text(BALL + SWEEP)
    request = [str(tmp_path / "ball.yaml"), "--scheduler", file, "--out", str(tmp_path / "out")]
    with start("tetlux", "run", *request) as batch:
        while not channels(tmp_path / "out") and batch.poll() is None:
            time.sleep(0.02)
        worker.send_signal(signal.SIGKILL)
        assert batch.wait() == 0
    run_batch(load_all([str(tmp_path / "ball.yaml")]), tmp_path / "here", jobs=1)
    assert len(channels(tmp_path / "here")) == 8
    assert channels(tmp_path / "out") == channels(tmp_path / "here")
    assert not list((tmp_path / "out").glob(".*"))


def test_files_come_back_as_bytes_where_the_folder_is_not_shared(tmp_path: Path) -> None:
    (tmp_path / "ball.yaml").write_text(BALL)
    (case,) = load_all([str(tmp_path / "ball.yaml")])
    job = SolveJob(0, 0, None, (RunJob(0, case, 0),), {}, str(tmp_path / "elsewhere"), True)
    data, shared = pack(job)
    ((event, files),) = solve_remotely(data, list(shared), *shared.values(), probe=str(tmp_path / "missing"))
    assert isinstance(event, RunFinished)
    assert json.loads(files["summary.json"]) == event.summary
    assert not (tmp_path / "elsewhere").exists()


@pytest.mark.parametrize(
    ("scheduler", "sentence"),
    [
        ("missing.json", "missing.json is no scheduler file"),
        ("tcp://127.0.0.1:9", "no Dask scheduler answers at tcp://127.0.0.1:9; start one"),
        ("http://127.0.0.1:9", "no Dask scheduler answers at http://127.0.0.1:9; start one"),
        ("tcp://127.0.0.1", "no Dask scheduler answers at tcp://127.0.0.1; start one"),
        ("tcp://127.0.0.1:99999", "no Dask scheduler answers at tcp://127.0.0.1:99999; start one"),
        ("tcp://nowhere.invalid:8786", "no Dask scheduler answers at tcp://nowhere.invalid:8786; start one"),
    ],
)
def test_a_scheduler_that_is_not_there_is_refused(
    scheduler: str,
    sentence: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("tetlux.cases.batch.cluster.PATIENCE", 1)
    (tmp_path / "ball.yaml").write_text(BALL)
    request = [str(tmp_path / "ball.yaml"), "--scheduler", scheduler, "--out", str(tmp_path / "out")]
    assert main(["run", *request]) == 2
    assert sentence in capsys.readouterr().err
    assert not list((tmp_path / "out").glob("*/*"))


def test_a_server_that_is_no_scheduler_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tetlux.cases.batch.cluster.PATIENCE", 0.2)
    (tmp_path / "ball.yaml").write_text(BALL)
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        assert main(["run", str(tmp_path / "ball.yaml"), "--scheduler", address, "--out", str(tmp_path / "out")]) == 2
    assert f"no Dask scheduler answers at {address}; start one" in capsys.readouterr().err
