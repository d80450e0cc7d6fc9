"""Tetrahedra made elsewhere: what is mended is said, and what would be solved wrongly is refused."""

from dataclasses import replace

import numpy as np
import pytest

from tests.meshes_made import cube_of_cubes
from tetlux.fem import Medium, PointSource, solve
from tetlux.meshing import InputError, TetMesh, mesh_from_arrays, refine
from tetlux.meshing.tets import conformity
from tetlux.meshing.tets.given import mesh_with_nodes

TISSUE = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4)
LIGHT = [PointSource((10.0, 10.0, 12.0))]
POINTS, TETRAHEDRA, PLACES = cube_of_cubes(4, 5.0)
WHOLE = TetMesh(POINTS, TETRAHEDRA)
UPPER = PLACES[:, 2] >= 2
# The upper half with nodes of its own.
DOUBLED = np.vstack([POINTS, POINTS]), np.where(UPPER[:, None], TETRAHEDRA + len(POINTS), TETRAHEDRA)
REFUSED = "parts touch without having their nodes in common: 800 mm² of the boundary face each other inside"


def as_given(points: np.ndarray, tetrahedra: np.ndarray) -> TetMesh:
    """As a mesh that nobody has looked at, without the nodes that are not used."""
    used, corners = np.unique(tetrahedra, return_inverse=True)
    return TetMesh(points[used], corners.reshape(tetrahedra.shape))


def test_doubled_nodes_are_joined() -> None:
    rng = np.random.default_rng(0)
    # As files round them.
    rounded = DOUBLED[0] + rng.uniform(-1e-6, 1e-6, DOUBLED[0].shape)
    for points in (DOUBLED[0], rounded):
        mesh = mesh_from_arrays(points, DOUBLED[1], labels=UPPER + 1)
        assert mesh.area == pytest.approx(2400.0)
        assert mesh.region_volumes == pytest.approx({1: 4000.0, 2: 4000.0})
        assert mesh.repairs == ("25 nodes that lie where another one does were joined with it.",)
    mesh, nodes = mesh_with_nodes(*DOUBLED)
    assert (DOUBLED[0][nodes] == mesh.points).all()
    solution = solve(mesh, TISSUE, LIGHT, tolerance=0.6)
    # What the same tetrahedra give that had these nodes in common from the beginning.
    expected = solve(WHOLE, TISSUE, LIGHT, tolerance=0.6)
    assert solution.power.exited == pytest.approx(0.4789, abs=5e-5)
    assert solution.power.exited == pytest.approx(expected.power.exited, rel=1e-9)
    assert solution.exitance_at(np.array([[10.0, 10.0, 0.0]])) == pytest.approx(2.59e-4, abs=1e-6)
    assert mesh.repairs[0] in solution.warnings


def test_each_tetrahedron_with_nodes_of_its_own() -> None:
    mesh = mesh_from_arrays(POINTS[TETRAHEDRA].reshape(-1, 3), np.arange(TETRAHEDRA.size).reshape(-1, 4))
    assert len(mesh.points) == len(POINTS)
    assert mesh.area == pytest.approx(2400.0)


def test_a_mesh_that_was_not_joined_is_refused() -> None:
    with pytest.raises(InputError, match=f"{REFUSED}.*, or give doubled nodes to mesh_from_arrays"):
        solve(as_given(*DOUBLED), TISSUE, LIGHT)


def test_hanging_nodes_are_refused() -> None:
    lower, upper = as_given(POINTS, TETRAHEDRA[~UPPER]), as_given(POINTS, TETRAHEDRA[UPPER])
    for _ in range(2):
        upper = refine(upper, np.ones(len(upper.tetrahedra), dtype=bool))
    points = np.vstack([lower.points, upper.points])
    tetrahedra = np.vstack([lower.tetrahedra, upper.tetrahedra + len(lower.points)])
    # What it joins it has joined.
    with pytest.raises(InputError, match=rf"{REFUSED}.*Coherence\)\.$"):
        mesh_from_arrays(points, tetrahedra)
    with pytest.raises(InputError, match=REFUSED):
        solve(TetMesh(points, tetrahedra), TISSUE, LIGHT)
    # Halves that are moved along each other have no node in common.
    moved = DOUBLED[0] + np.where(np.arange(len(DOUBLED[0])) >= len(POINTS), 1.7, 0.0)[:, None] * [1, 0.3, 0]
    with pytest.raises(InputError, match=r"parts touch without .*: \d+ mm² of the boundary face each other"):
        mesh_from_arrays(moved, DOUBLED[1])


