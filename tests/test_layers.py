"""Layers of flat tetrahedra: a sound mesh of the same body, and what light that fades below the surface gains by it."""

import numpy as np
import pytest

from tests.conftest import block
from tetlux.fem import CollimatedBeam, Deposit, Medium, MeshHints, System
from tetlux.fem.exact import sphere_light
from tetlux.fem.grading import layer_sizes
from tetlux.meshing import TetMesh, sphere, tetrahedralize, torus
from tetlux.meshing.boundary.curved_facets import CurvedFacets
from tetlux.meshing.boundary.layers import add_layers


def layered(mesh: TetMesh, height: float, depth: float = 3.0) -> TetMesh:
    count = len(mesh.boundary_nodes)
    return add_layers(mesh, np.full(count, height), np.full(count, depth)).mesh


@pytest.mark.parametrize("height", [0.02, 0.3])
@pytest.mark.parametrize("name", ["ball", "ring", "block"])
def test_layers_fill_the_body_that_was_there(name: str, height: float, ball_mesh: TetMesh) -> None:
    meshes = {"ring": lambda: tetrahedralize(torus(6.0, 2.0)), "block": lambda: block((4, 4, 4), (8.0, 8.0, 8.0))}
    mesh = ball_mesh if name == "ball" else meshes[name]()
    count = len(mesh.boundary_nodes)
    made = add_layers(mesh, np.full(count, height), np.full(count, 3.0))
    fine = made.mesh
    # Positive volumes are checked when a mesh is made; together with this they leave no gap and no overlap.
    assert fine.volume == pytest.approx(mesh.volume, rel=1e-12)
    assert len(fine.boundary_faces) == len(mesh.boundary_faces)
    assert fine.area == pytest.approx(mesh.area, rel=1e-12)
    assert len(fine.points) > len(mesh.points) + count
    # Tetrahedra of a column lie over the one that they are told to.
    assert np.array_equal(np.unique(made.parents), np.arange(len(mesh.tetrahedra)))


def test_the_first_layer_is_as_high_as_wanted(ball_mesh: TetMesh) -> None:
    fine = layered(ball_mesh, 0.1)
    height = 3.0 * fine.volumes[fine.boundary_cells] / fine.boundary_areas
    assert np.median(height) == pytest.approx(0.1, rel=0.2)
    assert height.max() < 0.25


def test_interfaces_stay(ball_mesh: TetMesh) -> None:
    inside = np.linalg.norm(ball_mesh.points[ball_mesh.tetrahedra].mean(axis=1), axis=1) < 5.0
    two = TetMesh(ball_mesh.points, ball_mesh.tetrahedra, regions=inside.astype(np.int64))
    fine = layered(two, 0.2)
    assert fine.region_volumes[1] == pytest.approx(two.region_volumes[1], rel=1e-12)
    assert fine.region_volumes[0] == pytest.approx(two.region_volumes[0], rel=1e-12)


def test_no_layers_where_no_light_falls(ball_mesh: TetMesh) -> None:
    heights = np.full(len(ball_mesh.boundary_nodes), np.inf)
    assert add_layers(ball_mesh, heights, np.zeros(len(heights))).mesh is ball_mesh
    assert np.isinf(layer_sizes(ball_mesh, [Deposit(hints=MeshHints(resolution=1.0))], 0.02)[0]).all()


def test_layers_grow_away_from_the_light(ball_mesh: TetMesh) -> None:
    top = np.array([[0.0, 0.0, 10.0]])
    heights, depths = layer_sizes(ball_mesh, [Deposit(hints=MeshHints(lit=top, depths=np.array([1.0])))], 0.005)
    nodes = ball_mesh.boundary_points
    at_top, below = nodes[:, 2].argmax(), nodes[:, 2].argmin()
    assert (heights[at_top], depths[at_top]) == pytest.approx((0.1, 3.0))
    assert heights[below] > 2.0
    assert depths[below] == 0.0


def test_what_layers_are_good_for() -> None:
    """A ball of radius 30 on the mesher's own mesh: L2 error 2.5 % with layers, 5 % without."""
    medium, surface = Medium(sigma_a=0.01, sigma_s_prime=0.99, eta=1.0), sphere(30.0)
    mesh = tetrahedralize(surface)
    errors = []
    for each in (mesh, layered(mesh, 0.2)):
        solution = System(each, medium, surface).solve([CollimatedBeam((0.0, 0.0, -1.0))])
        gamma = np.arccos(each.boundary_points[:, 2] / np.linalg.norm(each.boundary_points, axis=1))
        truth, areas = sphere_light.beam_exitance(medium, radius=30.0, gamma=gamma), each.boundary_node_areas
        errors.append(float(np.sqrt(areas @ (solution.exitance - truth) ** 2 / (areas @ truth**2))))
        assert abs(solution.power.balance_error) < 1e-9
    assert errors[1] < 0.035
    assert errors[0] > 1.5 * errors[1]


def test_a_balls_facets_know_the_ball(ball_mesh: TetMesh) -> None:
    facets = np.arange(len(ball_mesh.boundary_faces))
    weights = np.full((len(facets), 3), 1.0 / 3.0)
    curved, flat = CurvedFacets(ball_mesh), ball_mesh.points[ball_mesh.boundary_faces].mean(axis=1)
    normals = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.abs(curved.normals_at(facets, weights) - normals).max() < 0.01
    # Between the ball and its tangent planes: as far above the ball as the facet is below it.
    below, above = 10.0 - np.linalg.norm(flat, axis=1), np.linalg.norm(curved.points_at(facets, weights), axis=1) - 10.0
    assert above == pytest.approx(below, rel=0.1)
