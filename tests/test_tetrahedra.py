"""Tetrahedra: what the mesher returns, refinement, places, and files."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import block
from tetlux.meshing import (
    InputError,
    RunError,
    Surface,
    TetMesh,
    box,
    mesher,
    refine,
    sphere,
    surface_from_arrays,
    tetrahedralize,
    torus,
)
from tetlux.meshing.deviation import surface_deviation
from tetlux.meshing.files import read_mesh, write_mesh
from tetlux.meshing.repair import bodies


def test_the_mesher_fills_the_body(ball: Surface, ball_mesh: TetMesh) -> None:
    assert (ball_mesh.volumes > 0).all()
    # Over ten runs the volume was 0.9905 to 0.9925 of the surface's, the worst quality 0.13 to 0.38.
    assert ball_mesh.volume == pytest.approx(ball.volume, rel=0.015)
    assert ball_mesh.area == pytest.approx(ball.area, rel=0.01)
    assert ball_mesh.quality.min() > 0.03
    assert surface_deviation(ball_mesh, ball) < 4e-3 * ball.diagonal
    nearest, _ = ball.closest(ball_mesh.boundary_points)
    on_surface = np.linalg.norm(nearest - ball_mesh.boundary_points, axis=1) < 1e-9
    assert on_surface.mean() > 0.98


def test_boundary_triangles_face_outward(ball_mesh: TetMesh) -> None:
    normals = ball_mesh.surface.normals
    middles = ball_mesh.points[ball_mesh.boundary_faces].mean(axis=1)
    assert (np.einsum("ij,ij->i", normals, middles) > 0).all()
    assert ball_mesh.surface.volume == pytest.approx(ball_mesh.volume, rel=1e-12)
    assert ball_mesh.boundary_node_areas.sum() == pytest.approx(ball_mesh.area, rel=1e-12)


def test_edge_length_makes_finer_meshes() -> None:
    small = sphere(1.0, subdivisions=2)
    coarse = tetrahedralize(small, edge_length=0.6)
    fine = tetrahedralize(small, edge_length=0.15)
    assert len(fine.tetrahedra) > 3 * len(coarse.tetrahedra)


def test_refinement_brings_the_boundary_back_to_the_surface(ball: Surface, ball_mesh: TetMesh) -> None:
    fine = ball_mesh
    for _ in range(3):
        fine = refine(fine, fine.longest_edges > 0.8, ball)
    assert (fine.points[: len(ball_mesh.points)] == ball_mesh.points).all()
    assert abs(fine.volume / ball.volume - 1) < 0.4 * abs(ball_mesh.volume / ball.volume - 1)
    unmoved = refine(ball_mesh, ball_mesh.longest_edges > 0.8)
    assert unmoved.volume == pytest.approx(ball_mesh.volume, rel=1e-12)


def test_refinement_is_the_same_at_every_scale_and_leaves_the_random_state(ball_mesh: TetMesh) -> None:
    marked = ball_mesh.points[ball_mesh.tetrahedra].mean(axis=1)[:, 2] > 5
    np.random.seed(5)  # noqa: NPY002
    expected = np.random.random()  # noqa: NPY002
    np.random.seed(5)  # noqa: NPY002
    fine = refine(ball_mesh, marked)
    assert np.random.random() == expected  # noqa: NPY002
    for scale in (1e-9, 1e9):
        scaled = refine(TetMesh(ball_mesh.points * scale, ball_mesh.tetrahedra), marked)
        assert len(scaled.tetrahedra) == len(fine.tetrahedra)


def test_quality_is_one_for_a_regular_tetrahedron_and_small_for_a_sliver() -> None:
    regular = np.array([[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])
    assert TetMesh(regular, np.array([[0, 1, 2, 3]])).quality == pytest.approx([1.0])
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.01], [0, 1, 0]])
    assert TetMesh(flat, np.array([[0, 1, 3, 2]])).quality[0] < 0.05


def test_points_are_found_and_interpolated(ball_mesh: TetMesh) -> None:
    queries = np.random.default_rng(0).uniform(-5, 5, (200, 3))
    cells, weights = ball_mesh.locate(queries)
    corners = ball_mesh.points[ball_mesh.tetrahedra[cells]]
    assert np.einsum("ij,ijk->ik", weights, corners) == pytest.approx(queries, abs=1e-9)
    assert weights.min() > -1e-9
    outside, nothing = ball_mesh.locate(np.array([[0.0, 0, 11], [100, 0, 0]]))
    assert outside.tolist() == [-1, -1]
    assert np.isnan(nothing).all()


def test_points_are_found_between_very_unequal_tetrahedra() -> None:
    mesh = block((1, 1, 400), (10.0, 10.0, 4.0))
    queries = np.random.default_rng(1).uniform([-5, -5, -4], [5, 5, 0], (50, 3))
    assert (mesh.locate(queries)[0] >= 0).all()


@pytest.mark.parametrize("suffix", [".vtu", ".msh"])
def test_a_mesh_file_reads_back(suffix: str, ball_mesh: TetMesh, tmp_path: Path) -> None:
    path = tmp_path / f"ball{suffix}"
    write_mesh(ball_mesh, path, {"height": ball_mesh.points[:, 2]})
    again = read_mesh(path)
    assert again.points == pytest.approx(ball_mesh.points)
    assert (again.tetrahedra == ball_mesh.tetrahedra).all()


@pytest.mark.parametrize("content", [None, b"", b"<VTKFile"])
def test_mesh_files_that_are_none(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "mesh.vtu"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"mesh\.vtu"):
        read_mesh(path)
    with pytest.raises(InputError, match="no volume mesh format"):
        write_mesh(block((1, 1, 1), (1.0, 1.0, 1.0)), tmp_path / "mesh.docx")


def test_meshes_that_are_none() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    with pytest.raises(InputError, match="inverted or flat"):
        TetMesh(points, np.array([[0, 2, 1, 3]]))
    with pytest.raises(InputError, match="does not exist"):
        TetMesh(points, np.array([[0, 1, 2, 4]]))
    with pytest.raises(InputError, match="not finite"):
        TetMesh(points * [1, 1, np.nan], np.array([[0, 1, 2, 3]]))
    with pytest.raises(InputError, match="tetrahedra"):
        TetMesh(points, np.zeros((0, 4), dtype=int))


def test_a_crash_of_the_mesher_is_an_error_with_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    dying = (sys.executable, "-c", "import os; os.kill(os.getpid(), 11)")
    monkeypatch.setattr(mesher, "MESHER", dying)
    with pytest.raises(RunError, match=r"box: the mesher failed \(signal 11\); repair or simplify"):
        tetrahedralize(box((1.0, 1.0, 1.0)))


def test_the_mesher_is_stopped_at_its_time_limit(ball: Surface) -> None:
    with pytest.raises(RunError, match=r"stopped after 0\.05 s"):
        tetrahedralize(ball, time_limit=0.05)


def test_the_mesher_leaves_nothing_in_the_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    tetrahedralize(box((1.0, 1.0, 1.0)), edge_length=0.5)
    assert list(tmp_path.iterdir()) == []


def test_a_mesh_that_is_not_the_body_is_refused(monkeypatch: pytest.MonkeyPatch, ball: Surface) -> None:
    cube = block((2, 2, 2), (1.0, 1.0, 1.0))
    monkeypatch.setattr(mesher, "_run_pytetwild", lambda *_, **__: (cube.points, cube.tetrahedra))
    with pytest.raises(RunError, match=r"volume is .* off the surface's"):
        tetrahedralize(ball)


@pytest.mark.parametrize("name", ["edge_length", "epsilon", "time_limit"])
def test_the_mesher_refuses_what_it_would_ignore(name: str, ball: Surface) -> None:
    with pytest.raises(InputError, match=f"{name} is -1"):
        tetrahedralize(ball, **{name: -1.0})


def test_importing_meshing_is_light() -> None:
    """What reads no file and draws no picture must not wait for the libraries that do."""
    heavy = ("pyvista", "trimesh", "pytetwild", "meshio")
    code = f"import sys, tetlux.meshing; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_boundary_nodes_are_moved_onto_the_surface() -> None:
    # fTetWild's own boundary is up to 0.003 of the diagonal off a ring, at all of its nodes.
    ring = torus(4.0, 1.5, segments=48)
    mesh = tetrahedralize(ring)
    off = np.linalg.norm(ring.closest(mesh.boundary_points)[0] - mesh.boundary_points, axis=1)
    assert (off < 1e-9 * ring.diagonal).mean() > 0.95


def test_bodies_that_overlap_are_one_and_bodies_apart_are_two() -> None:
    a = sphere(6.0, subdivisions=2)
    for offset, count in ((5.0, 1), (14.0, 2)):
        points = np.vstack([a.points, a.points + np.array([offset, 0.0, 0.0])])
        pair = surface_from_arrays(points, np.vstack([a.faces, a.faces + len(a.points)]))
        mesh = tetrahedralize(pair)
        assert bodies(len(mesh.points), mesh.tetrahedra).max() + 1 == count
        lens = np.pi * (12 - offset) ** 2 * (offset**2 + 24 * offset) / (12 * offset) if count == 1 else 0.0
        assert mesh.volume == pytest.approx(2 * a.volume - lens, rel=0.03)


def test_crumbs_of_the_envelope_are_swept(monkeypatch: pytest.MonkeyPatch) -> None:
    cube = block((4, 4, 4), (1.0, 1.0, 1.0))
    crumb = np.array([[5.0, 0, 0], [5.01, 0, 0], [5, 0.01, 0], [5, 0, 0.01]])
    points = np.vstack([(cube.points + np.array([0.0, 0.0, 0.5])) / np.sqrt(3), crumb])
    cells = np.vstack([cube.tetrahedra, len(cube.points) + np.arange(4)])
    monkeypatch.setattr(mesher, "_run_pytetwild", lambda *_, **__: (points, cells))
    assert len(tetrahedralize(box((1.0, 1.0, 1.0))).tetrahedra) == len(cube.tetrahedra)