def test_a_small_crack_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    inside = (PLACES == [2, 2, 2]).all(axis=1)
    own = np.where(inside[:, None], TETRAHEDRA + len(POINTS), TETRAHEDRA)
    slit = as_given(np.vstack([POINTS, POINTS]), own)
    # The cube's 150 mm² and those around it.
    with pytest.raises(InputError, match="300 mm² of the boundary face each other inside"):
        solve(slit, TISSUE, [PointSource((4.0, 4.0, 4.0))])
    monkeypatch.setattr(conformity, "MOST_COVERED", 0.2)
    slit = replace(slit)
    assert (
        "300 mm² of the mesh's boundary face each other inside it; no light passes there."
        in conformity.check_conformity(slit)
    )
    assert any(
        "300 mm² of the mesh's boundary" in each
        for each in solve(slit, TISSUE, [PointSource((4.0, 4.0, 4.0))], tolerance=0.9).warnings
    )


def test_of_copies_with_several_labels_the_rarer_counts() -> None:
    """Gmsh 2.2 writes a tetrahedron for each physical group that it is in: all, and a part of it."""
    part = TETRAHEDRA[UPPER]
    labels = np.r_[np.full(len(TETRAHEDRA), 1), np.full(len(part), 2)]
    names = {1: "all", 2: "part", 3: "of triangles"}
    mesh = mesh_from_arrays(POINTS, np.vstack([TETRAHEDRA, part[:, [1, 0, 2, 3]]]), labels=labels, names=names)
    assert mesh.region_volumes == pytest.approx({1: 4000.0, 2: 4000.0})
    assert mesh.labels == {1: "all", 2: "part"}
    assert "given more than once were counted once, with the rarer label." in mesh.repairs[-1]


@pytest.mark.parametrize("copies", [2, 3])
def test_tetrahedra_given_several_times_count_once(copies: int) -> None:
    many = np.vstack([TETRAHEDRA] * copies)
    mesh = mesh_from_arrays(POINTS, many)
    assert mesh.volume == pytest.approx(8000.0)
    assert mesh.repairs == (
        f"{384 * (copies - 1)} tetrahedra that are given more than once were counted once, as the first of each.",
    )
    # Two files in one: the nodes are there as often.
    points = np.vstack([POINTS] * copies)
    numbers = TETRAHEDRA + len(POINTS) * np.arange(copies)[:, None, None]
    assert mesh_from_arrays(points, numbers.reshape(-1, 4)).volume == pytest.approx(8000.0)
    with pytest.raises(InputError, match="tetrahedra overlap: 864 of their faces have several tetrahedra on one side"):
        solve(TetMesh(POINTS, many), TISSUE, LIGHT)
    # One alone has no boundary at all.
    alone = mesh_from_arrays(POINTS, np.vstack([TETRAHEDRA[:1]] * copies))
    assert alone.area > 0


def test_labels_of_copies_are_those_of_the_first() -> None:
    mesh = mesh_from_arrays(POINTS, np.vstack([TETRAHEDRA, TETRAHEDRA]), labels=np.repeat([4, 5], len(TETRAHEDRA)))
    assert mesh.region_volumes == pytest.approx({4: 8000.0})


