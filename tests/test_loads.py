"""That paths are cut right: thousands of them at once against one at a time, tetrahedron by tetrahedron."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.conftest import block
from tetlux.fem import Medium, PencilBeam, Segments, SourceTerms
from tetlux.fem.body.body import Body
from tetlux.fem.media.coefficients import Coefficients, coefficients_of
from tetlux.fem.operators.loads import load_vector
from tetlux.meshing import Surface, TetMesh
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.search import box_tree

FORWARD = Medium(sigma_a=0.05, sigma_s=3.0, g=0.8, eta=1.4)
# Paths may run this far outside a tetrahedron; slopes on its two sides differ by some times more.
CLOSE = 1e-7


def beams(starts: object, ends: object) -> Segments:
    """Segments from starts to ends, 1 W in each."""
    origin, target = np.atleast_2d(np.asarray(starts, dtype=float)), np.atleast_2d(np.asarray(ends, dtype=float))
    lengths = np.linalg.norm(target - origin, axis=1)
    directions = (target - origin) / lengths[:, None]
    return Segments(origin, directions, lengths, np.ones(len(origin)))


def segment_load(mesh: TetMesh, coefficients: Coefficients, segments: Segments) -> FloatArray:
    return load_vector(mesh, coefficients, SourceTerms(segments=segments))


def scattered(segments: Segments, medium: Medium) -> float:
    scattering, _ = medium.delta_eddington
    extinction = medium.sigma_a + scattering
    return float((segments.fluxes * scattering / extinction * -np.expm1(-extinction * segments.lengths)).sum())


def careful_load(mesh: TetMesh, medium: Medium, segments: Segments) -> FloatArray:
    """The same loads: every tetrahedron cuts every path, the deepest has a stretch, quadrature integrates over it."""
    scattering, cosine = medium.delta_eddington
    every = np.arange(len(mesh.tetrahedra))
    nodes, weights = np.polynomial.legendre.leggauss(16)
    load = np.zeros(len(mesh.points))
    for start, direction, length, flux in zip(
        segments.starts, segments.directions, segments.lengths, segments.fluxes, strict=True
    ):
        base = mesh.barycentric(np.tile(start, (len(every), 1)), every)
        slope = (mesh.barycentric(np.tile(start + length * direction, (len(every), 1)), every) - base) / length
        with np.errstate(divide="ignore", invalid="ignore"):
            roots = np.where(np.abs(slope) > 1e-12, -base / slope, -1.0)
        # Where the path is in a face, and not only in its plane.
        touched = (base[:, None] + roots[:, :, None] * slope[:, None] > -1e-8).all(axis=2)
        cuts = np.unique(np.concatenate([[0.0, length], roots[touched & (roots > 0) & (roots < length)]]))
        for enter, leave in pairwise(cuts[np.diff(cuts, prepend=-1.0) > 1e-12 * length]):
            middle = 0.5 * (enter + leave)
            depth = (base + middle * slope).min(axis=1)
            cell = int(depth.argmax())
            along = middle + 0.5 * (leave - enter) * nodes
            power = flux * scattering * 0.5 * (leave - enter) * weights
            power *= np.exp(-(medium.sigma_a + scattering) * along)
            if depth[cell] >= -1e-9:
                shares = base[cell] + along[:, None] * slope[cell] + cosine / medium.sigma_t_prime * slope[cell]
                load[mesh.tetrahedra[cell]] += power @ shares
            else:
                _, faces, corner = mesh.closest_boundary((start + middle * direction)[None])
                load[mesh.boundary_faces[faces[0]]] += power.sum() * corner[0]
    return load


def pressed(mesh: TetMesh, power: float) -> TetMesh:
    """The same with its nodes drawn to the planes x, y, z = 0: small and thin tetrahedra there."""
    return TetMesh(np.sign(mesh.points) * np.abs(mesh.points) ** power, mesh.tetrahedra)


def turned(mesh: TetMesh, seed: int) -> tuple[TetMesh, FloatArray]:
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    return TetMesh(mesh.points @ turn.T, mesh.tetrahedra), turn


# In a block of 4 x 4 x 4 cubes of side 1, its upper face at z = 0.
AWKWARD = {
    "down an edge": ((1, 1, 0), (1, 1, -4)),
    "along a face": ((0.3, 1, 0), (0.3, 1, -4)),
    "along a face, slanting": ((-1.7, 1, -0.2), (1.6, 1, -3.9)),
    "along diagonals of cubes": ((-2, -2, 0), (2, 2, -4)),
    "along other diagonals": ((-2, 2, 0), (2, -2, -4)),
    "through vertices": ((-1, -2, 0), (1, 2, -4)),
    "along the boundary": ((-1.3, -1.1, 0), (1.2, 1.9, 0)),
    "along an edge of the body": ((-2, -2, 0), (-2, -2, -4)),
    "from within to within": ((0.1, 0.2, -1.3), (0.4, 0.3, -1.4)),
    "slanting": ((-1.9, -1.7, 0), (1.8, 1.3, -4)),
}


@pytest.mark.parametrize("seed", [None, 0, 1, 2])
@pytest.mark.parametrize("name", AWKWARD)
def test_awkward_paths_are_cut_as_one_by_one(name: str, seed: int | None) -> None:
    mesh, turn = (block((4, 4, 4), (4.0, 4.0, 4.0)), np.eye(3))
    if seed is not None:
        mesh, turn = turned(mesh, seed)
    segments = beams(*(turn @ np.array(end, dtype=float) for end in AWKWARD[name]))
    load = segment_load(mesh, coefficients_of(FORWARD), segments)
    assert load.sum() == pytest.approx(scattered(segments, FORWARD), rel=1e-12)
    assert load == pytest.approx(careful_load(mesh, FORWARD, segments), abs=CLOSE)


def test_many_paths_at_once_are_cut_as_one_by_one() -> None:
    mesh, turn = turned(block((4, 4, 4), (4.0, 4.0, 4.0)), 3)
    ends = np.array(list(AWKWARD.values()), dtype=float)
    random = np.random.default_rng(4).uniform(-2, 2, size=(40, 2, 3)) - [0, 0, 2]
    segments = beams(*(np.vstack([ends, random])[:, i] @ turn.T for i in (0, 1)))
    load = segment_load(mesh, coefficients_of(FORWARD), segments)
    assert load.sum() == pytest.approx(scattered(segments, FORWARD), rel=1e-12)
    assert load == pytest.approx(careful_load(mesh, FORWARD, segments), abs=CLOSE)
    # Two half as strong in the place of each.
    ends = segments.starts + segments.lengths[:, None] * segments.directions
    twice = beams(np.repeat(segments.starts, 2, axis=0), np.repeat(ends, 2, axis=0))
    twice = replace(twice, fluxes=0.5 * twice.fluxes)
    assert segment_load(mesh, coefficients_of(FORWARD), twice) == pytest.approx(load, abs=1e-12)


def test_paths_on_a_graded_mesh_are_cut_as_one_by_one() -> None:
    """Some tetrahedra are hundreds of times as long as others, or as their own thickness."""
    mesh = pressed(block((6, 6, 6), (2.0, 2.0, 1.0)), 6.0)
    assert mesh.longest_edges.max() > 500 * mesh.longest_edges.min()
    random = np.random.default_rng(5)
    starts = np.column_stack([random.uniform(-1, 1, size=(30, 2)) ** 3, np.zeros(30)])
    ends = np.column_stack([random.uniform(-1, 1, size=(30, 2)), np.full(30, -1.0)])
    ends[:10, :2] = starts[:10, :2]
    starts[25:], ends[25:] = mesh.points[random.choice(len(mesh.points), 5)], mesh.points[:5]
    segments = beams(starts, ends)
    load = segment_load(mesh, coefficients_of(FORWARD), segments)
    assert load.sum() == pytest.approx(scattered(segments, FORWARD), rel=1e-12)
    assert load == pytest.approx(careful_load(mesh, FORWARD, segments), abs=CLOSE)
    for part in mesh.tree.cut(segments.starts, segments.directions, segments.lengths):
        assert part.weights[part.cells >= 0].sum(axis=1) == pytest.approx(1.0, abs=1e-14)


def test_nothing_falls_between_tetrahedra() -> None:
    """Paths within faces, which rounding puts into one tetrahedron, the other, both or none."""
    mesh, _ = turned(pressed(block((5, 5, 5), (2.0, 2.0, 1.0)), 3.0), 10)
    random = np.random.default_rng(11)
    faces = mesh.tetrahedra[random.integers(len(mesh.tetrahedra), size=500), :3]
    starts, ends = (np.einsum("ij,ijk->ik", random.dirichlet(np.ones(3), 500), mesh.points[faces]) for _ in range(2))
    segments = beams(starts, ends)
    parts = list(mesh.tree.cut(segments.starts, segments.directions, segments.lengths))
    assert all((part.cells >= 0).all() for part in parts)


def test_what_falls_between_the_thinnest_tetrahedra_is_found_there() -> None:
    """Tetrahedra of quality 1e-5 are known to a few digits only; the middles of gaps are in them all the same."""
    mesh, _ = turned(pressed(block((6, 6, 6), (2.0, 2.0, 2.0)), 7.0), 1)
    starts, ends = np.random.default_rng(12).choice(mesh.points, size=(2, 1000))
    segments = beams(starts, ends + 1e-12)
    tree = mesh.tree
    middles = [np.zeros((0, 3))]
    for part in tree.cut(segments.starts, segments.directions, segments.lengths):
        outside = part.cells < 0
        along = 0.5 * (part.enter + part.leave)[outside]
        middles.append(segments.starts[part.paths[outside]] + along[:, None] * segments.directions[part.paths[outside]])
    lost = np.vstack(middles)
    inside = np.linalg.norm(mesh.closest_boundary(lost)[0] - lost, axis=1) > 1e-9
    # 69.
    assert inside.sum() > 10
    assert (tree.locate(lost[inside])[0] >= 0).all()


def test_what_runs_outside_goes_to_the_nearest_nodes() -> None:
    """Before the mesh, in a gap in its middle, behind it, and past it."""
    whole = block((4, 4, 4), (4.0, 4.0, 4.0))
    middle = whole.points[whole.tetrahedra].mean(axis=1)
    gap = (np.abs(middle - np.array([0.0, 0.0, -2.0])) < 1.0).all(axis=1)
    mesh = TetMesh(whole.points, whole.tetrahedra[~gap])
    x, y = np.array([0.3, -0.6, 0.2, 7.0]), np.array([0.5, 0.2, -1.6, 7.0])
    segments = beams(np.column_stack([x, y, np.full(4, 0.001)]), np.column_stack([x, y, np.full(4, -4.002)]))
    (part,) = mesh.tree.cut(segments.starts, segments.directions, segments.lengths)
    outside = part.cells < 0
    order = np.lexsort((part.enter[outside], part.paths[outside]))
    assert part.paths[outside][order].tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 3]
    assert part.enter[outside][order] == pytest.approx([0, 1.001, 4.001, 0, 1.001, 4.001, 0, 4.001, 0], abs=1e-8)
    assert part.leave[outside][order] == pytest.approx(
        [0.001, 3.001, 4.003, 0.001, 3.001, 4.003, 0.001, 4.003, 4.003], abs=1e-8
    )
    load = segment_load(mesh, coefficients_of(FORWARD), segments)
    assert load.sum() == pytest.approx(scattered(segments, FORWARD), rel=1e-12)
    assert load == pytest.approx(careful_load(mesh, FORWARD, segments), abs=CLOSE)


def test_a_wide_beam_in_a_ball_is_cut_as_one_by_one(ball: Surface, ball_mesh: TetMesh) -> None:
    """It enters and leaves through the true surface, outside the mesh's facets."""
    beam = PencilBeam((0.5, -0.3, 20.0), (0.1, 0.2, -1.0), radius=4.0, deposit="line")
    deposit = beam.deposit_in(Body(ball, (FORWARD,))).evaluate_on(ball_mesh, ball, coefficients_of(FORWARD))
    segments = deposit.terms.segments
    assert len(segments) > 20
    load = segment_load(ball_mesh, coefficients_of(FORWARD), segments)
    assert load.sum() == pytest.approx(scattered(segments, FORWARD), rel=1e-12)
    some = np.arange(0, len(segments), 20)
    fluxes = np.full(len(some), 1.0 / len(some))
    few = Segments(segments.starts[some], segments.directions[some], segments.lengths[some], fluxes)
    assert segment_load(ball_mesh, coefficients_of(FORWARD), few) == pytest.approx(
        careful_load(ball_mesh, FORWARD, few), abs=CLOSE
    )


