"""Walls that are cut through have rims within rims, which a ring closes."""

import numpy as np
import pytest

from tetlux.meshing import surface_from_arrays
from tetlux.meshing.arrays import FloatArray, IntArray

Arrays = tuple[FloatArray, IntArray]


def wall(radius: float, count: int, height: float = 30.0, top: float | None = None, slope: float = 0.0) -> Arrays:
    """A tube without ends, outward oriented, whose ends lie in parallel planes."""
    angle = 2.0 * np.pi * np.arange(count) / count
    circle = np.column_stack([np.cos(angle), np.sin(angle), slope * np.cos(angle)])
    upper = circle * (radius if top is None else top) + [0.0, 0.0, height]
    here = np.arange(count)
    there = (here + 1) % count
    faces = [[here, there, count + there], [here, count + there, count + here]]
    return np.vstack([circle * radius, upper]), np.hstack(faces).T


def join_arrays(*parts: Arrays) -> Arrays:
    """The first tube, and all others as bores."""
    first = np.cumsum([0, *(len(points) for points, _ in parts)])
    faces = [(faces if i == 0 else faces[:, ::-1]) + first[i] for i, (_, faces) in enumerate(parts)]
    return np.vstack([points for points, _ in parts]), np.vstack(faces)


def disc(radius: float, count: int) -> float:
    return float(0.5 * count * radius**2 * np.sin(2.0 * np.pi / count))


@pytest.mark.parametrize(("count", "slope"), [(12, 0.0), (60, 0.4), (200, 0.0)])
def test_a_thick_pipe_gets_a_ring_at_each_end(count: int, slope: float) -> None:
    arrays = join_arrays(wall(10.0, count, slope=slope), wall(6.0, count, slope=slope))
    closed = surface_from_arrays(*arrays, holes="close")
    assert closed.volume == pytest.approx(30.0 * (disc(10.0, count) - disc(6.0, count)), rel=1e-6)
    assert closed.repairs[-1].startswith("capped 2 holes")
    assert closed.warnings == ()


def test_several_bores_and_a_rod_in_one_of_them() -> None:
    (narrow, faces), (wide, _), rod = wall(3.0, 40), wall(5.0, 40), wall(2.0, 40)
    left, right = np.array([-8.0, 0.0, 0.0]), np.array([6.0, 0.0, 0.0])
    points, triangles = join_arrays(wall(20.0, 40), (narrow + left, faces), (wide + right, faces))
    scene = np.vstack([points, rod[0] + right]), np.vstack([triangles, rod[1] + len(points)])
    closed = surface_from_arrays(*scene, holes="close")
    expected = 30.0 * (disc(20.0, 40) - disc(3.0, 40) - disc(5.0, 40) + disc(2.0, 40))
    assert closed.volume == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_bores_anywhere_leave_flat_rings(seed: int) -> None:
    """A plate with four bores of different size and shape: no cap overlaps itself, or a bore."""
    random = np.random.default_rng(seed)
    parts, area = [wall(20.0, 5 + 20 * seed, 6.0)], disc(20.0, 5 + 20 * seed)
    for quadrant in range(4):
        radius, count = random.uniform(1.0, 4.0), int(random.integers(3, 16))
        place = np.array([5.5 * (-1) ** quadrant, 5.5 * (-1) ** (quadrant // 2), 0.0])
        points, faces = wall(radius, count, 6.0)
        parts.append((points + place + [*random.uniform(-0.5, 0.5, 2), 0.0], faces))
        area -= disc(radius, count)
    closed = surface_from_arrays(*join_arrays(*parts), holes="close")
    ends = np.abs(closed.normals[:, 2]) > 0.5
    corners = closed.points[closed.faces[ends]]
    caps = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert caps.sum() == pytest.approx(2.0 * area, rel=1e-9)
    assert closed.volume == pytest.approx(6.0 * area, rel=1e-9)


@pytest.mark.parametrize(("top", "height"), [(9.0, 1.0), (5.0, 1.0), (9.0, 0.2)])
def test_a_shallow_funnel_gets_two_discs(top: float, height: float) -> None:
    closed = surface_from_arrays(*wall(10.0, 60, height, top), holes="close")
    assert closed.volume == pytest.approx(disc(1.0, 60) * height / 3.0 * (100.0 + 10.0 * top + top**2), rel=1e-6)


def test_caps_that_overlap_are_said() -> None:
    points, faces = join_arrays(wall(10.0, 40), wall(6.0, 40))
    faces[80:] = faces[80:, ::-1]
    closed = surface_from_arrays(points, faces, holes="close")
    assert any("holes lie within holes around (0, 0, 0), (0, 0, 30)" in warning for warning in closed.warnings)


def test_a_tube_of_many_long_triangles_is_not_in_pieces() -> None:
    closed = surface_from_arrays(*wall(10.0, 400), holes="close")
    assert closed.volume == pytest.approx(30.0 * disc(10.0, 400), rel=1e-6)