def test_what_overlaps_is_refused() -> None:
    shifted = np.vstack([POINTS, POINTS + np.array([6.3, 5.7, 4.1])])
    with pytest.raises(InputError, match=r"tetrahedra overlap: .* mm² of the boundary lie inside other tetrahedra"):
        mesh_from_arrays(shifted, np.vstack([TETRAHEDRA, TETRAHEDRA + len(POINTS)]))
    # Two tetrahedra on one side of one face.
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.2, 0.2, 2.0]])
    with pytest.raises(InputError, match="tetrahedra overlap: 1 of their faces"):
        mesh_from_arrays(corners, [[0, 1, 2, 3], [0, 1, 2, 4]])
    # Bodies apart from each other do not.
    apart = np.vstack([POINTS, POINTS + np.array([25.0, 0, 0])])
    mesh = mesh_from_arrays(apart, np.vstack([TETRAHEDRA, TETRAHEDRA + len(POINTS)]))
    assert mesh.volume == pytest.approx(16000.0)
    assert mesh.warnings == ("the mesh is 2 parts without a common node; no light passes between them.",)
    assert mesh.warnings[0] in solve(mesh, TISSUE, LIGHT, tolerance=0.9).warnings


def test_flat_tetrahedra_are_left_out_where_that_leaves_no_gap() -> None:
    on_the_face = [0, 1, 5, 6]
    collapsed = [0, 1, 1, 31]
    mesh = mesh_from_arrays(POINTS, np.vstack([TETRAHEDRA, [on_the_face, collapsed]]))
    assert mesh.volume == pytest.approx(8000.0)
    assert mesh.repairs == ("2 tetrahedra without volume were left out.",)
    with pytest.raises(InputError, match="all of its tetrahedra are flat"):
        mesh_from_arrays(POINTS * [1, 1, 0], TETRAHEDRA)


def test_inverted_tetrahedra_are_turned_and_unused_nodes_left_out() -> None:
    turned = mesh_from_arrays(POINTS, TETRAHEDRA[:, [1, 0, 2, 3]])
    assert turned.repairs == ("all tetrahedra were inverted and have been turned.",)
    assert turned.volume == pytest.approx(8000.0)
    lower = mesh_from_arrays(POINTS, TETRAHEDRA[~UPPER])
    assert len(lower.points) == 75
    assert lower.repairs == ()


def test_numbers_from_one() -> None:
    mesh = mesh_from_arrays(POINTS, TETRAHEDRA + 1)
    assert (mesh.tetrahedra == TETRAHEDRA).all()
    assert mesh.repairs == ("nodes are numbered from 1.",)
    with pytest.raises(InputError, match="names a node that does not exist"):
        mesh_from_arrays(POINTS, TETRAHEDRA + 1, numbered_from=0)
    for wrong in (TETRAHEDRA + 2, TETRAHEDRA - 1):
        with pytest.raises(InputError, match="names a node that does not exist"):
            mesh_from_arrays(POINTS, wrong)


def test_arrays_that_are_wrong() -> None:
    for labels in (np.zeros(3), np.full(384, 0.5), np.full(384, np.nan), np.full(384, "a")):
        with pytest.raises(InputError, match="its labels are no whole numbers, one for each tetrahedron"):
            mesh_from_arrays(POINTS, TETRAHEDRA, labels=labels)
    with pytest.raises(InputError, match="give three coordinates for each"):
        mesh_from_arrays(POINTS[:, :2], TETRAHEDRA)
    with pytest.raises(InputError, match="give four node numbers for each"):
        mesh_from_arrays(POINTS, TETRAHEDRA[:, :3])
    with pytest.raises(InputError, match="no number, or absurdly large"):
        mesh_from_arrays(np.where(np.arange(125)[:, None] == 7, np.nan, POINTS), TETRAHEDRA)


def test_refined_meshes_keep_their_labels() -> None:
    mesh = mesh_from_arrays(POINTS, TETRAHEDRA, labels=UPPER - 5, names={-5: "below"})
    fine = refine(mesh, np.ones(len(TETRAHEDRA), dtype=bool))
    assert fine.region_volumes == pytest.approx({-5: 4000.0, -4: 4000.0})
    assert fine.label_text([-5, -4]) == "-5 (below) and -4"
    assert replace(mesh, labels={}).label_text([-5]) == "-5"
