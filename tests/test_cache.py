"""Meshes remembered."""

import os
import sys
import threading
import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import block
from tetlux.meshing import Surface, TetMesh, box, tetrahedralize
from tetlux.meshing.mesher import api as mesher
from tetlux.meshing.mesher import cache
from tetlux.meshing.mesher.cache import cache_directory, load_cached_mesh, mesh_key, store_cached_mesh

MESH = block((2, 3, 4), (1.0, 2.0, 3.0))


def test_a_mesh_comes_back_as_it_was(tmp_path: Path) -> None:
    assert load_cached_mesh("a", tmp_path, "cm") is None
    store_cached_mesh("a", tmp_path / "deep" / "down", MESH)
    again = load_cached_mesh("a", tmp_path / "deep" / "down", "cm")
    assert again is not None
    assert (again.points == MESH.points).all()
    assert (again.tetrahedra == MESH.tetrahedra).all()
    assert again.unit == "cm"
    assert [path.name for path in (tmp_path / "deep" / "down").iterdir()] == ["a.npz"]


def test_the_key_holds_all_that_shapes_a_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    cube = box((1.0, 2.0, 3.0))
    moved, turned = cube.points.copy(), cube.faces.copy()
    moved[3, 1] += 1e-15
    turned[5] = np.roll(turned[5], 1)
    key = mesh_key(cube, edge_length=1.0, version="1")
    assert mesh_key(box((1.0, 2.0, 3.0)), version="1", edge_length=1.0) == key
    # Not what the same numbers are called.
    assert mesh_key(replace(cube, unit="cm", name="other", warnings=("a",)), edge_length=1.0, version="1") == key
    others = [
        mesh_key(replace(cube, points=moved), edge_length=1.0, version="1"),
        mesh_key(replace(cube, faces=turned), edge_length=1.0, version="1"),
        mesh_key(replace(cube, crease_angle=10.0), edge_length=1.0, version="1"),
        mesh_key(replace(cube, overlaps=True), edge_length=1.0, version="1"),
        mesh_key(cube, edge_length=1.0 + 1e-15, version="1"),
        mesh_key(cube, edge_length=1.0, version="2"),
    ]
    monkeypatch.setattr(cache, "FORMAT", cache.FORMAT + 1)
    others.append(mesh_key(cube, edge_length=1.0, version="1"))
    assert len({key, *others}) == 8


@pytest.mark.parametrize(
    "content",
    [
        {"points": MESH.points, "tetrahedra": MESH.tetrahedra, "regions": MESH.regions, "key": np.array("b")},
        {"points": MESH.points, "tetrahedra": MESH.tetrahedra},
        {"points": MESH.points, "key": np.array("a")},
        {
            "points": MESH.points.astype(object),
            "tetrahedra": MESH.tetrahedra,
            "regions": MESH.regions,
            "key": np.array("a"),
        },
        {
            "points": MESH.points.astype(np.complex128),
            "tetrahedra": MESH.tetrahedra,
            "regions": MESH.regions,
            "key": np.array("a"),
        },
        {"points": MESH.points, "tetrahedra": MESH.tetrahedra.astype(np.float64), "key": np.array("a")},
        {"points": MESH.points * np.nan, "tetrahedra": MESH.tetrahedra, "regions": MESH.regions, "key": np.array("a")},
        {
            "points": MESH.points.astype(np.float32),
            "tetrahedra": MESH.tetrahedra,
            "regions": MESH.regions,
            "key": np.array("a"),
        },
        {"points": MESH.points, "tetrahedra": MESH.tetrahedra.astype(np.int32), "key": np.array("a")},
        {"points": MESH.points, "tetrahedra": MESH.tetrahedra[:, [1, 0, 2, 3]], "key": np.array("a")},
    ],
)
def test_an_entry_that_is_another_thing_is_a_miss(content: dict[str, object], tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **content)  # type: ignore[arg-type]
    assert load_cached_mesh("a", tmp_path, "mm") is None


