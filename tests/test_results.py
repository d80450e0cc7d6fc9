"""Tables of a batch, its page, and loading results again."""

import csv
import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tetlux.cases import load_result, load_results
from tetlux.cases.batch.events import BatchEnded, BatchStarted, RunFailed, RunFinished
from tetlux.cases.cli import main
from tetlux.cases.file.load import load_cases
from tetlux.cases.results.batch_tables import BatchTables
from tetlux.cases.run import run_case
from tetlux.meshing import InputError
from tetlux.meshing.errors import RunError

THIRD = 1 / 3


def summary_of(run: str, sweep: dict[str, Any], channels: Sequence[str] = ("all",), **more: Any) -> dict[str, Any]:
    """The summary of a run, as `summarize` makes it."""
    readings = [
        {"name": "eye", "kind": "point", "channel": channel, "light": light, "position": [1.0, 2.0, THIRD],
         "exitance": 0.25 * (k + 1), "power": None, "relative_error": 1e-3, "model_error": None}
        for k, channel in enumerate(channels) for light in ("all", "lamp")
    ]  # fmt: skip
    power = {"incident": 1.0, "specular": 0.1, "absorbed": 0.2, "exited": THIRD, "ballistic": 0.0, "balance_error": 0.0}
    figures = {"sigma_tr": 0.1, "albedo": 0.9, "power": power, "error_estimate": 0.01}
    figures |= {"exitance": {"min": 1e-12, "max": 2.0, "mean": 0.1}, "fluence": {"min": 0.0, "max": 3.0}}
    return {
        "case": run,
        "unit": "cm",
        "model": "fem",
        "tolerance": 0.05,
        "as_ran": {"sweep": sweep},
        "mesh": {"nodes": 684, "tetrahedra": 3205},
        "channels": [{"name": name, **figures} for name in channels],
        "detectors": readings,
        "seconds": {"mesh": 0.5, "total": 1.25},
        "warnings": ["it is thin."],
        "warning_codes": ["thin"],
        **more,
    }


class Batch:
    """Sends events of runs whose summaries are made up."""

    def __init__(self, out: Path, names: Sequence[str]) -> None:
        self.out, self.names, self.tables = out, names, BatchTables()
        self.tables(BatchStarted(tuple(names), out, 1, ("a.yaml",) * len(names)))

    def finish(self, number: int, sweep: dict[str, Any], **more: Any) -> None:
        name = self.names[number]
        (self.out / name).mkdir(parents=True, exist_ok=True)
        summary = summary_of(name, sweep, **more)
        (self.out / name / "summary.json").write_text(json.dumps(summary))
        self.tables(RunFinished(number, name, self.out / name, summary, 1.0))

    def fail(self, number: int, sweep: dict[str, Any]) -> None:
        self.tables(RunFailed(number, self.names[number], "memory, alas, ran out.", 1.0, sweep=sweep))

    def end(self) -> None:
        self.tables(BatchEnded(1, 0, 0, 0, 1.0))


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_row_for_each_run_and_channel_with_all_digits(tmp_path: Path) -> None:
    batch = Batch(tmp_path, ["a/x=1", "a/x=2", "a/x=3"])
    batch.finish(2, {"medium.sigma_a": 0.1 + 0.2, "up": [0, 0, 1]}, channels=("red", "blue"))
    batch.fail(1, {"medium.sigma_a": 2.0})
    batch.finish(0, {"medium.sigma_a": 1})
    batch.end()
    table = rows(tmp_path / "results.csv")
    assert [(row["run"], row["channel"], row["status"]) for row in table] == [
        ("a/x=1", "all", "finished"), ("a/x=2", "", "failed"), ("a/x=3", "red", "finished"),
        ("a/x=3", "blue", "finished"),
    ]  # fmt: skip
    assert [row["medium.sigma_a"] for row in table] == ["1", "2.0", repr(0.1 + 0.2), repr(0.1 + 0.2)]
    assert [row["up"] for row in table] == ["", "", "[0, 0, 1]", "[0, 0, 1]"]
    assert table[0]["exited"] == repr(THIRD)
    assert table[0]["exitance_min"] == "1e-12"
    assert (table[2]["reading.eye"], table[3]["reading.eye"]) == ("0.25", "0.5")
    assert table[0]["reading.eye.relative_error"] == "0.001"
    assert (table[0]["seconds_total"], table[0]["warnings"], table[0]["unit"]) == ("1.25", "thin", "cm")
    assert table[1]["reason"] == "memory, alas, ran out."
    readings = rows(tmp_path / "readings.csv")
    assert len(readings) == 6
    expected = {"detector": "eye", "light": "lamp", "exitance": "0.25", "power": "", "z": repr(THIRD)}
    assert {name: readings[1][name] for name in expected} == expected
    assert readings[1]["medium.sigma_a"] == "1"


