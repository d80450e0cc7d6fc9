"""Light that covers a surface: layers of flat tetrahedra in place of many small regular ones."""

import numpy as np
import pytest

from tests.benchmarks.scenes import lit_ball, turbid
from tests.conftest import block
from tetlux.fem import System, solve
from tetlux.fem.exact.sphere_light import beam_total
from tetlux.fem.grading import Layers
from tetlux.meshing import Surface, box, sphere, torus
from tetlux.meshing.mesher.api import tetrahedralize
from tetlux.meshing.tets.layers import add_layers

DEPTHS = np.array([0.1, 0.3, 0.7])


def test_layers_lie_at_the_depths_that_are_asked_for() -> None:
    """Below the boundary, which stays what it was; nothing is lost, and nothing overlaps."""
    mesh = block((6, 6, 6), (12.0, 12.0, 12.0))
    layered, parents = add_layers(mesh, DEPTHS, np.ones(len(mesh.points), dtype=bool))
    assert layered.volume == pytest.approx(mesh.volume, rel=1e-12)
    assert layered.area == pytest.approx(mesh.area, rel=1e-12)
    assert len(layered.boundary_faces) == len(mesh.boundary_faces)
    # Away from the cube's edges, where depths are measured along the normal.
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    central = (np.abs(layered.points[:, :2] - 0.5 * (low + high)[:2]) < 3.0).all(axis=1)
    below = np.unique((high[2] - layered.points[central, 2]).round(9))
    assert below[:4] == pytest.approx([0.0, *DEPTHS])
    assert set(np.unique(parents)) == set(range(len(mesh.tetrahedra)))
    # The tetrahedra of layers belong to the one that their facet bounds.
    flat = parents[len(mesh.tetrahedra) :]
    assert set(np.unique(flat)) == set(np.unique(mesh.boundary_cells))


def test_there_are_no_layers_where_no_light_is() -> None:
    """Nor where the body is too thin for them."""
    mesh = block((6, 6, 6), (12.0, 12.0, 12.0))
    top = mesh.points[:, 2] == mesh.points[:, 2].max()
    layered, _ = add_layers(mesh, DEPTHS, top)
    inner = layered.points[len(mesh.points) :, 2]
    assert len(inner) > 0
    assert inner.min() > mesh.points[:, 2].max() - DEPTHS[-1] - 1e-9
    nothing, parents = add_layers(mesh, DEPTHS, np.zeros(len(mesh.points), dtype=bool))
    assert len(nothing.points) == len(mesh.points)
    assert parents.tolist() == list(range(len(mesh.tetrahedra)))
    plate = block((6, 6, 1), (12.0, 12.0, 0.5))
    thin, _ = add_layers(plate, DEPTHS, np.ones(len(plate.points), dtype=bool))
    assert thin.volume == pytest.approx(plate.volume, rel=1e-12)
    assert thin.volumes.min() > 0


@pytest.mark.parametrize("shape", [box((10.0, 10.0, 2.0)), torus(10.0, 4.0)], ids=["box", "torus"])
def test_layers_do_not_fold(shape: Surface) -> None:
    """Below edges and narrow facets they are thinner, so that tetrahedra do not overlap: the volume stays exact."""
    mesh = tetrahedralize(shape)
    depths = np.geomspace(0.01, 3.0, 15)
    layered, _ = add_layers(mesh, depths, np.ones(len(mesh.points), dtype=bool))
    assert len(layered.points) > 1.5 * len(mesh.points)
    assert layered.volume == pytest.approx(mesh.volume, rel=1e-12)
    assert layered.area == pytest.approx(mesh.area, rel=1e-12)


def test_layers_keep_the_regions_of_a_mesh() -> None:
    """And the surfaces between them, when a region lies just below the boundary."""
    ball = sphere(10.0)
    mesh = tetrahedralize(ball, [sphere(7.0)])
    layered, parents = add_layers(mesh, DEPTHS, np.ones(len(mesh.points), dtype=bool))
    assert len(layered.points) > 1.5 * len(mesh.points)
    assert (layered.regions == mesh.regions[parents]).all()
    assert layered.region_volumes == pytest.approx(mesh.region_volumes, rel=1e-12)
    # A region close below is not in the way of thinner ones.
    mesh = tetrahedralize(ball, [sphere(9.5)])
    layered, _ = add_layers(mesh, DEPTHS, np.ones(len(mesh.points), dtype=bool))
    assert len(layered.points) > len(mesh.points)
    assert layered.region_volumes == pytest.approx(mesh.region_volumes, rel=1e-12)


def test_a_wide_beam_costs_no_more_for_its_thin_layer() -> None:
    """Exitance, power and estimate by the series of a ball; nodes hardly grow with the radius."""
    nodes = {}
    for radius in (10.0, 100.0):
        ball = lit_ball("", turbid(0.99, 1.0), radius=radius)
        solution = solve(ball.surface, ball.medium, [ball.light], tolerance=0.02)
        error = ball.error(solution)
        assert error < 0.02
        assert 0.5 < solution.error_estimate / error < 3.0
        assert solution.power.exited == pytest.approx(beam_total(ball.medium, radius=radius), rel=0.02)
        nodes[radius] = len(solution.mesh.points)
    assert nodes[10.0] < 5_000
    assert nodes[100.0] < 10.0**0.5 * nodes[10.0]


def test_exitance_hardly_depends_on_how_high_layers_are() -> None:
    """Their light is that of prisms, whichever way these are divided into tetrahedra: as such it is off by 3 %."""
    ball = lit_ball("", turbid(0.99, 1.0), radius=10.0)
    mesh = tetrahedralize(ball.surface)
    found = []
    for depths in ([0.07, 0.17, 0.3, 0.5, 0.8, 1.2, 2.0], [0.8, 2.0]):
        layered, _ = add_layers(mesh, np.array(depths), mesh.points[:, 2] > 0.0)
        solution = System(layered, ball.medium, ball.surface).solve([ball.light])
        found.append(solution.exitance[layered.boundary_points[:, 2] > 5.0])
    assert len(found[0]) > 40
    assert found[1] == pytest.approx(found[0], rel=0.015)


def test_edges_that_light_reaches_are_found() -> None:
    """Light varies along the surface there, which layers do not resolve."""
    cube = box((20.0, 20.0, 20.0))
    top = cube.points[:, 2].max()
    low, high = cube.points.min(axis=0), cube.points.max(axis=0)
    grid = np.stack(np.meshgrid(*(np.linspace(a, b, 30) for a, b in zip(low[:2], high[:2], strict=True))), axis=-1)
    places = np.column_stack([grid.reshape(-1, 2), np.full(900, top)])
    layers = Layers(places, places[:0], depth=1.0, resolution=1.0, tolerance=0.02)
    found, lengths = layers.places_without(cube)
    assert (lengths == 2.0).all()
    lit = found[found[:, 2] == top]
    assert len(lit) >= 80
    # Each lies on an edge of the lit face, or on one that leads down from it, near it.
    inside = np.minimum(found - low, high - found)
    assert ((inside < 1e-9).sum(axis=1) >= 2).all()
    assert found[:, 2].min() > top - 3.0
    assert layers.places_without(sphere(10.0))[0].shape == (0, 3)