@pytest.mark.parametrize("damage", ["empty", "half", "bits", "prose", "folder", "array"])
def test_a_damaged_entry_is_a_miss_and_is_replaced(damage: str, tmp_path: Path) -> None:
    store_cached_mesh("a", tmp_path, MESH)
    path = tmp_path / "a.npz"
    data = bytearray(path.read_bytes())
    if damage == "empty":
        path.write_bytes(b"")
    elif damage == "half":
        path.write_bytes(data[: len(data) // 2])
    elif damage == "bits":
        data[len(data) // 3] ^= 255
        path.write_bytes(data)
    elif damage == "prose":
        path.write_bytes(b"It was a dark and stormy night.")
    elif damage == "array":
        with path.open("wb") as file:
            np.save(file, MESH.points)
    else:
        path.unlink()
        path.mkdir()
    assert load_cached_mesh("a", tmp_path, "mm") is None
    store_cached_mesh("a", tmp_path, MESH)
    assert (load_cached_mesh("a", tmp_path, "mm") is not None) == (damage != "folder")


def test_an_unwritable_directory_is_no_cache(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    store_cached_mesh("a", file / "below", MESH)
    store_cached_mesh("a", file, MESH)
    assert load_cached_mesh("a", file, "mm") is None
    assert file.read_text() == ""


def test_what_was_used_longest_ago_goes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = time.time()
    for age, key in enumerate("abcd"):
        store_cached_mesh(key, tmp_path, MESH)
        os.utime(tmp_path / f"{key}.npz", (now - 100 + age, now - 100 + age))
    size = (tmp_path / "a.npz").stat().st_size
    (tmp_path / "notes.txt").write_text("kept")
    assert load_cached_mesh("a", tmp_path, "mm") is not None
    monkeypatch.setattr(cache, "LARGEST_CACHE", 3 * size)
    store_cached_mesh("e", tmp_path, MESH)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npz", "d.npz", "e.npz", "notes.txt"]


def test_what_a_dead_process_left_goes_after_a_day(tmp_path: Path) -> None:
    for name, age in (("old.part", 2 * 86_400), ("new.part", 60)):
        (tmp_path / name).write_text("")
        os.utime(tmp_path / name, (time.time() - age,) * 2)
    store_cached_mesh("a", tmp_path, MESH)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npz", "new.part"]


def test_a_write_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(file: object, **_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    store_cached_mesh("a", tmp_path, MESH)
    assert list(tmp_path.iterdir()) == []


def test_many_may_read_and_write_at_once(tmp_path: Path) -> None:
    meshes = [block((2, 2, n), (1.0, 1.0, 1.0)) for n in (1, 2, 3, 4)]
    wrong: list[object] = []

    def work(mesh: TetMesh) -> None:
        for _ in range(30):
            store_cached_mesh("a", tmp_path, mesh)
            found = load_cached_mesh("a", tmp_path, "mm")
            if found is None or len(found.tetrahedra) not in {len(m.tetrahedra) for m in meshes}:
                wrong.append(found)

    threads = [threading.Thread(target=work, args=(mesh,)) for mesh in meshes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


def test_where_meshes_are_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("TETLUX_CACHE_DIR", str(tmp_path))
    assert cache_directory() == tmp_path
    monkeypatch.delenv("TETLUX_CACHE_DIR")
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_directory() == tmp_path / "xdg" / "tetlux"
    for none in ("", "relative"):
        monkeypatch.setenv("XDG_CACHE_HOME", none)
        assert cache_directory() == tmp_path / ".cache" / "tetlux"
    monkeypatch.setattr(sys, "platform", "darwin")
    assert cache_directory() == tmp_path / "Library" / "Caches" / "tetlux"


def test_the_mesher_runs_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cube = block((3, 3, 3), (1.0, 1.0, 1.0))
    runs: list[Surface] = []

    def make(surface: Surface, *_: float) -> TetMesh:
        runs.append(surface)
        return cube

    monkeypatch.setattr(mesher, "_mesh_body", make)
    surface = box((1.0, 1.0, 1.0))
    first = tetrahedralize(surface, cache=tmp_path)
    second = tetrahedralize(replace(surface, unit="cm"), cache=tmp_path)
    assert len(runs) == 1
    assert (first.points == second.points).all()
    assert second.unit == "cm"
    # How long it may take shapes nothing.
    tetrahedralize(surface, cache=tmp_path, time_limit=5.0)
    assert len(runs) == 1
    tetrahedralize(surface, cache=False)
    assert len(runs) == 2
    tetrahedralize(surface, cache=tmp_path, edge_length=0.2)
    tetrahedralize(surface, cache=tmp_path, deviation=0.2)
    tetrahedralize(surface, cache=tmp_path, deviation=0.2, epsilon=0.2)
    tetrahedralize(surface, cache=tmp_path, stop_energy=20.0)
    assert len(runs) == 6
    tetrahedralize(surface)
    tetrahedralize(surface)
    assert len(runs) == 7
    for changed in ("pytetwild", "fast-simplification"):
        monkeypatch.setattr(mesher, "version", lambda name, changed=changed: "99" if name == changed else version(name))
        tetrahedralize(surface, cache=tmp_path)
    assert len(runs) == 9
