"""Edges, faces and bisection of a mesh, against the slow and obvious ways to get them."""

from gc import collect
from weakref import ref

import numpy as np
import pytest

from tests.test_assembly import random_mesh
from tetlux.meshing import TetMesh, refine
from tetlux.meshing.host import blocks
from tetlux.meshing.host.blocks import find_single_keys, group_keys, map_in_threads, run_in_blocks
from tetlux.meshing.host.by_pair import ByPair
from tetlux.meshing.tets.topology import EDGES


@pytest.mark.parametrize("part", [7, 100, 1 << 20])
@pytest.mark.parametrize("most", [3, 1000, 2**40, 2**64 - 1])
def test_group_keys_is_unique_with_inverse(monkeypatch: pytest.MonkeyPatch, most: int, part: int) -> None:
    """Keys that leave no room for their places are sorted another way, and must come out the same."""
    monkeypatch.setattr(blocks, "KEYS_AT_ONCE", part)
    keys = np.random.default_rng(0).integers(0, most, 900, dtype=np.uint64, endpoint=True)
    keys[::3] = keys[0]
    unique, inverse = group_keys(keys)
    expected, places = np.unique(keys, return_inverse=True)
    assert (unique == expected).all()
    assert (inverse == places).all()


def test_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where many keys have the same hash."""
    monkeypatch.setattr(blocks, "_HASH_BITS", 2)
    keys = np.random.default_rng(1).integers(0, 500, 900, dtype=np.uint64)
    unique, count = np.unique(keys, return_counts=True)
    assert (find_single_keys(keys) == np.flatnonzero(np.isin(keys, unique[count == 1]))).all()
    assert len(find_single_keys(np.zeros(4, dtype=np.uint64))) == 0


def test_blocks_cover_everything_once_and_pass_errors_on() -> None:
    seen = np.zeros(1000, dtype=int)

    def work(block: slice) -> None:
        seen[block] += 1

    run_in_blocks(work, 1000, 64)
    assert (seen == 1).all()

    def fail(block: slice) -> None:
        if block.start == 128:
            raise ValueError("in a thread")

    with pytest.raises(ValueError, match="in a thread"):
        run_in_blocks(fail, 1000, 64)


def test_edges() -> None:
    mesh = random_mesh(0)
    pairs = np.sort(mesh.tetrahedra[:, EDGES], axis=2)
    assert (mesh.edges == np.unique(pairs.reshape(-1, 2), axis=0)).all()
    assert (mesh.edges[mesh.tetrahedron_edges] == pairs).all()
    lengths = np.linalg.norm(np.diff(mesh.points[pairs], axis=2)[:, :, 0], axis=2)
    assert mesh.edge_lengths[mesh.tetrahedron_edges] == pytest.approx(lengths, rel=1e-13)
    assert mesh.longest_edges == pytest.approx(lengths.max(axis=1), rel=1e-13)


def test_boundary() -> None:
    mesh = random_mesh(1)
    faces = np.sort(mesh.tetrahedra[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    unique, count = np.unique(faces, axis=0, return_counts=True)
    found = np.sort(mesh.boundary_faces, axis=1)
    assert (np.unique(found, axis=0) == unique[count == 1]).all()
    assert len(found) == (count == 1).sum()
    # Outward: the divergence theorem gives the volume. Behind each is its own tetrahedron, and around it its edges.
    a, b, c = (mesh.points[mesh.boundary_faces[:, i]] for i in range(3))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0 == pytest.approx(mesh.volume, rel=1e-12)
    behind = mesh.tetrahedra[mesh.boundary_cells]
    assert (mesh.boundary_faces[:, :, None] == behind[:, None, :]).any(axis=2).all()
    around = np.sort(mesh.edges[mesh.boundary_edges].reshape(len(found), 6), axis=1)
    assert (around == np.repeat(found, 2, axis=1)).all()


def test_boundary_of_a_mesh_with_very_many_nodes() -> None:
    """Above 2.6 million nodes three numbers do not fit in one: the same mesh, its nodes numbered far apart."""
    mesh = random_mesh(2, 100)
    spread = 30_000
    points = np.repeat(mesh.points, spread, axis=0)
    many = TetMesh(points, mesh.tetrahedra * spread)
    assert len(points) > 2_600_000
    assert (many.boundary_faces == mesh.boundary_faces * spread).all()
    assert (many.boundary_cells == mesh.boundary_cells).all()


def test_node_volumes_and_quality() -> None:
    mesh = random_mesh(4)
    expected = np.zeros(len(mesh.points))
    np.add.at(expected, mesh.tetrahedra, mesh.volumes[:, None] / 4.0)
    assert mesh.node_volumes == pytest.approx(expected, rel=1e-13)
    regular = TetMesh(np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]), np.array([[1, 0, 2, 3]]))
    assert regular.quality == pytest.approx([1.0], rel=1e-13)
    corner = TetMesh(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 1, 2, 3]]))
    # Inradius 1/(3 + sqrt 3), circumradius sqrt(3)/2.
    assert corner.quality == pytest.approx([3.0 / (3.0 + np.sqrt(3.0)) / (np.sqrt(3.0) / 2.0)], rel=1e-13)


def hanging_nodes(mesh: TetMesh) -> int:
    """Nodes in the middle of an edge that is still whole."""
    middles = mesh.points[mesh.edges].mean(axis=1)
    together = np.vstack([mesh.points, middles]).round(9)
    return len(together) - len(np.unique(together, axis=0))


@pytest.mark.parametrize("share", [0.02, 0.3, 1.0])
@pytest.mark.parametrize("seed", range(2))
def test_bisection_is_conforming(seed: int, share: float) -> None:
    mesh = random_mesh(seed)
    marked = np.random.default_rng(seed).uniform(size=len(mesh.tetrahedra)) < share
    fine = refine(mesh, marked)
    assert (fine.points[: len(mesh.points)] == mesh.points).all()
    assert hanging_nodes(fine) == 0
    # The same body with the same boundary; what was marked is gone, split at its longest edge at least.
    assert fine.volume == pytest.approx(mesh.volume, rel=1e-12)
    assert fine.area == pytest.approx(mesh.area, rel=1e-12)
    old = {tuple(cell) for cell in np.sort(mesh.tetrahedra[marked], axis=1).tolist()}
    assert not old & {tuple(cell) for cell in np.sort(fine.tetrahedra, axis=1).tolist()}
    longest = mesh.tetrahedron_edges[np.arange(len(marked)), mesh.edge_lengths[mesh.tetrahedron_edges].argmax(axis=1)]
    whole = {tuple(edge) for edge in fine.edges.tolist()}
    assert not whole & {tuple(edge) for edge in mesh.edges[longest[marked]].tolist()}
    # Nothing is split across: where an edge of a tetrahedron or of a face is gone, its longest one is.
    gone = np.array([tuple(edge) not in whole for edge in mesh.edges.tolist()])
    for corners in ([0, 1, 2, 3], [1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]):
        edges = mesh.tetrahedron_edges[:, [i for i, pair in enumerate(EDGES) if set(pair) <= set(corners)]]
        longest = edges[np.arange(len(edges)), mesh.edge_lengths[edges].argmax(axis=1)]
        assert (gone[longest] == gone[edges].any(axis=1)).all()


def test_nothing_marked_nothing_split() -> None:
    mesh = random_mesh(0)
    assert (refine(mesh, np.zeros(len(mesh.tetrahedra), dtype=bool)).tetrahedra == mesh.tetrahedra).all()


def test_bisection_does_not_flatten(ball_mesh: TetMesh) -> None:
    """Twenty steps towards a point: edges shrink by a hundred, and the worst shape keeps .43 to .53 of its quality."""
    mesh = ball_mesh
    for _ in range(20):
        far = np.linalg.norm(mesh.points[mesh.tetrahedra].mean(axis=1) - (0.0, 0.0, 9.0), axis=1)
        mesh = refine(mesh, mesh.longest_edges > np.maximum(0.8 * far, 0.02))
    assert mesh.edge_lengths.min() < 0.01 * ball_mesh.edge_lengths.max()
    assert mesh.quality.min() > 0.35 * ball_mesh.quality.min()
    assert np.quantile(mesh.quality, 0.01) > 0.2
    assert hanging_nodes(mesh) == 0


def test_work_within_work_is_done_too_and_lets_go_of_its_arrays() -> None:
    """Threads that are kept must neither wait for each other nor hold what they were given."""

    class Held: ...

    held = Held()
    gone = ref(held)

    def outer(number: int, held: Held = held) -> list[int]:
        assert held is not None
        return map_in_threads(lambda inner: 10 * number + inner, range(3))

    assert map_in_threads(outer, range(4)) == [[10 * number + inner for inner in range(3)] for number in range(4)]
    del outer, held
    collect()
    assert gone() is None


def test_what_is_kept_by_pair_goes_with_either() -> None:
    class Thing: ...

    for which in (0, 1):
        pair, kept = [Thing(), Thing()], ByPair[Thing, Thing, Thing]()
        value = ref(kept.get(pair[0], pair[1], Thing))
        assert kept.get(pair[0], pair[1], Thing) is value()
        del pair[which]
        collect()
        assert value() is None