@pytest.mark.parametrize("portion", [1, 50, 1000])
def test_portions_make_no_difference(portion: int, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = block((5, 5, 5), (5.0, 5.0, 5.0))
    random = np.random.default_rng(6)
    starts, ends = random.uniform(-2.5, 2.5, size=(2, 70, 3)) - [0, 0, 2.5]
    segments = beams(starts, ends)
    load = segment_load(mesh, coefficients_of(FORWARD), segments)
    monkeypatch.setattr(box_tree, "PAIRS_AT_ONCE", portion)
    assert segment_load(mesh, coefficients_of(FORWARD), segments) == pytest.approx(load, abs=1e-14)
    tree = mesh.tree
    parts = list(tree.cut(segments.starts, segments.directions, segments.lengths))
    assert len(parts) > {1: 60, 50: 20, 1000: 2}[portion]
    covered = np.zeros(len(starts))
    for part in parts:
        np.add.at(covered, part.paths, part.leave - part.enter)
    assert covered == pytest.approx(segments.lengths, rel=1e-12)


class Counting:
    """Counts the boxes of a tree that are looked into."""

    def __init__(self, boxes: FloatArray) -> None:
        self.boxes = boxes
        self.opened = 0

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, numbers: IntArray) -> FloatArray:
        self.opened += len(numbers)
        return np.asarray(self.boxes[numbers])


