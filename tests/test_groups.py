"""Groups of triangles cover a surface once at each level; integrals over them hardly depend on its triangles."""

from dataclasses import replace

import numpy as np
import pytest

from tetlux.fem.charges.quadrature import quadrature
from tetlux.fem.charges.samples import Spacing, cells_of, draw
from tetlux.meshing import Surface, box, sphere
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.surface.groups import bisect, cut_long_triangles
from tetlux.meshing.surface.subdivide import quarter_triangles
from tetlux.meshing.surface.triangles import longest_sides


def constant(size: float) -> Spacing:
    return lambda points: np.full(len(points), size)


def quartered(surface: Surface, often: int) -> Surface:
    """The same flat surface in 4^often as many triangles."""
    corners = surface.points[surface.faces]
    for _ in range(often):
        corners = quarter_triangles(corners)
    points, faces = np.unique(corners.reshape(-1, 3).round(12), axis=0, return_inverse=True)
    return Surface(points, faces.reshape(-1, 3))


@pytest.fixture(scope="module")
def ball() -> Surface:
    return sphere(10.0)


def test_each_level_holds_every_piece_once(ball: Surface) -> None:
    groups = ball.groups
    assert sorted(groups.faces.tolist()) == list(range(len(ball.faces)))
    assert len(groups.levels[0].starts) == 6
    for coarse, fine in zip(groups.levels, groups.levels[1:], strict=False):
        assert (coarse.starts == fine.starts[coarse.children[:-1]]).all()
        assert coarse.ends[-1] == fine.ends[-1] == len(groups.faces)
        assert (coarse.starts[1:] == coarse.ends[:-1]).all()


def test_groups_are_as_large_as_they_say(ball: Surface) -> None:
    for level in ball.groups.levels[:4]:
        for start, end, middle, size in zip(level.starts, level.ends, level.centroids, level.sizes, strict=True):
            corners = ball.groups.corners[start:end].reshape(-1, 3)
            assert np.linalg.norm(np.ptp(corners, axis=0)) == pytest.approx(size)
            assert (middle >= corners.min(axis=0)).all()
            assert (middle <= corners.max(axis=0)).all()


def test_the_two_sides_of_a_plate_are_in_different_groups() -> None:
    plate = quartered(box((10.0, 10.0, 0.01)), 4)
    cells = cells_of(plate, constant(3.0))
    assert cells.is_group.any()
    corners = plate.groups.corners
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for start, end in zip(cells.starts, cells.ends, strict=True):
        assert (normals[start:end] @ normals[start] > 0).all()


def test_areas_are_those_of_the_smooth_surface(ball: Surface) -> None:
    assert ball.groups.areas.sum() == pytest.approx(4.0 * np.pi * 100.0, rel=1e-5)
    assert ball.area == pytest.approx(4.0 * np.pi * 100.0, rel=2e-3)
    assert ball.area < 0.9995 * 4.0 * np.pi * 100.0
    flat = replace(ball, crease_angle=0.0)
    assert flat.groups.areas.sum() == pytest.approx(flat.area)


def test_points_are_as_many_as_the_spacing_asks_for_however_many_triangles_there_are() -> None:
    cube = box((10.0, 10.0, 10.0))
    counts, moments = [], []
    for often in (2, 5, 6):
        points = quadrature(quartered(cube, often), constant(2.0))
        counts.append(len(points))
        moments.append(points.areas @ points.points**4)
        assert points.areas.sum() == pytest.approx(600.0)
        assert np.abs(np.linalg.norm(points.normals, axis=1) - 1.0).max() < 1e-12
    assert counts[2] <= counts[1] < 0.6 * len(quartered(cube, 5).faces)
    # The integral of x^4 over the cube's surface: 2 (100) 5^4 + 4 (10) 2 5^5/5.
    assert np.array(moments) == pytest.approx(np.full((3, 3), 175_000.0), rel=0.01)


def test_long_thin_triangles_are_cut_first() -> None:
    rod = box((20.0, 0.2, 0.2))
    groups = rod.groups
    assert longest_sides(rod.points[rod.faces]).max() > 20.0
    assert longest_sides(groups.corners).max() < 1.0
    assert len(groups.faces) < 1000
    assert groups.areas.sum() == pytest.approx(rod.area)
    # Pieces of neighbouring triangles are in one group.
    cells = cells_of(rod, constant(1.0))
    assert cells.is_group.any()
    assert len(cells.starts) < 200


def test_a_degenerate_triangle_is_cut_into_finitely_many_pieces() -> None:
    corners = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [[0.0, 0.0, 0.0], [1, 0, 0], [0, 1, 0]]])
    faces, pieces = cut_long_triangles(corners)
    assert 2 < len(pieces) < 5000
    assert (faces == 1).sum() == 1


@pytest.mark.parametrize("tip", [(30.0, 0.1, 0.0), (15.0, 0.5, 0.2), (29.0, 1.0, 0.0)])
def test_pieces_cover_a_triangle_once_and_keep_its_side(tip: tuple[float, float, float]) -> None:
    corners = np.array([[[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], tip]])
    whole = np.cross(corners[0, 1], corners[0, 2])
    _, pieces = cut_long_triangles(corners)
    normals = np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0])
    assert normals.sum(axis=0) == pytest.approx(whole)
    assert (normals @ whole > 0).all()
    assert len(pieces) > 10


def test_bisection_halves_areas() -> None:
    corners = np.random.default_rng(1).random((20, 3, 3))

    def areas(some: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(np.cross(some[:, 1] - some[:, 0], some[:, 2] - some[:, 0]), axis=1))

    assert areas(bisect(corners)) == pytest.approx(np.repeat(0.5 * areas(corners), 2))


def test_draws_from_groups_are_even() -> None:
    """As many points in each octant."""
    fine = quartered(box((10.0, 10.0, 10.0)), 5)
    samples = draw(cells_of(fine, constant(1.0)), np.random.default_rng(0))
    assert len(samples) == pytest.approx(4 * 600, rel=0.01)
    # Groups are squares of .625, of four squares of triangles.
    top = samples.points[samples.points[:, 2] > 4.999, :2] + 5.0
    assert (top % 0.625 < 0.3125).all(axis=1).mean() == pytest.approx(0.25, abs=0.08)
    octants = (samples.points > 0).astype(int) @ np.array([4, 2, 1])
    assert np.bincount(octants) == pytest.approx(np.full(8, 300), rel=0.06)
