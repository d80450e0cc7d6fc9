"""A coarser surface within a measured distance."""

from dataclasses import replace

import numpy as np
import pytest

from tetlux.meshing import InputError, Surface, box, sphere, surface_from_arrays, torus
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.mesher import proxy
from tetlux.meshing.mesher.deviation import two_sided_distance
from tetlux.meshing.mesher.proxy import proxy as proxy_of
from tetlux.meshing.repair.crossings import count_self_intersections
from tetlux.meshing.repair.topology import Edges, bodies


def _together(*surfaces: Surface) -> Surface:
    offsets = np.cumsum([0] + [len(s.points) for s in surfaces])
    points = np.vstack([s.points for s in surfaces])
    return surface_from_arrays(points, np.vstack([s.faces + o for s, o in zip(surfaces, offsets, strict=False)]))


def _bumpy(amount: float) -> Surface:
    ball = sphere(10.0)
    height = np.sin(1.3 * ball.points[:, 0]) * np.sin(1.1 * ball.points[:, 1]) * np.sin(0.9 * ball.points[:, 2])
    return surface_from_arrays(ball.points * (1.0 + amount * height)[:, None], ball.faces)


@pytest.mark.parametrize("make", [lambda: sphere(1e-3), lambda: torus(4e3, 1.5e3), lambda: _bumpy(0.03)])
@pytest.mark.parametrize("share", [0.003, 0.01])
def test_it_is_coarser_near_and_sound(make: object, share: float) -> None:
    assert callable(make)
    surface = make()
    deviation = share * surface.diagonal
    coarse = proxy_of(surface, deviation)
    assert len(coarse.faces) < 0.5 * len(surface.faces)
    assert two_sided_distance(coarse, surface) <= deviation
    # Every vertex, edge and triangle: here the usual places hold the farthest (on a scan of 100k triangles it
    # was up to 1.2 times as far).
    assert two_sided_distance(coarse, surface, 80_000) <= deviation
    edges = Edges(coarse.faces)
    assert (edges.triangles == 2).all()
    assert (edges.balance == 0).all()
    assert coarse.volume == pytest.approx(surface.volume, rel=0.05)
    assert count_self_intersections(coarse.points, coarse.faces) == 0
    assert coarse.unit == surface.unit


def test_a_larger_deviation_makes_fewer_triangles() -> None:
    ring = torus(4.0, 1.5)
    counts = [len(proxy_of(ring, share * ring.diagonal).faces) for share in (0.001, 0.002, 0.004)]
    assert counts[0] > 1.3 * counts[1] > 1.3**2 * counts[2]


def test_a_first_try_that_is_too_coarse_is_followed_by_finer_ones() -> None:
    bumpy = _bumpy(0.1)
    coarse = proxy_of(bumpy, 0.01 * bumpy.diagonal)
    first = proxy.TRIANGLES_NEEDED * bumpy.area / (0.01 * bumpy.diagonal**2)
    assert 1.1 * first < len(coarse.faces) < 0.8 * len(bumpy.faces)


def test_the_result_is_measured_at_more_places_than_the_tries(monkeypatch: pytest.MonkeyPatch) -> None:
    ball = sphere(1.0)

    def distance(_: Surface, __: Surface, samples: int = 10**6) -> float:
        return 0.008 if samples == proxy.FIRST_SAMPLES else 0.011

    monkeypatch.setattr(proxy, "two_sided_distance", distance)
    assert proxy_of(ball, 0.01) is ball
    assert proxy_of(ball, 0.012) is not ball


def test_bodies_stay_as_many_and_overlaps_may_stay() -> None:
    apart = _together(sphere(6.0), sphere(6.0, center=(14.0, 0.0, 0.0)))
    coarse = proxy_of(apart, 0.005 * apart.diagonal)
    assert len(coarse.faces) < 0.5 * len(apart.faces)
    assert bodies(len(coarse.points), coarse.faces).max() == 1
    crossing = _together(sphere(6.0), sphere(6.0, center=(5.0, 0.0, 0.0)))
    coarse = proxy_of(crossing, 0.005 * crossing.diagonal)
    assert len(coarse.faces) < 0.5 * len(crossing.faces)
    assert coarse.overlaps


