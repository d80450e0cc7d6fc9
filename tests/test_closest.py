"""Closest points: those of all triangles, near and far, and what is remembered of them."""

import pickle

import numpy as np
import pytest

from tetlux.meshing import box, sphere, torus
from tetlux.meshing.arrays import FloatArray
from tetlux.meshing.search import located
from tetlux.meshing.search.closest import ClosestPoint
from tetlux.meshing.search.located import Located
from tetlux.meshing.surface.surface import Surface


def sampled(body: Surface, count: int = 40) -> FloatArray:
    """Points (c, 3) on all triangles, `count` to a side."""
    i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
    inside = i + j <= count
    weights = np.stack([i[inside], j[inside], count - i[inside] - j[inside]], axis=1) / count
    return np.asarray(np.einsum("wc,fcx->fwx", weights, body.points[body.faces]).reshape(-1, 3))


def queries_around(body: Surface, seed: int) -> FloatArray:
    """Points on vertices, edges and triangles, close to them, inside and far outside."""
    rng = np.random.default_rng(seed)
    corners = body.points[body.faces]
    on = corners.mean(axis=1)
    return np.vstack(
        [
            body.points[:40],
            0.5 * (corners[:40, 0] + corners[:40, 1]),
            on[:40],
            on[rng.integers(0, len(on), 100)] + rng.normal(0.0, 0.2, (100, 3)),
            rng.uniform(-15.0, 15.0, (100, 3)),
            rng.uniform(-500.0, 500.0, (20, 3)),
        ]
    )


@pytest.mark.parametrize(
    ("body", "seed"), [(box((4.0, 7.0, 20.0)), 1), (sphere(9.0, subdivisions=2), 2), (torus(8.0, 3.0, segments=24), 3)]
)
def test_no_point_of_any_triangle_is_closer(body: Surface, seed: int) -> None:
    queries = queries_around(body, seed)
    nearest, faces = ClosestPoint(body.points, body.faces)(queries)
    distance = np.linalg.norm(nearest - queries, axis=1)
    # It lies in the triangle that is named.
    a, b, c = (body.points[body.faces[faces, i]] for i in range(3))
    areas = sum(np.linalg.norm(np.cross(p - nearest, q - nearest), axis=1) for p, q in ((a, b), (b, c), (c, a)))
    np.testing.assert_allclose(areas, np.linalg.norm(np.cross(b - a, c - a), axis=1), rtol=1e-6)
    samples = sampled(body)
    spacing = 1.2 * np.linalg.norm(body.points[body.faces] - body.points[np.roll(body.faces, 1, 1)], axis=2).max() / 40
    for query, found in zip(queries, distance, strict=True):
        least = np.linalg.norm(samples - query, axis=1).min()
        assert found <= least + 1e-9
        assert least <= np.hypot(found, spacing) + 1e-9


def test_queries_out_of_reach_have_an_answer() -> None:
    ball = sphere(9.0, subdivisions=3)
    nearest, faces = ClosestPoint(ball.points, ball.faces)(
        np.array([[1e12, 0.0, 0.0], [0.0, 1e250, 0.0], [np.inf, 0.0, 0.0], [np.nan, 0.0, 0.0], [0.0, 0.0, 0.0]])
    )
    np.testing.assert_allclose(nearest[:2], [[9.0, 0.0, 0.0], [0.0, 9.0, 0.0]], atol=0.05)
    assert np.isfinite(nearest).all()
    assert ((faces >= 0) & (faces < len(ball.faces))).all()
    assert np.linalg.norm(nearest[-1]) == pytest.approx(9.0, abs=0.1)


