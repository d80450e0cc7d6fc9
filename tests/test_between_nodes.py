"""The exitance between nodes."""

from dataclasses import replace

import numpy as np
import pytest

from tetlux.fem import Medium, PencilBeam, PointSource, solve
from tetlux.fem.outcome.solution import Solution
from tetlux.fem.sources.light import Light
from tetlux.meshing import box, tetrahedralize
from tetlux.meshing.arrays import NumberArray

MEDIUM = Medium(sigma_a=0.1, sigma_s_prime=1.0, eta=1.4)
SIDES = [[0.3, -5.0, 1.7], [5.0, 2.2, -3.1], [-1.3, 5.0, 4.4], [-5.0, -4.1, -0.2]]


@pytest.fixture(scope="module")
def solution() -> Solution:
    block = box((10.0, 10.0, 10.0))
    lights: list[Light] = [PencilBeam((0.0, 0.0, 9.0), (0.0, 0.0, -1.0)), PointSource((2.0, 1.0, -1.0))]
    return solve(tetrahedralize(block, edge_length=2.5), MEDIUM, lights, subtract="nothing")


def with_fluence(solution: Solution, fluence: NumberArray) -> Solution:
    return replace(solution, fluence=fluence, of_lights=())


def test_light_that_fades_exponentially_is_exact_between_nodes(solution: Solution) -> None:
    fading = np.array([0.6, -0.8, 1.8])
    values = np.exp(solution.mesh.points @ fading)
    wanted = np.exp(np.array(SIDES) @ fading) / (2.0 * MEDIUM.boundary_factor)
    assert with_fluence(solution, values).exitance_at(np.array(SIDES)) == pytest.approx(wanted, rel=1e-9)


def test_phase_and_amplitude_are_followed_too(solution: Solution) -> None:
    fading = np.array([0.6, -0.8, 1.8]) * (1.0 + 0.1j)
    found = with_fluence(solution, np.exp(solution.mesh.points @ fading)).exitance_at(np.array(SIDES))
    assert found == pytest.approx(np.exp(np.array(SIDES) @ fading) / (2.0 * MEDIUM.boundary_factor), rel=1e-9)


@pytest.mark.parametrize("shift", [0.0, -20.0, 50.0])
def test_mild_values_and_those_of_both_signs_are_linear(solution: Solution, shift: float) -> None:
    along = np.array([0.3, -0.4, 0.9])
    found = with_fluence(solution, solution.mesh.points @ along + shift).exitance_at(np.array(SIDES))
    nodes = solution.mesh.boundary_faces[solution.mesh.closest_boundary(np.array(SIDES))[1]]
    wanted = (np.array(SIDES) @ along + shift) / (2.0 * MEDIUM.boundary_factor)
    at_nodes = (solution.mesh.points @ along + shift)[nodes]
    is_linear = (at_nodes.min(axis=1) < 0) & (at_nodes.max(axis=1) > 0) | (shift != 0)
    assert is_linear.any()
    assert found[is_linear] == pytest.approx(wanted[is_linear], rel=1e-9)


def test_one_dark_node_does_not_darken_its_facets(solution: Solution) -> None:
    values = np.ones(len(solution.mesh.points))
    node = solution.mesh.boundary_faces[0, 0]
    values[node] = 1e-9
    middle = solution.mesh.points[solution.mesh.boundary_faces[0]].mean(axis=0)
    (found,) = with_fluence(solution, values).exitance_at(middle[None])
    assert found == pytest.approx(2.0 / 3.0 / (2.0 * MEDIUM.boundary_factor), rel=1e-6)


def test_lights_add_up_between_nodes(solution: Solution) -> None:
    total = sum(light.exitance_at(np.array(SIDES)) for light in solution.of_lights)
    assert len(solution.of_lights) == 2
    assert solution.exitance_at(np.array(SIDES)) == pytest.approx(total, rel=1e-12)