def test_a_killed_batch_has_the_rows_of_what_is_finished(tmp_path: Path) -> None:
    batch = Batch(tmp_path, ["a/x=1", "a/x=2", "a/x=3"])
    batch.finish(1, {"x": 2})
    batch.finish(0, {"x": 1, "surface.file": "b.stl"})
    assert [row["run"] for row in rows(tmp_path / "results.csv")] == ["a/x=2", "a/x=1"]
    # Killed within a line.
    with (tmp_path / "results.csv").open("a") as file:
        file.write("a/x=3,a,all,fin")
    assert list(load_results(tmp_path)["run"]) == ["a/x=2", "a/x=1"]
    batch.finish(2, {"x": 3})
    assert list(load_results(tmp_path)["x"]) == [2, 1, 3]


def test_a_batch_that_is_run_again_has_the_same_tables(tmp_path: Path) -> None:
    def run(order: Sequence[int], names: Sequence[str] = ("a/x=0", "a/x=1", "a/x=2")) -> list[bytes]:
        batch = Batch(tmp_path, names)
        for number in order:
            batch.finish(number, {"x": number})
        batch.end()
        return [(tmp_path / name).read_bytes() for name in ("results.csv", "readings.csv", "index.html")]

    first = run([0, 1, 2])
    assert run([2, 0, 1]) == first
    # Another case in the same folder is added; its own runs of an earlier sweep are replaced.
    run([0], ["b"])
    assert list(load_results(tmp_path)["run"]) == ["b", "a/x=0", "a/x=1", "a/x=2"]
    run([0, 1], ["a/x=0", "a/x=1"])
    assert list(load_results(tmp_path)["run"]) == ["a/x=0", "a/x=1", "b"]
    assert load_results(tmp_path)["x"].dtype.kind == "i"
    assert list(load_results(tmp_path, "readings")["run"].drop_duplicates()) == ["a/x=0", "a/x=1", "b"]


def test_parquet_holds_the_same_with_types(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    batch = Batch(tmp_path, ["a/1", "a/2"])
    batch.finish(0, {"x": 1, "y": "marble"}, channels=("1", "2"))
    batch.fail(1, {"x": 2.5, "y": [1, 2]})
    batch.end()
    table, again = load_results(tmp_path), pandas.read_parquet(tmp_path / "results.parquet")
    assert list(again.columns) == list(table.columns)
    assert list(table["channel"].dropna()) == ["1", "2"]
    assert list(table["x"]) == list(again["x"]) == [1.0, 1.0, 2.5]
    assert list(table["y"]) == list(again["y"]) == ["marble", "marble", "[1, 2]"]
    assert table["nodes"].tolist()[:2] == again["nodes"].tolist()[:2] == [684, 684]
    assert float(table["exited"][0]) == float(again["exited"][0]) == THIRD


def test_csv_needs_neither_pandas_nor_pyarrow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("pandas", "pyarrow"):
        monkeypatch.setitem(__import__("sys").modules, name, None)
    (tmp_path / "results.parquet").write_bytes(b"of an earlier batch")
    batch = Batch(tmp_path, ["a"])
    batch.finish(0, {})
    batch.end()
    assert len(rows(tmp_path / "results.csv")) == 1
    assert not (tmp_path / "results.parquet").exists()
    with pytest.raises(InputError, match=r'needs pandas; install it by pip install "tetlux\[tables\]"'):
        load_results(tmp_path)


def data_of(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page)
    assert found
    data: dict[str, Any] = json.loads(found[1])
    return data


def test_the_page_holds_everything_itself(tmp_path: Path) -> None:
    batch = Batch(tmp_path, ["a/x=1", "a/</script>", "a/x=3"])
    batch.finish(0, {"medium.sigma_a": 1, "up": [0, 0, 1]})
    batch.fail(1, {"medium.sigma_a": 2})
    Image.new("RGB", (800, 400), "red").save(tmp_path / "a" / "x=1" / "picture.png")
    batch.finish(2, {"medium.sigma_a": 3}, seconds={"total": float("inf")})
    (tmp_path / "a" / "x=3" / "picture.png").write_bytes(b"no picture")
    batch.end()
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    # No address of anything elsewhere but the name of SVG.
    assert set(re.findall(r"https?://[^\"' ]+", page)) == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"<link|<script[^>]+src|@import|url\(", page)
    data = data_of(page)
    assert data["swept"] == ["medium.sigma_a", "up"]
    assert [row[data["columns"].index("medium.sigma_a")] for row in data["rows"]] == [1, 2, 3]
    assert data["rows"][0][data["columns"].index("up")] == "[0, 0, 1]"
    assert (data["units"]["exited"], data["units"]["medium.sigma_a"], data["units"]["up"]) == ("W", "1/unit", "")
    assert list(data["pictures"]) == ["a/x=1"]
    name, small = data["pictures"]["a/x=1"]
    assert name == "picture.png"
    assert small.startswith("data:image/jpeg;base64,")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_became_read_only_fails_in_one_sentence(tmp_path: Path) -> None:
    batch = Batch(tmp_path, ["a"])
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(RunError, match="results cannot be written"):
            batch.end()
    finally:
        tmp_path.chmod(0o700)