def test_within_is_the_distance_of_the_closest_point() -> None:
    ring = torus(8.0, 3.0, segments=24)
    queries = queries_around(ring, 4)
    closest = ClosestPoint(ring.points, ring.faces)
    distance = np.linalg.norm(closest(queries)[0] - queries, axis=1)
    for reach in (1e-3, 0.3, 4.0, 100.0):
        np.testing.assert_array_equal(closest.within(queries, reach), distance <= reach)
    assert len(closest.within(np.zeros((0, 3)), 1.0)) == len(closest(np.zeros((0, 3)))[0]) == 0


def test_a_point_is_located_once(monkeypatch: pytest.MonkeyPatch) -> None:
    ball = sphere(9.0, subdivisions=2)
    closest, searched = ClosestPoint(ball.points, ball.faces), []
    usual = ClosestPoint._find

    def counted(self: ClosestPoint, queries: FloatArray) -> object:
        searched.append(len(queries))
        return usual(self, queries)

    monkeypatch.setattr(ClosestPoint, "_find", counted)
    queries = queries_around(ball, 5)
    first = closest(queries)
    # In another order, and with one point more.
    turned = np.vstack([queries[::-1], [[3.0, 2.0, 1.0]]])
    again = closest(turned)
    assert searched == [len(queries), 1]
    np.testing.assert_array_equal(again[0][:-1], first[0][::-1])
    np.testing.assert_array_equal(again[1][:-1], first[1][::-1])
    restored = pickle.loads(pickle.dumps(closest))
    np.testing.assert_array_equal(restored(queries)[0], first[0])


def test_memory_of_points_is_bounded_and_tells_points_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(located, "MOST_POINTS", 100)
    known = Located()
    points = np.random.default_rng(6).normal(size=(150, 3))
    for some in (slice(0, 60), slice(60, 90)):
        known.add(points[some], 2.0 * points[some], np.arange(150)[some])
    found, nearest, faces = known.find(points)
    np.testing.assert_array_equal(found, np.arange(150) < 90)
    np.testing.assert_array_equal(nearest[:90], 2.0 * points[:90])
    np.testing.assert_array_equal(faces[:90], np.arange(90))
    known.add(points[90:], points[90:], np.arange(90, 150))
    np.testing.assert_array_equal(known.find(points)[0], np.arange(150) >= 90)
    # All points with one key: none is taken for another.
    monkeypatch.setattr(located, "_keys_of", lambda points: np.zeros(len(points), dtype=np.uint64))
    same = Located()
    same.add(points[:3], points[:3], np.arange(3))
    assert same.find(points)[0].sum() == 1


def test_rounding_does_not_choose_among_equally_close_triangles() -> None:
    """Above the corner of a box, which several triangles share, at scales that round differently."""
    cube = box((1.0, 1.0, 1.0))
    at_corner = np.flatnonzero((np.abs(cube.points[cube.faces] - 0.5).sum(axis=2) < 1e-9).any(axis=1))
    assert len(at_corner) > 2
    for scale in (1.0, 1e-3, 0.3, 7.0, 1e3, 1.1e5):
        _, faces = ClosestPoint(scale * cube.points, cube.faces)(scale * np.array([[0.7, 0.6, 0.9]]))
        assert faces.tolist() == [at_corner[0]]


def test_points_of_all_tables_are_known() -> None:
    known, rng = Located(), np.random.default_rng(3)
    tables = [rng.normal(size=(count, 3)) for count in (400, 30, 3)]
    for number, points in enumerate(tables):
        known.add(points, 2.0 * points, np.full(len(points), number))
    assert len(known._tables) == 3
    points = np.vstack(tables)
    found, nearest, faces = known.find(points)
    assert found.all()
    np.testing.assert_array_equal(nearest, 2.0 * points)
    np.testing.assert_array_equal(faces, np.repeat([0, 1, 2], [400, 30, 3]))
    for _ in range(100):
        known.add(rng.normal(size=(30, 3)), np.zeros((30, 3)), np.zeros(30, np.int64))
    assert len(known._tables) < 5
    assert known.find(points)[0].all()
    assert not known.find(points + 1.0)[0].any()
