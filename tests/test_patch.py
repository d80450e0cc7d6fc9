"""Diffuse light on a round patch: its power, its limits, and what it must not light."""

import numpy as np
import pytest

from tests.conftest import TISSUE, block
from tests.lights_made import deposit_on_mesh
from tetlux.fem import DiffuseLight, DiffusePatch, Medium, PointSource, Solution, System
from tetlux.fem.body.body import Body
from tetlux.fem.media.fresnel import moments
from tetlux.meshing import InputError, Surface, TetMesh

CUBE = block((12, 12, 8), (12.0, 12.0, 8.0))
PLATE = block((12, 12, 2), (12.0, 12.0, 1.0))
TOP = (0.3, 0.1, 0.0)


def power(mesh: TetMesh, irradiance: object) -> float:
    return float(mesh.boundary_node_areas @ np.asarray(irradiance))


def solved(mesh: TetMesh, *lights: DiffusePatch | DiffuseLight | PointSource) -> Solution:
    return System(mesh, TISSUE).solve(lights)


@pytest.mark.parametrize("radius", [0.01, 0.2, 1.0, 3.7, 5.0])
def test_it_lights_a_disc_of_a_flat_face(radius: float) -> None:
    deposit = deposit_on_mesh(DiffusePatch(TOP, radius, 2.0), CUBE, TISSUE)
    incident = 2.0 * np.pi * radius**2
    assert power(CUBE, deposit.terms.irradiance) == pytest.approx(incident, rel=2e-3)
    c1, _ = moments(TISSUE.eta)
    entered = incident * TISSUE.eta**2 * (1.0 - 2.0 * c1)
    assert power(CUBE, deposit.terms.transmitted_irradiance) == pytest.approx(entered, rel=2e-3)


def test_it_lights_a_cap_of_a_ball(ball_mesh: TetMesh) -> None:
    """A sphere cuts a cap of area pi radius² off another one through its center; facets lie some per cent within."""
    for radius in (3.0, 8.0, 15.0):
        deposit = deposit_on_mesh(DiffusePatch((0.0, 0.0, 10.0), radius, 1.0), ball_mesh, TISSUE)
        assert power(ball_mesh, deposit.terms.irradiance) == pytest.approx(np.pi * radius**2, rel=0.03)


def test_on_all_of_a_body_it_is_diffuse_light(ball: Surface, ball_mesh: TetMesh) -> None:
    patch, diffuse = solved(ball_mesh, DiffusePatch((0.0, 0.0, 10.0), 21.0, 0.7)), solved(ball_mesh, DiffuseLight(0.7))
    assert patch.exitance == pytest.approx(diffuse.exitance, rel=1e-8)
    assert patch.power.incident == pytest.approx(diffuse.power.incident, rel=1e-12)


def test_light_is_proportional_and_accounted_for() -> None:
    one, three = (solved(CUBE, DiffusePatch(TOP, 2.0, irradiance)) for irradiance in (1.0, 3.0))
    assert three.exitance == pytest.approx(3.0 * one.exitance, rel=1e-8)
    assert abs(one.power.balance_error) < 1e-9


def test_a_small_patch_is_a_point_on_the_surface() -> None:
    """``D dphi/dn + phi/(2A) = 2 E_t/(1 + 3 C2)`` on a small patch is a point there, of this times its area in power.

    The difference far away goes with the square of the radius, down to what the facet that holds it blurs: the patch
    is in its middle, where both load its nodes alike.
    """
    far = np.flatnonzero(CUBE.points[CUBE.boundary_nodes][:, 2] < -7.9)
    c1, c2 = moments(TISSUE.eta)
    facet = CUBE.closest_boundary(np.array([TOP]))[1][0]
    x, y, _ = CUBE.points[CUBE.boundary_faces[facet]].mean(axis=0).tolist()
    strength = 2.0 * TISSUE.eta**2 * (1.0 - 2.0 * c1) / (1.0 + 3.0 * c2)
    point = System(CUBE, TISSUE).solve([PointSource((x, y, -1e-6), strength)], subtract="nothing").exitance[far]
    off = []
    for radius in (2.0, 1.0, 0.1):
        lit = solved(CUBE, DiffusePatch((x, y, 0.0), radius, 1.0 / (np.pi * radius**2)))
        off.append(float(np.abs(lit.exitance[far] / point - 1.0).max()))
    assert off[2] < 2e-3
    assert off[1] < 0.5 * off[0] < 0.1


def test_the_far_side_of_a_plate_stays_dark() -> None:
    deposit = deposit_on_mesh(DiffusePatch(TOP, 2.0, 1.0), PLATE, TISSUE)
    below = PLATE.points[PLATE.boundary_nodes][:, 2] < -0.9
    assert np.asarray(deposit.terms.irradiance)[below].max() == 0.0
    assert power(PLATE, deposit.terms.irradiance) == pytest.approx(4.0 * np.pi, rel=2e-3)


def test_what_is_wrong_is_said() -> None:
    body = Body(CUBE.surface, (TISSUE,))
    with pytest.raises(InputError, match=r"center of the patch \(0, 0, 5\) is 5 .* from the surface, more than its"):
        DiffusePatch((0.0, 0.0, 5.0), 1.0, 1.0).deposit_in(body)
    with pytest.raises(InputError, match="radius is 0; give a number"):
        DiffusePatch(TOP, 0.0, 1.0)
    classic = Medium(sigma_a=0.01, sigma_s_prime=1.0, eta=1.4, boundary="classic")
    with pytest.raises(InputError, match='a diffuse patch needs the boundary "exact"'):
        DiffusePatch(TOP, 1.0, 1.0).deposit_in(Body(CUBE.surface, (classic,)))
