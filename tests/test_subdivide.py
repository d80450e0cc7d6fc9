"""Splitting triangles for pictures."""

import numpy as np

from tests.conftest import TISSUE
from tetlux.fem import PointSource, solve
from tetlux.fem.exact import half_space
from tetlux.fem.outcome.surface_exitance import surface_exitance
from tetlux.meshing import slab
from tetlux.meshing.arrays import FloatArray, IntArray
from tetlux.meshing.surface.subdivide import mark_longest_edges, number_triangle_edges, split_edges
from tetlux.meshing.surface.triangles import signed_volume, triangle_areas


def smallest_angle(points: FloatArray, faces: IntArray) -> float:
    corners = points[faces]
    a, b = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cosine = np.einsum("fij,fij->fi", a, b) / np.linalg.norm(a, axis=2) / np.linalg.norm(b, axis=2)
    return float(np.degrees(np.arccos(cosine)).min())


def test_a_closed_surface_stays_closed_and_its_triangles_do_not_get_thin() -> None:
    plate = slab(10.0, 2.0)
    points, faces = plate.points, plate.faces
    thinnest = smallest_angle(points, faces)
    for _ in range(12):
        edges = ends, _ = number_triangle_edges(faces)
        near = np.linalg.norm(points[ends].mean(axis=1) - [1.0, 2.0, 0.0], axis=1)
        marked = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1) > 0.5 * near
        points, faces, parents = split_edges(points, faces, edges, mark_longest_edges(points, edges, marked))
        assert len(parents) == len(faces)
    _, edge = number_triangle_edges(faces)
    assert (np.bincount(edge.ravel()) == 2).all()
    assert np.isclose(triangle_areas(points, faces)[1].sum(), plate.area)
    assert np.isclose(signed_volume(points, faces), plate.volume)
    assert (points[:8] == plate.points).all()
    # Rivara: no angle falls below half of the smallest there was.
    assert smallest_angle(points, faces) >= 0.5 * thinnest - 1e-9


def test_twelve_triangles_show_a_spot_in_the_middle_of_one() -> None:
    plate = slab(60.0, 10.0)
    solution = solve(plate, TISSUE, [PointSource((4.0, 7.0, -1.0))])
    surface, exitance = surface_exitance(solution)
    assert (surface.points[:8] == plate.points).all()
    peak = half_space.point_exitance(TISSUE, depth=1.0, rho=[0.0])[0]
    assert 0.9 * peak < exitance.max() < 1.02 * peak
    areas = triangle_areas(surface.points, surface.faces)[1]
    # Linear between the vertices, the exitance integrates to the power that leaves.
    total = areas @ exitance[surface.faces].mean(axis=1)
    assert abs(total / solution.power.exited - 1.0) < 0.02
    at = solution.exitance_at(surface.points[::7])
    np.testing.assert_allclose(exitance[::7], at, rtol=1e-6, atol=1e-12)