def test_what_is_coarse_already_stays_itself() -> None:
    cube, ball = box((1.0, 2.0, 3.0)), sphere(1.0)
    assert proxy_of(cube, 0.1) is cube
    assert proxy_of(ball, 1e-7) is ball


def test_a_decimation_that_is_not_sound_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    ball = sphere(1.0)
    open_one, far = sphere(1.0, subdivisions=3), sphere(1.2, subdivisions=3)
    two = _together(sphere(0.5, subdivisions=3, center=(0.5, 0, 0)), sphere(0.4, subdivisions=3, center=(-0.5, 0, 0)))
    turned = replace(open_one, faces=open_one.faces[:, ::-1])
    crumpled = replace(open_one, points=open_one.points.copy())
    crumpled.points[0] *= -1.1
    hole = replace(open_one, faces=open_one.faces[1:])
    # The same distance for all: what is asked for here is that each is refused for its own reason.
    monkeypatch.setattr(proxy, "two_sided_distance", lambda *_: 0.0)
    for wrong, used in ((hole, False), (two, False), (turned, False), (crumpled, False), (open_one, True)):
        result = (wrong.points / ball.diagonal, wrong.faces)
        monkeypatch.setattr(proxy, "_decimate_to", lambda *_, result=result: result)
        assert (proxy_of(ball, 0.02) is not ball) == used
    monkeypatch.undo()
    monkeypatch.setattr(proxy, "_decimate_to", lambda *_: (far.points / ball.diagonal, far.faces))
    assert proxy_of(ball, 0.02) is ball


def test_flaps_and_crumbs_go() -> None:
    ball = sphere(1.0, subdivisions=2)
    a, b, _ = ball.faces[0]
    far = ball.faces[-1, 0]
    flap = np.array([[a, b, far], [b, a, far]])
    new = len(ball.points)
    # A tetrahedron on the edge ab.
    crumb = np.array([[a, b, new], [b, a, new + 1], [a, new, new + 1], [b, new + 1, new]])
    for extra in (flap, crumb):
        faces = np.vstack([ball.faces, extra]).astype(np.int64)
        assert not proxy._is_manifold(faces)
        assert sorted(map(tuple, proxy._remove_flaps(faces))) == sorted(map(tuple, ball.faces))


@pytest.mark.parametrize("deviation", [0.0, -1.0, float("nan"), float("inf")])
def test_a_deviation_must_be_a_length(deviation: float) -> None:
    with pytest.raises(InputError, match=f"deviation is {deviation:g}"):
        proxy_of(sphere(1.0), deviation)


def test_the_distance_is_two_sided() -> None:
    ball, larger = sphere(10.0), sphere(11.0)
    # The middles of triangles are up to 0.015 inside.
    assert two_sided_distance(ball, larger) == pytest.approx(1.0, abs=0.02)
    with_another = _together(ball, sphere(1.0, subdivisions=2, center=(20.0, 0.0, 0.0)))
    for first, second in ((ball, with_another), (with_another, ball)):
        assert two_sided_distance(first, second) == pytest.approx(11.0, abs=0.02)


def test_the_distance_is_seen_between_vertices() -> None:
    def plate(heights: FloatArray) -> tuple[FloatArray, IntArray]:
        cube = box((2.0, 2.0, 2.0))
        points = cube.points.copy()
        points[:, 2] += heights[: len(points)]
        return points, cube.faces

    points, faces = plate(np.zeros(8))
    # The diagonal of one side runs the other way, and the side is bent: vertices agree, the middle does not.
    flipped = faces.copy()
    top = np.flatnonzero((points[faces][:, :, 2] == 1).all(axis=1))
    one, other = faces[top[0]], faces[top[1]]
    shared = np.intersect1d(one, other)
    alone = [int(np.setdiff1d(f, shared)[0]) for f in (one, other)]
    points[alone, 2] += 1.0
    ordered = np.roll(one, -int(np.flatnonzero(one == alone[0])[0]))
    flipped[top[0]], flipped[top[1]] = [alone[0], ordered[1], alone[1]], [alone[0], alone[1], ordered[2]]
    distance = two_sided_distance(Surface(points, faces), Surface(points, flipped))
    assert 0.5 < distance <= 1.0