def test_a_table_that_cannot_be_written_fails_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "results.csv").mkdir()
    batch = Batch(tmp_path, ["a"])
    batch.finish(0, {})
    with pytest.raises(RunError, match="results cannot be written to"):
        batch.end()
    assert [path.name for path in tmp_path.iterdir() if "partial" in path.name] == []


def test_a_page_of_something_else_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<!DOCTYPE html>\n<title>My garden</title>\n")
    with pytest.raises(InputError, match=r"index.html is no page of tetlux; move it, or choose another folder"):
        Batch(tmp_path, ["a"])
    assert "garden" in (tmp_path / "index.html").read_text()


def test_a_page_is_replaced_by_that_of_the_next_batch(tmp_path: Path) -> None:
    for run in ("a", "b"):
        batch = Batch(tmp_path, [run])
        batch.finish(0, {})
        batch.end()
        assert f'"{run}"' in (tmp_path / "index.html").read_text()


@pytest.mark.parametrize("name", ["results.csv", "readings.csv"])
def test_a_table_of_something_else_is_not_replaced(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("time,voltage\n1,2\n")
    with pytest.raises(InputError, match=rf"{name} is no table of tetlux; move it, or choose another folder"):
        Batch(tmp_path, ["a/x=1"])
    assert (tmp_path / name).read_text() == "time,voltage\n1,2\n"


@pytest.mark.parametrize("begun", ["", "ru", "run,case\n"])
def test_a_table_that_was_only_begun_is_replaced(begun: str, tmp_path: Path) -> None:
    (tmp_path / "results.csv").write_text(begun)
    Batch(tmp_path, ["a/x=1"]).end()


def test_results_of_runs_are_loaded_as_arrays(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    (tmp_path / "box.yaml").write_text(
        "surface: {box: {size: [10, 10, 10]}}\nmedium: {sigma_a: [0.01, 0.1], sigma_s_prime: 1, eta: 1.4}\n"
        "lights: [{pencil: {origin: [0, 0, 9], direction: [0, 0, -1]}}]\noutputs: [surface, volume]\ntolerance: 0.3\n"
        "detectors: [{name: top, point: [0, 0, 5]}]\n"
    )
    (case,) = load_cases(tmp_path / "box.yaml")
    folder = run_case(case, tmp_path / "out")
    result = load_result(folder)
    assert result.points is not None
    assert result.triangles is not None
    assert result.volume is not None
    assert result.exitance.shape == (len(result.points),)
    assert result.exitance == pytest.approx(result.values["exitance_1"] + result.values["exitance_2"])
    assert result.triangles.max() == len(result.points) - 1
    assert set(result.volume.values) == {"fluence_1", "fluence_2"}
    corners = result.volume.points[result.volume.tetrahedra]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    assert volumes.sum() == pytest.approx(result.summary["mesh"]["volume"])
    assert [(row["channel"], row["exitance"] > 0) for row in result.readings] == [("1", True), ("2", True)]
    # Without a table, the summaries are read.
    table = load_results(tmp_path / "out")
    assert list(table["channel"]) == ["1", "2"]
    powers = [channel["power"]["exited"] for channel in result.summary["channels"]]
    assert list(table["exited"]) == powers
    assert list(table["reading.top"]) == [row["exitance"] for row in result.readings]
    codes = result.summary["warning_codes"]
    assert "near-light" in codes
    assert set(table["warnings"]) == {" ".join(codes)}


def test_what_holds_no_results_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    with pytest.raises(InputError, match="holds no results; give the folder that tetlux run wrote into"):
        load_results(tmp_path)
    with pytest.raises(InputError, match=r"holds no summary\.json; give the folder of a finished run"):
        load_result(tmp_path)
    (tmp_path / "summary.json").write_text("{}")
    with pytest.raises(InputError, match="is not the summary of a run of this version"):
        load_result(tmp_path)
    (tmp_path / "summary.json").write_text(json.dumps(summary_of("a", {})))
    with pytest.raises(InputError, match=r"holds no surface; run its case with outputs: \[surface\]"):
        _ = load_result(tmp_path).exitance


def test_a_single_run_makes_no_table_and_joins_one(tmp_path: Path) -> None:
    case = "surface: {box: {size: [10, 10, 10]}}\nmedium: {sigma_a: 0.1, sigma_s_prime: 1, eta: 1.4}\n"
    case += "lights: [{diffuse: {irradiance: 1}}]\noutputs: []\ntolerance: 0.5\n"
    (tmp_path / "alone.yaml").write_text(case)
    (tmp_path / "two.yaml").write_text(case + "sweep: {medium.eta: [1.3, 1.4]}\n")
    out = tmp_path / "out"

    def run(name: str) -> list[str]:
        assert main(["run", str(tmp_path / name), "--out", str(out), "--jobs", "1", "--quiet"]) == 0
        return sorted(path.name for path in out.iterdir())

    assert run("alone.yaml") == ["alone"]
    assert {"alone", "two", "results.csv", "index.html"} <= set(run("two.yaml"))
    run("alone.yaml")
    assert [row["case"] for row in rows(out / "results.csv")] == ["alone", "two", "two"]