def test_few_boxes_are_opened_for_each_tetrahedron_that_is_passed(ball_mesh: TetMesh) -> None:
    """This is what keeps thousands of paths through a graded mesh from taking minutes."""
    graded = pressed(block((12, 12, 12), (2.0, 2.0, 1.0)), 3.0)
    random = np.random.default_rng(7)
    for mesh, size in ((ball_mesh, 5.0), (graded, 1.0)):
        starts = np.column_stack([random.uniform(-0.5, 0.5, size=(200, 2)) * size, np.zeros(200)])
        segments = beams(starts, starts * 0.5 - np.array([0.0, 0.0, size]))
        tree = mesh.tree
        levels = [Counting(level) for level in tree._boxes._levels]
        tree._boxes._levels = levels  # type: ignore[assignment]
        passed = sum(len(part.cells) for part in tree.cut(segments.starts, segments.directions, segments.lengths))
        opened = sum(level.opened for level in levels)
        # 6.1 in the ball, 1.0 in the block.
        assert opened < 8.0 * passed
        tested = [len(cells) for *_, cells in tree._near(segments.starts, segments.directions, segments.lengths)]
        # 2.7 and 2.1.
        assert sum(tested) < 4.0 * passed
        assert max(tested) <= box_tree.PAIRS_AT_ONCE


