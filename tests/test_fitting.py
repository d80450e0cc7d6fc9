"""Layers along the boundary that are thinner than their tetrahedra."""

import numpy as np
import pytest

from tetlux.fem import DiffuseLight, Emission, Light, Medium, PencilBeam, PointSource, Region, System, solve
from tetlux.fem.exact import concentric, sphere_light
from tetlux.fem.media.coefficients import coefficients_of
from tetlux.fem.operators.fitting import fitting_of
from tetlux.meshing import TetMesh, sphere, tetrahedralize


@pytest.fixture(scope="module")
def coarse() -> TetMesh:
    return tetrahedralize(sphere(10.0), edge_length=2.5)


@pytest.mark.parametrize("sigma_a", [0.3, 1.0, 3.0, 30.0, 1000.0])
@pytest.mark.parametrize("eta", [1.0, 1.4])
def test_diffuse_light_on_what_absorbs(coarse: TetMesh, sigma_a: float, eta: float) -> None:
    """On 600 nodes: mean within 1 % and error within 4 % of the light that falls on it.

    Measured over eight meshes: .79 % and 3.9 % at worst.
    """
    medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=eta)
    solution = System(coarse, medium, sphere(10.0)).solve([DiffuseLight(1.0)])
    transmitted = float(np.max(solution.transmitted_irradiance))
    exact = transmitted * sphere_light.diffuse_exitance(medium, radius=10.0)
    areas = coarse.boundary_node_areas
    off = solution.exitance - exact
    assert abs(areas @ off) / areas.sum() < 0.012
    assert np.sqrt(areas @ off**2 / areas.sum()) < 0.05
    assert abs(solution.power.balance_error) < 1e-12


def test_without_fitting_the_same_is_wrong_by_as_much_as_there_is(
    coarse: TetMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    medium = Medium(sigma_a=30.0, sigma_s_prime=1.0, eta=1.0)
    exact = sphere_light.diffuse_exitance(medium, radius=10.0)
    monkeypatch.setattr("tetlux.fem.system.fitting_of", lambda *_: None)
    plain = System(coarse, medium, sphere(10.0)).solve([DiffuseLight(1.0)])
    assert np.abs(plain.exitance - exact).max() > 0.8


def test_the_tolerance_is_met_or_told_of() -> None:
    """Estimates were a hundredth of the error in layers that no tetrahedron shows, and tolerances met that were not."""
    for sigma_a in (0.3, 3.0, 30.0):
        medium = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=1.4)
        solution = solve(sphere(30.0), medium, [DiffuseLight(1.0)], tolerance=0.05, most_tetrahedra=10_000)
        exact = float(np.max(solution.transmitted_irradiance)) * sphere_light.diffuse_exitance(medium, radius=30.0)
        areas = solution.mesh.boundary_node_areas
        error = float(np.sqrt(areas @ (solution.exitance - exact) ** 2 / areas.sum())) / abs(exact)
        assert solution.error_estimate > 0.5 * error
        told = any("tolerance of 0.05 was not met" in warning for warning in solution.warnings)
        assert told == (solution.error_estimate > 0.05)


@pytest.mark.parametrize("light", [PencilBeam((0.0, 0.0, 20.0), (0.0, 0.0, -1.0)), PointSource((0.0, 0.0, 9.0), 1.0)])
def test_points_and_beams_are_not_fitted(coarse: TetMesh, light: Light, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their fluence is no layer: fitted, a point one mean free path deep let five times as much out."""
    medium = Medium(sigma_a=1.0, sigma_s_prime=1.0, eta=1.4)
    assert fitting_of(coarse, coefficients_of(medium)) is not None
    found = System(coarse, medium, sphere(10.0)).solve([light, DiffuseLight(1.0)])
    assert abs(found.power.balance_error) < 1e-12
    monkeypatch.setattr("tetlux.fem.system.fitting_of", lambda *_: None)
    plain = System(coarse, medium, sphere(10.0)).solve([light, DiffuseLight(1.0)])
    # Up to rounding, which shows where the fluence is far below its maximum.
    fluence = plain.of_lights[0].fluence
    np.testing.assert_allclose(found.of_lights[0].fluence, fluence, rtol=1e-12, atol=1e-15 * fluence.max())
    assert not np.allclose(found.of_lights[1].fluence, plain.of_lights[1].fluence, rtol=0.1)


@pytest.mark.parametrize("sigma_a", [0.01, 0.1, 1.0, 10.0, 100.0])
@pytest.mark.parametrize("eta", [1.0, 1.4])
def test_a_ball_that_glows_in_what_absorbs(sigma_a: float, eta: float) -> None:
    """Measured: error .0001 to .05 on the mesher's own mesh, estimates .64 to 18 times that; 17 times M before."""
    medium, body = Medium(sigma_a=sigma_a, sigma_s_prime=1.0, eta=eta), sphere(10.0)
    exact = sphere_light.glow_exitance(medium, radius=10.0)
    for solution in (
        solve(tetrahedralize(body), medium, [Emission(1.0)]),
        solve(body, medium, [Emission(1.0)], tolerance=0.05, most_tetrahedra=60_000),
    ):
        areas = solution.mesh.boundary_node_areas
        error = float(np.sqrt(areas @ (solution.exitance - exact) ** 2 / areas.sum())) / exact
        assert error < 0.07
        assert solution.error_estimate > 0.5 * error
        assert abs(solution.power.balance_error) < 1e-12


def test_layers_at_interfaces_are_in_the_estimate() -> None:
    """A core that absorbs within a hundredth of its tetrahedra: 7 % wrong, and the estimate said .7 %."""
    core, shell = Medium(sigma_a=100.0, sigma_s_prime=1.0, eta=1.4), Medium(sigma_a=0.001, sigma_s_prime=1.0, eta=1.4)
    regions = [Region(sphere(4.0), core)]
    solution = solve(sphere(8.0), shell, [DiffuseLight(1.0)], regions=regions, most_tetrahedra=60_000)
    exact = float(np.max(solution.transmitted_irradiance))
    exact *= concentric.diffuse_exitance(core, shell, core_radius=4.0, radius=8.0)
    areas = solution.mesh.boundary_node_areas
    error = float(np.sqrt(areas @ (solution.exitance - exact) ** 2 / areas.sum())) / exact
    # Measured 1.2 to 1.3; 1.0 to 2.5 for other cores, glowing ones among them.
    assert 0.7 < solution.error_estimate / error < 3.0


def test_meshes_that_show_the_layer_are_left_alone(coarse: TetMesh) -> None:
    assert fitting_of(coarse, coefficients_of(Medium(sigma_a=0.001, sigma_s_prime=1.0, eta=1.4))) is None
    assert fitting_of(coarse, coefficients_of(Medium(sigma_a=0.0, sigma_s_prime=1.0, eta=1.4))) is None
