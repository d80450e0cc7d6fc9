"""Traced paths have the segments that the box tree cuts, and the tree cuts the paths that tracing gives up."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from tests.conftest import TISSUE, block
from tests.test_loads import AWKWARD, CLOSE, FORWARD, beams, careful_load, pressed, scattered, segment_load, turned
from tetlux.fem import CollimatedBeam, Medium, PencilBeam, PointSource, Segments, System
from tetlux.fem.ballistic import extinction
from tetlux.fem.ballistic.follow import follow
from tetlux.fem.ballistic.rays import Rays
from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import Coefficients, coefficients_of
from tetlux.fem.sources.light import Light
from tetlux.meshing import Surface, TetMesh, refine
from tetlux.meshing.arrays import BoolArray, FloatArray, IntArray
from tetlux.meshing.search.cell_tree import CellTree, PathSegments
from tetlux.meshing.tets import march as marching
from tetlux.meshing.tets import path_cache
from tetlux.meshing.tets.march import march
from tetlux.meshing.tets.path_cache import TracedPaths


class NoTree:
    """Stands for the tree where nothing should be left to it."""

    def cut(self, starts: FloatArray, directions: FloatArray, lengths: FloatArray) -> Iterator[PathSegments]:
        raise AssertionError(f"{len(starts)} paths were left to the tree.")


class CountingTree:
    """Counts the paths that are left to the tree."""

    def __init__(self, tree: CellTree) -> None:
        self.tree = tree
        self.count = 0

    def cut(self, starts: FloatArray, directions: FloatArray, lengths: FloatArray) -> Iterator[PathSegments]:
        self.count += len(starts)
        return self.tree.cut(starts, directions, lengths)

    def locate(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        return self.tree.locate(points)


def with_tree(mesh: TetMesh, tree: object) -> TetMesh:
    """The same mesh with another tree in the place of its own."""
    other = TetMesh(mesh.points, mesh.tetrahedra)
    other.__dict__["tree"] = tree
    return other


def from_facets(mesh: TetMesh, count: int, seed: int, shortest: float = 1e-3) -> Segments:
    """Paths from random places on the boundary of a convex body to others, not too near by its diagonal."""
    random = np.random.default_rng(seed)
    facets = random.integers(len(mesh.boundary_faces), size=(2, count))
    corners = mesh.points[mesh.boundary_faces[facets]]
    starts, ends = np.einsum("sij,sijk->sik", random.dirichlet(np.ones(3), (2, count)), corners)
    apart = np.linalg.norm(ends - starts, axis=1) > shortest * mesh.diagonal
    segments = beams(starts[apart], ends[apart])
    return replace(segments, cells=mesh.boundary_cells[facets[0, apart]])


def located(mesh: TetMesh, segments: Segments) -> Segments:
    return replace(segments, cells=mesh.locate(segments.starts)[0])


def check_segments(mesh: TetMesh, segments: Segments, aside: float, rounding: float = 1e-9) -> None:
    """They cover every path once, without gaps, and have the coordinates that they should."""
    numbers = []
    for part in march(mesh, segments.starts, segments.directions, segments.lengths, segments.cells):
        order = np.lexsort((part.enter, part.paths))
        path, enter, leave = part.paths[order], part.enter[order], part.leave[order]
        first = np.diff(path, prepend=-1) > 0
        last = np.roll(first, -1)
        assert (leave > enter).all()
        assert (enter[first] == 0).all()
        assert (leave[last] == segments.lengths[path[last]]).all()
        assert (enter[1:][~first[1:]] == leave[:-1][~last[:-1]]).all()
        numbers.append(path[first])
        inside = part.cells >= 0
        assert part.weights[inside].sum(axis=1) == pytest.approx(1.0, abs=1e-14)
        for along in (part.enter, 0.5 * (part.enter + part.leave), part.leave):
            weights = part.weights + (along - part.enter)[:, None] * part.slopes
            assert weights[inside].min() >= -aside
            places = segments.starts[part.paths] + along[:, None] * segments.directions[part.paths]
            corners = mesh.points[mesh.tetrahedra[part.cells[inside]]]
            got = np.einsum("ij,ijk->ik", weights[inside], corners)
            assert got == pytest.approx(places[inside], abs=rounding * mesh.diagonal)
    assert sorted(np.concatenate(numbers).tolist()) == list(range(len(segments.starts)))


@pytest.mark.parametrize("counts", [(1, 1, 1), (3, 4, 5)])
def test_neighbours_share_a_face(counts: tuple[int, int, int]) -> None:
    check_neighbours(block(counts, (1.0, 2.0, 3.0)))


def check_neighbours(mesh: TetMesh) -> None:
    corners = [set(nodes) for nodes in mesh.tetrahedra.tolist()]
    for cell, others in enumerate(mesh.neighbours.tolist()):
        for corner, other in enumerate(others):
            if other >= 0:
                assert other != cell
                assert corners[cell] - {int(mesh.tetrahedra[cell, corner])} == corners[cell] & corners[other]
                assert mesh.neighbours[other].tolist().count(cell) == 1
    alone, face = np.nonzero(mesh.neighbours < 0)
    assert (4 * alone + face).tolist() == mesh._boundary[0].tolist()


def test_neighbours_in_a_ball_share_a_face(ball_mesh: TetMesh) -> None:
    assert ball_mesh.neighbours.shape == ball_mesh.tetrahedra.shape
    check_neighbours(ball_mesh)


def test_paths_through_a_ball_are_marched_as_the_tree_cuts_them(ball_mesh: TetMesh) -> None:
    # A ball's facets are not quite convex: one path in 1e5 leaves it for a while, all shorter than .09 of its diagonal.
    segments = from_facets(ball_mesh, 3000, 1, shortest=0.2)
    check_segments(ball_mesh, segments, 1e-8)
    expected = segment_load(ball_mesh, coefficients_of(FORWARD), replace(segments, cells=None))
    # None needs the tree.
    load = segment_load(with_tree(ball_mesh, NoTree()), coefficients_of(FORWARD), segments)
    assert load == pytest.approx(expected, abs=1e-12 * expected.max())
    assert load.sum() == pytest.approx(scattered(segments, FORWARD), rel=1e-12)


@pytest.mark.parametrize("power", [3.0, 5.0])
def test_paths_through_a_graded_mesh_are_marched_as_the_tree_cuts_them(power: float) -> None:
    mesh, _ = turned(pressed(block((8, 8, 8), (2.0, 2.0, 1.0)), power), 2)
    segments = from_facets(mesh, 1000, 3)
    check_segments(mesh, segments, 1e-7)
    expected = segment_load(mesh, coefficients_of(FORWARD), replace(segments, cells=None))
    assert expected.sum() == pytest.approx(scattered(segments, FORWARD), rel=1e-12)
    tree = CountingTree(mesh.tree)
    load = segment_load(with_tree(mesh, tree), coefficients_of(FORWARD), segments)
    # Where a thin tetrahedron is a billionth thick, which one has that makes a difference.
    assert load == pytest.approx(expected, abs=1e-9 * expected.max())
    assert load.sum() == pytest.approx(expected.sum(), rel=1e-12)
    # None.
    assert tree.count < 0.01 * len(segments.starts)


@pytest.mark.parametrize("seed", [None, 0, 1, 2])
@pytest.mark.parametrize("name", AWKWARD)
def test_awkward_paths_are_marched_as_one_by_one(name: str, seed: int | None) -> None:
    mesh, turn = (block((4, 4, 4), (4.0, 4.0, 4.0)), np.eye(3))
    if seed is not None:
        mesh, turn = turned(mesh, seed)
    segments = beams(*(turn @ np.array(end, dtype=float) for end in AWKWARD[name]))
    # From each of the tetrahedra that it touches where it begins.
    base = mesh.barycentric(np.repeat(segments.starts, len(mesh.tetrahedra), axis=0), np.arange(len(mesh.tetrahedra)))
    touched = np.flatnonzero(base.min(axis=1) > -1e-12)
    expected = careful_load(mesh, FORWARD, segments)
    for cell in touched:
        from_it = replace(segments, cells=np.array([cell]))
        check_segments(mesh, from_it, CLOSE)
        load = segment_load(mesh, coefficients_of(FORWARD), from_it)
        assert load.sum() == pytest.approx(scattered(segments, FORWARD), rel=1e-12)
        assert load == pytest.approx(expected, abs=CLOSE)


def test_awkward_paths_do_without_the_tree() -> None:
    """Along edges, faces and diagonals, and through nodes."""
    mesh = block((4, 4, 4), (4.0, 4.0, 4.0))
    segments = located(mesh, beams(*np.array(list(AWKWARD.values()), dtype=float).swapaxes(0, 1)))
    tree = CountingTree(mesh.tree)
    segment_load(with_tree(mesh, tree), coefficients_of(FORWARD), segments)
    assert tree.count == 0


def test_paths_within_faces_are_covered() -> None:
    mesh, _ = turned(pressed(block((5, 5, 5), (2.0, 2.0, 1.0)), 3.0), 10)
    random = np.random.default_rng(11)
    cells = random.integers(len(mesh.tetrahedra), size=500)
    faces = mesh.tetrahedra[cells, :3]
    starts, ends = (np.einsum("ij,ijk->ik", random.dirichlet(np.ones(3), 500), mesh.points[faces]) for _ in range(2))
    segments = replace(beams(starts, ends), cells=cells)
    check_segments(mesh, segments, CLOSE)
    expected = segment_load(mesh, coefficients_of(FORWARD), replace(segments, cells=None))
    assert segment_load(mesh, coefficients_of(FORWARD), segments) == pytest.approx(expected, abs=CLOSE)


def test_paths_through_the_thinnest_tetrahedra_are_covered() -> None:
    """Tetrahedra of quality 1e-5, and paths from node to node of them, which the tree itself does not cut right."""
    mesh, _ = turned(pressed(block((6, 6, 6), (2.0, 2.0, 2.0)), 7.0), 1)
    assert mesh.quality.min() < 1e-5
    starts, ends = np.random.default_rng(12).choice(mesh.points, size=(2, 1000))
    segments = Segments.merge([located(mesh, beams(starts, ends + 1e-12)), from_facets(mesh, 1000, 13)])
    tree = CountingTree(mesh.tree)
    mesh = with_tree(mesh, tree)
    load = segment_load(mesh, coefficients_of(FORWARD), segments)
    # 64.
    assert tree.count < 200
    assert load.sum() == pytest.approx(scattered(segments, FORWARD), rel=1e-12)
    # Linear functions are integrated exactly, but for what their gradients lose there.
    assert load @ mesh.points == pytest.approx(first_moments(segments, FORWARD), abs=1e-3)
    # 3e-7: the rounding of barycentric coordinates in these tetrahedra, whoever cuts.
    check_segments(mesh, segments, 1e-7, 1e-6)


def first_moments(segments: Segments, medium: Medium) -> FloatArray:
    """``∫ Q0 x + (1/sigma_t') ∫ Q1`` of segments, (3,)."""
    scattering, cosine = medium.delta_eddington
    extinction = medium.sigma_a + scattering
    depth = extinction * segments.lengths
    power = segments.fluxes * scattering / extinction * -np.expm1(-depth)
    along = segments.fluxes * scattering * (1.0 - (1.0 + depth) * np.exp(-depth)) / extinction**2
    along += cosine * power / medium.sigma_t_prime
    return np.asarray(power @ segments.starts + along @ segments.directions)


def test_paths_that_begin_elsewhere_are_left_to_the_tree(ball_mesh: TetMesh) -> None:
    segments = from_facets(ball_mesh, 300, 4)
    assert segments.cells is not None
    expected = segment_load(ball_mesh, coefficients_of(FORWARD), replace(segments, cells=None))
    wrong = segments.cells.copy()
    wrong[::3] = np.roll(wrong, 1)[::3]
    wrong[1::3] = -1
    moved = int((wrong != segments.cells).sum())
    assert moved > 190
    tree = CountingTree(ball_mesh.tree)
    load = segment_load(with_tree(ball_mesh, tree), coefficients_of(FORWARD), replace(segments, cells=wrong))
    # From some wrong ones the steps lead to the right one.
    assert 0.98 * moved <= tree.count <= moved
    assert load == pytest.approx(expected, abs=1e-12 * expected.max())


def test_paths_that_end_outside_are_left_to_the_tree() -> None:
    """Past the far side, and across a hole."""
    whole = block((4, 4, 4), (4.0, 4.0, 4.0))
    middle = whole.points[whole.tetrahedra].mean(axis=1)
    gap = (np.abs(middle - np.array([0.0, 0.0, -2.0])) < 1.0).all(axis=1)
    mesh = TetMesh(whole.points, whole.tetrahedra[~gap])
    x, y = np.array([0.3, -0.6, 1.2]), np.array([0.5, 0.2, -1.6])
    segments = located(mesh, beams(np.column_stack([x, y, np.zeros(3)]), np.column_stack([x, y, [-4.0, -4.002, -4.0]])))
    tree = CountingTree(mesh.tree)
    load = segment_load(with_tree(mesh, tree), coefficients_of(FORWARD), segments)
    assert tree.count == 2
    assert load == pytest.approx(careful_load(mesh, FORWARD, segments), abs=CLOSE)


@pytest.mark.parametrize("name", ["MOST_STALLS", "START_SLACK"])
def test_paths_that_are_lost_are_left_to_the_tree(
    name: str, ball_mesh: TetMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    segments = from_facets(ball_mesh, 100, 5)
    expected = segment_load(ball_mesh, coefficients_of(FORWARD), segments)
    # No step is short enough, and no segment begins inside enough.
    monkeypatch.setattr(marching, name, -1)
    tree = CountingTree(ball_mesh.tree)
    load = segment_load(with_tree(ball_mesh, tree), coefficients_of(FORWARD), segments)
    assert tree.count == len(segments.starts)
    assert load == pytest.approx(expected, abs=1e-12 * expected.max())


@pytest.mark.parametrize("portion", [1, 7, 100])
def test_portions_make_no_difference(portion: int, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = block((5, 5, 5), (5.0, 5.0, 5.0))
    segments = from_facets(mesh, 60, 6)
    load = segment_load(mesh, coefficients_of(FORWARD), segments)
    monkeypatch.setattr(marching, "PATHS_AT_ONCE", portion)
    mesh = same_mesh(mesh)
    parts = list(march(mesh, segments.starts, segments.directions, segments.lengths, segments.cells))
    assert len(parts) >= -(-len(segments.starts) // portion)
    assert segment_load(mesh, coefficients_of(FORWARD), segments) == pytest.approx(load, abs=1e-14)


def test_a_flat_tetrahedron_is_left_to_the_tree() -> None:
    """No mesh has one; were there one, it would be no harm."""
    mesh = block((2, 2, 2), (2.0, 2.0, 2.0))
    flat = np.zeros((3, len(mesh.points)))
    lines = np.array([[0.1, 0.1, -0.1, 0.0, 0.0, -1.0, 1.0]]).T
    mesh.__dict__["points"] = flat.T
    part = marching._trace(mesh, lines, np.array([0]), np.zeros(1))
    assert part.lost.all()
    assert len(part.segments.paths) == 0


def same_mesh(mesh: TetMesh) -> TetMesh:
    """The same, through which nothing was marched."""
    return TetMesh(mesh.points, mesh.tetrahedra)


@pytest.fixture
def marches(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many paths were marched at each time."""
    counts: list[int] = []
    march_anew = marching._trace

    def counting(mesh: TetMesh, lines: FloatArray, cells: IntArray, reached: FloatArray) -> TracedPaths:
        counts.append(len(cells))
        return march_anew(mesh, lines, cells, reached)

    monkeypatch.setattr(marching, "_trace", counting)
    return counts


@pytest.mark.parametrize("uniform", [True, False])
def test_paths_are_marched_once_and_then_further(uniform: bool, ball_mesh: TetMesh, marches: list[int]) -> None:
    """As far, less far, further, and some of both: each as on a mesh through which nothing was marched."""
    mesh, whole = same_mesh(ball_mesh), from_facets(ball_mesh, 200, 8)
    shares = np.random.default_rng(9).random(len(whole.starts))
    coefficients = coefficients_of(FORWARD) if uniform else several(mesh, FORWARD)
    further = int((shares > 0.5).sum())
    for share, anew in ((0.5, 200), (0.5, 0), (0.3, 0), (shares, further), (1.0, 200), (1.0, 0), (0.4, 0)):
        segments = replace(whole, lengths=share * whole.lengths)
        marches.clear()
        load = segment_load(mesh, coefficients, segments)
        assert sum(marches) == anew
        expected = segment_load(same_mesh(mesh), coefficients, segments)
        assert load == pytest.approx(expected, abs=1e-13 * expected.max())
        check_segments(mesh, segments, 1e-7)


def test_only_the_same_paths_are_known(ball_mesh: TetMesh, marches: list[int]) -> None:
    """In any order; others that begin alike are marched, with another direction or tetrahedron, or on another mesh."""
    segments, other = from_facets(ball_mesh, 100, 8), from_facets(ball_mesh, 100, 10)
    assert segments.cells is not None
    assert other.cells is not None
    later = np.arange(100) >= 40
    cases = (
        (segments, 0),
        (replace(segments, directions=np.where(later[:, None], -segments.directions, segments.directions)), 60),
        (replace(segments, cells=np.where(later, other.cells, segments.cells)), 60),
        (chosen(segments, ~later), 0),
        (chosen(segments, np.arange(100) != 70), 0),
        (chosen(segments, later), 0),
        (reordered(segments, np.random.default_rng(11).permutation(100)), 0),
        (reordered(segments, np.repeat(np.arange(100), 2)), 100),
        (Segments.merge([segments, other]), 100),
        (other, 100),
    )
    for asked, anew in cases:
        mesh = same_mesh(ball_mesh)
        segment_load(mesh, coefficients_of(FORWARD), segments)
        marches.clear()
        load = segment_load(mesh, coefficients_of(FORWARD), asked)
        assert sum(marches) == anew
        expected = segment_load(same_mesh(ball_mesh), coefficients_of(FORWARD), asked)
        assert load == pytest.approx(expected, abs=1e-13 * expected.max())
    finer = refine(ball_mesh, np.ones(len(ball_mesh.tetrahedra), dtype=bool))
    asked = located(finer, segments)
    marches.clear()
    segment_load(finer, coefficients_of(FORWARD), asked)
    assert asked.cells is not None
    assert sum(marches) == np.count_nonzero(asked.cells >= 0)


def test_no_more_is_kept_than_fits(ball_mesh: TetMesh, marches: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    several_segments = [from_facets(ball_mesh, 50, seed) for seed in (1, 2, 3)]
    mesh = same_mesh(ball_mesh)
    segment_load(mesh, coefficients_of(FORWARD), several_segments[0])
    held = sum(len(part.segments.paths) for part in mesh.cache.paths.parts)
    # Room for two and a half.
    monkeypatch.setattr(path_cache, "MOST_CACHED_SEGMENTS", int(2.5 * held))
    for segments in several_segments:
        segment_load(mesh, coefficients_of(FORWARD), segments)
    assert len(mesh.cache.paths.parts) == 2
    marches.clear()
    for segments in several_segments:
        segment_load(mesh, coefficients_of(FORWARD), segments)
    assert marches == [len(several_segments[2].starts)]


def test_only_so_many_parts_are_kept(ball_mesh: TetMesh, marches: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is looked through for every path; and what is marched to find a point is none."""
    monkeypatch.setattr(path_cache, "MOST_CACHED_PARTS", 3)
    mesh = same_mesh(ball_mesh)
    several_segments = [from_facets(mesh, 20, seed) for seed in range(5)]
    for segments in several_segments:
        segment_load(mesh, coefficients_of(FORWARD), segments)
    assert len(mesh.cache.paths.parts) == 3
    marches.clear()
    for segments in several_segments[::-1]:
        segment_load(mesh, coefficients_of(FORWARD), segments)
    assert marches == [len(several_segments[1].starts), len(several_segments[0].starts)]
    mesh = same_mesh(ball_mesh)
    system = System(mesh, TISSUE)
    for depth in (1.0, 2.0, 3.0):
        system.solve([PointSource((0.0, 0.0, 10.0 - depth))])
    assert len(mesh.cache.paths.parts) == 0


def chosen(segments: Segments, some: BoolArray) -> Segments:
    return reordered(segments, np.flatnonzero(some))


def reordered(segments: Segments, places: IntArray) -> Segments:
    assert segments.cells is not None
    return Segments(
        starts=segments.starts[places],
        directions=segments.directions[places],
        lengths=segments.lengths[places],
        fluxes=segments.fluxes[places],
        cells=segments.cells[places],
    )


def several(mesh: TetMesh, medium: Medium) -> Coefficients:
    """Coefficients that differ from tetrahedron to tetrahedron."""
    scattering, cosine = medium.delta_eddington
    shares = 0.5 + np.random.default_rng(7).random(len(mesh.tetrahedra))
    values = medium.sigma_a * shares, medium.sigma_t_prime * shares, scattering * shares, cosine * shares**0
    return Coefficients(*values, medium.mean_cosine, medium)


CLEAR = Medium(sigma_a=0.01, sigma_s=0.2, g=0.5, eta=1.4)
LIGHTS: dict[str, Light] = {
    "collimated": CollimatedBeam((0.3, 0.1, -1.0)),
    "pencil": PencilBeam((0.3, -0.4, 20.0), (0.1, 0.3, -1.0), deposit="line"),
}


@pytest.mark.parametrize("name", LIGHTS)
@pytest.mark.parametrize("uniform", [True, False])
def test_beams_know_where_they_begin(
    name: str, uniform: bool, ball: Surface, ball_mesh: TetMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also those that are reflected inside: the boundary's index is 1.4."""
    coefficients = coefficients_of(CLEAR) if uniform else several(ball_mesh, CLEAR)
    light = LIGHTS[name].deposit_in(Body(ball, (CLEAR,) if uniform else (CLEAR, CLEAR)))
    deposit = light.evaluate_on(ball_mesh, ball, coefficients)
    segments = deposit.terms.segments
    assert segments.cells is not None
    known = np.flatnonzero(segments.cells >= 0)
    # The first part of a pencil beam in one medium is known without a mesh.
    assert len(known) >= len(segments.starts) - (name == "pencil")
    assert len(known) > 2
    weights = ball_mesh.barycentric(segments.starts[known], segments.cells[known])
    assert (weights.min(axis=1) > -1e-9).mean() > 0.99
    expected = segment_load(ball_mesh, coefficients, replace(segments, cells=None))
    load = segment_load(ball_mesh, coefficients, segments)
    assert load == pytest.approx(expected, abs=1e-12 * expected.max())

    def with_tree_alone(
        mesh: TetMesh, starts: FloatArray, directions: FloatArray, lengths: FloatArray, cells: IntArray
    ) -> Iterator[PathSegments]:
        assert len(cells) == len(starts)
        return mesh.tree.cut(starts, directions, lengths)

    monkeypatch.setattr(extinction, "march", with_tree_alone)
    other = light.evaluate_on(ball_mesh, ball, coefficients)
    assert deposit.ledger.absorbed == pytest.approx(other.ledger.absorbed, rel=1e-12)
    assert deposit.ledger.ballistic == pytest.approx(other.ledger.ballistic, rel=1e-12)


def test_beams_that_enter_again_know_where() -> None:
    """Through a hollow in the middle of a block."""
    whole = block((5, 5, 5), (5.0, 5.0, 5.0))
    middle = whole.points[whole.tetrahedra].mean(axis=1)
    hollow = (np.abs(middle - np.array([0.0, 0.0, -2.5])) < 0.5).all(axis=1)
    mesh = TetMesh(whole.points, whole.tetrahedra[~hollow])
    matched = Medium(sigma_a=0.01, sigma_s=0.2, g=0.5, eta=1.0)
    rays = Rays(np.array([[0.1, 0.2, 0.0]]), np.array([[0.0, 0.0, -1.0]]), np.ones(1))
    assert rays.cells.tolist() == [-1]
    deposit = follow(mesh, coefficients_of(matched), rays)
    segments = deposit.terms.segments
    assert segments.starts[:, 2] == pytest.approx([0.0, -3.0])
    assert segments.lengths == pytest.approx([2.0, 2.0])
    assert segments.cells is not None
    assert mesh.barycentric(segments.starts, segments.cells).min() > -1e-12
    load = segment_load(with_tree(mesh, NoTree()), coefficients_of(matched), segments)
    assert load.sum() == pytest.approx(1.0 - deposit.ledger.ballistic - deposit.ledger.absorbed, rel=1e-12)


def test_merged_segments_keep_known_cells() -> None:
    line = beams([0, 0, 0], [0, 0, -1])
    both = Segments.merge([line, replace(line, cells=np.array([7])), Segments()])
    assert both.cells is not None
    assert both.cells.tolist() == [-1, 7]
    assert Segments.merge([line, Segments()]).cells is None