def test_far_from_the_origin_nothing_falls_between_tetrahedra() -> None:
    """Coordinates there carry a few digits of a tetrahedron only."""
    near = block((4, 4, 4), (0.04, 0.04, 0.04))
    mesh = TetMesh(near.points + np.array([1e6, -2e6, 3e6]), near.tetrahedra)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    grid = np.unique(mesh.points[:, 0])
    starts = np.array([[x, low[1], high[2]] for x in grid])
    segments = beams(starts, starts + np.array([0.0, 0.0, low[2] - high[2]]))
    tree = mesh.tree
    (part,) = tree.cut(segments.starts, segments.directions, segments.lengths)
    assert (part.cells >= 0).all()
    assert (tree.locate(mesh.points)[0] >= 0).all()


def test_points_are_found_in_the_tetrahedron_that_they_are_deepest_in(ball_mesh: TetMesh) -> None:
    random = np.random.default_rng(9)
    corners = ball_mesh.points[ball_mesh.tetrahedra]
    queries = np.vstack(
        [
            corners[:300].mean(axis=1),
            ball_mesh.points[:200],
            corners[300:400, :3].mean(axis=1),
            # Nearer to a face than what counts as in it.
            corners[400:500, :3].mean(axis=1) * (1.0 - 3e-7) + corners[400:500, 3] * 3e-7,
            random.uniform(-11, 11, size=(200, 3)),
        ]
    )
    cells, weights = ball_mesh.tree.locate(queries)
    every = np.arange(len(corners))
    for query, cell, weight in zip(queries, cells, weights, strict=True):
        depth = ball_mesh.barycentric(np.tile(query, (len(every), 1)), every).min(axis=1)
        assert (depth.max() >= -1e-6) == (cell >= 0)
        if cell >= 0:
            assert depth[cell] == pytest.approx(depth.max(), abs=1e-12)
            assert weight @ corners[cell] == pytest.approx(query, abs=1e-12)
        else:
            assert np.isnan(weight).all()


def test_points_outside_go_to_the_nearest_nodes(ball_mesh: TetMesh) -> None:
    face = ball_mesh.boundary_faces[5]
    middle = ball_mesh.points[face].mean(axis=0)
    points = np.vstack([middle * (10.0 / np.linalg.norm(middle)), 0.5 * middle])
    load = load_vector(ball_mesh, coefficients_of(FORWARD), SourceTerms(points=points, powers=np.array([2.0, 3.0])))
    assert load.sum() == pytest.approx(5.0, rel=1e-12)
    assert load[face].sum() == pytest.approx(2.0, rel=1e-12)


def test_points_and_lines_add_up() -> None:
    mesh = block((2, 2, 2), (2.0, 2.0, 2.0))
    line = beams([0.1, 0.2, 0.0], [0.3, -0.4, -2.0])
    points = SourceTerms(points=np.array([[0.5, 0.4, -0.3]]), powers=np.array([2.0]))
    both = SourceTerms(points.points, points.powers, segments=line, transmitted_irradiance=3.0)
    diffuse = SourceTerms(transmitted_irradiance=3.0)
    parts = (SourceTerms(segments=line), points, diffuse)
    apart = sum(load_vector(mesh, coefficients_of(FORWARD), part) for part in parts)
    assert load_vector(mesh, coefficients_of(FORWARD), both) == pytest.approx(apart, abs=1e-14)
